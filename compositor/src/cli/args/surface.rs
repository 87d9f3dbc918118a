//! Isosurfaces as words: `20000:steelblue`, `otsu`.

use brickcast_volume::style::Isosurface;

use super::color::{Color, color};

/// An isosurface of which the store may have to tell the value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfaceArg {
    /// Data units; none: Otsu's threshold of the store's voxels.
    value: Option<f64>,
    look: Color,
}

/// The colour of an isosurface that none was given for.
const SURFACE: [f32; 3] = [0.86, 0.84, 0.80];

/// `VALUE`, `VALUE:COLOUR` or `VALUE:COLOUR,A`; a value is a number or `otsu`.
///
/// # Errors
/// What is neither.
pub(crate) fn surface(text: &str) -> Result<SurfaceArg, String> {
    let (value, look) = text.split_once(':').map_or((text, None), |(value, look)| (value.trim(), Some(look)));
    let value = match value {
        "otsu" => None,
        number => {
            let wrong = |_| format!("--isosurface {text}: `{number}` is neither a number nor otsu");
            Some(number.trim().parse::<f64>().map_err(wrong)?)
        }
    };
    let look = match look {
        None => Color { rgb: SURFACE, opacity: None },
        Some(look) => color(look).map_err(|why| format!("--isosurface {text}: {why}"))?,
    };
    Ok(SurfaceArg { value, look })
}

impl SurfaceArg {
    /// True where it waits for a store.
    pub(crate) fn is_at_otsu(&self) -> bool {
        self.value.is_none()
    }

    /// Where it waits for nothing.
    pub(crate) fn known(&self) -> Option<Isosurface> {
        self.value.map(|value| self.on(value))
    }

    /// On a store with this threshold, data units.
    pub(crate) fn on(&self, otsu: f64) -> Isosurface {
        let Color { rgb, opacity } = self.look;
        Isosurface { value: self.value.unwrap_or(otsu), color: rgb, opacity: opacity.unwrap_or(1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn isosurfaces_have_a_value_and_perhaps_a_colour() {
        let of = |text: &str| surface(text).map(|surface| surface.on(99.0));
        let plain = of("-12.5").unwrap();
        assert_eq!((plain.value, plain.color, plain.opacity), (-12.5, SURFACE, 1.0));
        let red = of("1e3:1,0,0").unwrap();
        assert_eq!((red.value, red.color, red.opacity), (1000.0, [1.0, 0.0, 0.0], 1.0));
        assert_eq!(of("1e3:red"), Ok(red));
        assert_eq!(of("1e3:#f00"), Ok(red));
        assert_eq!(of("7:0,0,1,0.25"), of("7:#00f:0.25"));
        assert_eq!(of("7:0,0,1,0.25"), of("7:blue,0.25"));
        assert_eq!(of("otsu").unwrap().value, 99.0);
        assert_eq!(of("otsu:red"), Ok(Isosurface { value: 99.0, ..red }));
        for bad in ["", "x", "1:", "1:1,2", "1:1,2,3,4,5", "1:a,b,c", "1:2,0,0", "otsu:reddish", "Otsu"] {
            assert!(of(bad).is_err(), "{bad}");
        }
    }
}

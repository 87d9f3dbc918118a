//! Cuts along an axis of the world: `z=50%`.

use brickcast_volume::style::ClipPlane;
use glam::DVec3;

/// A half space along an axis of the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// 0, 1 or 2.
    axis: usize,
    /// What lies above the place stays, else what lies below.
    above: bool,
    place: Place,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    /// World units.
    World(f64),
    /// Of the way from the volume's lowest to its highest coordinate, 0..=100.
    Percent(f64),
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// `AXIS=PLACE` and `AXIS<PLACE` keep what lies below, `AXIS>PLACE` what lies above; a place is a coordinate, or with
/// `%` a part of the volume's box.
///
/// # Errors
/// Another axis, what is no number, a part outside 0..=100.
pub(crate) fn cut(text: &str) -> Result<Cut, String> {
    let parts = text.find(['=', '<', '>']).map(|at| (text[..at].trim(), &text[at..=at], text[at + 1..].trim()));
    let Some((axis, sign, place)) = parts else {
        return Err(format!("`{text}` is not AXIS=PLACE, such as z=50% (in a shell, quote < and >: 'z>50%')"));
    };
    let axis = AXES.iter().position(|name| axis.eq_ignore_ascii_case(name));
    let axis = axis.ok_or_else(|| format!("`{text}`: the axis is x, y or z"))?;
    let (number, percent) = place.strip_suffix('%').map_or((place, false), |number| (number.trim_end(), true));
    let value = number.parse::<f64>().ok().filter(|v| v.is_finite());
    let value = value.ok_or_else(|| format!("`{text}`: `{place}` is neither a coordinate nor percent"))?;
    if percent && !(0.0..=100.0).contains(&value) {
        return Err(format!("`{text}`: the part of the volume lies between 0% and 100%"));
    }
    let place = if percent { Place::Percent(value) } else { Place::World(value) };
    Ok(Cut { axis, above: sign == ">", place })
}

impl Cut {
    /// World units; `lo` and `hi` are the volume's corners.
    fn at(self, (lo, hi): (DVec3, DVec3)) -> f64 {
        let (lo, hi) = (lo[self.axis], hi[self.axis]);
        match self.place {
            Place::World(value) => value,
            Place::Percent(part) => lo + (hi - lo) * (part / 100.0),
        }
    }

    /// On a volume with these corners.
    pub(crate) fn plane(self, corners: (DVec3, DVec3)) -> ClipPlane {
        let (axis, at) = (DVec3::AXES[self.axis], self.at(corners));
        if self.above { ClipPlane { normal: axis, offset: at } } else { ClipPlane { normal: -axis, offset: -at } }
    }

    /// What it keeps of a volume with these corners.
    pub(crate) fn told(self, corners: (DVec3, DVec3)) -> String {
        let (axis, sign) = (AXES[self.axis], if self.above { ">=" } else { "<=" });
        let (lo, hi) = (corners.0[self.axis], corners.1[self.axis]);
        format!("cut: what lies at {axis} {sign} {} stays, of {lo} to {hi}", self.at(corners))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: (DVec3, DVec3) = (DVec3::new(-1.0, 10.0, 0.0), DVec3::new(1.0, 30.0, 8.0));

    fn plane(text: &str) -> (DVec3, f64) {
        let plane = cut(text).unwrap().plane(CORNERS);
        (plane.normal, plane.offset)
    }

    #[test]
    fn a_cut_keeps_what_lies_below_or_above_a_place() {
        assert_eq!(plane("z=50%"), (DVec3::NEG_Z, -4.0));
        assert_eq!(plane("z<50%"), plane("z=50%"));
        assert_eq!(plane("Z > 25 %"), (DVec3::Z, 2.0));
        assert_eq!(plane("y>12.5"), (DVec3::Y, 12.5));
        assert_eq!(plane("x=-0.5"), (DVec3::NEG_X, 0.5));
        assert_eq!((plane("y=0%").1, plane("y=100%").1), (-10.0, -30.0));
        assert_eq!(cut("y<25%").unwrap().told(CORNERS), "cut: what lies at y <= 15 stays, of 10 to 30");
    }

    #[test]
    fn other_axes_places_and_parts_are_named() {
        for (text, why) in [
            ("z", "quote < and >"),
            ("50%", "AXIS=PLACE"),
            ("w=1", "x, y or z"),
            ("=1", "x, y or z"),
            ("z=", "neither"),
            ("z=half", "`half`"),
            ("z>=1", "`=1`"),
            ("z=inf", "neither"),
            ("z=101%", "between 0% and 100%"),
            ("z=-1%", "between 0% and 100%"),
        ] {
            let error = cut(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }
}

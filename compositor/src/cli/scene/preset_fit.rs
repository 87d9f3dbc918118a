//! Colour maps written over 0 to 1, and volumes whose values lie elsewhere.

use brickcast_volume::store::Manifest;
use brickcast_volume::transfer_function::{Preset, default_opacities};

/// What becomes of a preset on a volume.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Fit {
    /// Drawn as it is, x in data units.
    AsItIs,
    /// Drawn as it is, and this is told.
    Told(String),
    /// Its colours over this window, and this is told.
    Stretched([f64; 2], String),
}

/// A preset covers so little of the volume's values that it was made for others.
const FOREIGN: f64 = 0.5;

/// Smallest and largest value that a picture of the volume may show.
pub(crate) fn values_of(volume: &Manifest) -> [f64; 2] {
    let (lo, hi) = volume.range;
    [volume.min, volume.max].map(|v| v.clamp(lo, hi))
}

/// A preset that was not rescaled, on a volume.
pub(crate) fn fit(preset: &Preset, volume: &Manifest) -> Fit {
    let ramp = default_opacities(volume.otsu, volume.quantile_999);
    fit_over(preset, values_of(volume), [ramp[0].x, ramp[ramp.len() - 1].x])
}

fn fit_over(preset: &Preset, [lo, hi]: [f64; 2], window: [f64; 2]) -> Fit {
    let (colors, opacities) = (preset.function.colors(), preset.function.opacities());
    let own = if preset.has_opacities { opacities } else { &[] };
    let xs = || colors.iter().map(|p| p.x).chain(own.iter().map(|p| p.x));
    let (first, last) = (xs().fold(f64::MAX, f64::min), xs().fold(f64::MIN, f64::max));
    if preset.is_categorical || first >= last {
        return Fit::AsItIs;
    }
    let shared = last.min(hi) - first.max(lo);
    let covers = if hi > lo { shared / (hi - lo) } else { f64::from(u8::from(shared >= 0.0)) };
    // ParaView writes its maps over 0 to 1 and some over -1 to 1, and stretches them over the data itself.
    let is_normalised = first >= -1.0 && last <= 1.0 && covers < FOREIGN;
    let runs = format!("values run from {lo} to {hi}");
    if is_normalised && !preset.has_opacities {
        let [from, to] = window;
        return Fit::Stretched(
            window,
            format!(
                "its colours span {first} to {last} while {runs}: stretched over {from} to {to}; \
                 --transfer-function-range LO,HI chooses another range"
            ),
        );
    }
    if is_normalised || shared < 0.0 {
        let stretch = if hi > lo { format!("{lo},{hi}") } else { "LO,HI".to_owned() };
        return Fit::Told(format!(
            "it spans {first} to {last} while {runs}, so that most values take the end of it; \
             --transfer-function-range {stretch} stretches it"
        ));
    }
    Fit::AsItIs
}

#[cfg(test)]
mod tests {
    use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};

    use super::*;

    fn preset(first: f64, last: f64, has_opacities: bool) -> Preset {
        let colors = [first, last].map(|x| ColorPoint { x, rgb: [0.5; 3] }).to_vec();
        let xs = if has_opacities { [first, last] } else { [9000.0, 39_000.0] };
        let opacities = xs.map(|x| OpacityPoint { x, opacity: 0.5 }).to_vec();
        let function = TransferFunction::new(colors, opacities).unwrap();
        Preset { name: None, function, has_opacities, is_categorical: false, notes: vec![] }
    }

    #[test]
    fn maps_over_0_to_1_are_stretched_where_the_values_lie_elsewhere() {
        let window = [9000.0, 39_000.0];
        let fit = |preset: &Preset, values| fit_over(preset, values, window);
        let scan = [2000.0, 40_000.0];
        for (first, last) in [(0.0, 1.0), (-1.0, 1.0), (0.25, 0.75)] {
            let Fit::Stretched(over, told) = fit(&preset(first, last, false), scan) else { panic!("{first} {last}") };
            assert_eq!(over, window);
            assert!(told.contains("2000 to 40000") && told.contains("--transfer-function-range LO,HI"), "{told}");
            let Fit::Told(told) = fit(&preset(first, last, true), scan) else { panic!("{first} {last}") };
            assert!(told.contains("--transfer-function-range 2000,40000"), "{told}");
        }
        // Volumes of numbers near 0 to 1, as simulations write them.
        for values in [[0.0, 1.0], [-0.02, 1.1], [0.2, 0.3], [0.5, 0.5], [0.0, 2.0]] {
            assert_eq!(fit(&preset(0.0, 1.0, false), values), Fit::AsItIs, "{values:?}");
            assert_eq!(fit(&preset(0.0, 1.0, true), values), Fit::AsItIs, "{values:?}");
        }
        // A window of a scan is meant as it is; what lies beside all values is told.
        assert_eq!(fit(&preset(3000.0, 3500.0, true), scan), Fit::AsItIs);
        assert!(matches!(fit(&preset(50_000.0, 60_000.0, false), scan), Fit::Told(_)));
        assert!(matches!(fit(&preset(0.0, 1.0, false), [7.0, 7.0]), Fit::Stretched(..)));
    }
}

//! Transfer functions without a file: a window, and the default.

use super::colormap::Colormap;
use super::function::{ColorPoint, MAX_X, OpacityPoint, TransferFunction, TransferFunctionError};

/// Opacity of the default function at the 99.9 % quantile, and of a window where none is given.
pub const DEFAULT_OPACITY: f64 = 0.5;

impl TransferFunction {
    /// Opacity 0 at `lo` rising linearly to `opacity` at `hi` (data units), clamped outside; `colormap` stretched over
    /// `[lo, hi]`.
    ///
    /// # Errors
    /// `lo` and `hi` not finite, not in this order or too close for the map's points; an opacity outside 0..=1.
    pub fn window(lo: f64, hi: f64, opacity: f64, colormap: Colormap) -> Result<Self, TransferFunctionError> {
        let opacities = vec![OpacityPoint { x: lo, opacity: 0.0 }, OpacityPoint { x: hi, opacity }];
        Self::new(colormap.points_over(lo, hi), opacities).map_err(|error| match error {
            TransferFunctionError::Order { .. } => TransferFunctionError::Window { lo, hi },
            other => other,
        })
    }

    /// The function for a volume of which nothing else is known: opacity 0 up to Otsu's threshold of all voxels, then
    /// linear to [`DEFAULT_OPACITY`] at the 99.9 % quantile; black to white over the same range (docs/definition.md,
    /// Transfer function 4).
    ///
    /// Where the threshold is not below the quantile (a constant volume, or less than 0.1 % of the voxels above the
    /// threshold), there is no range: the function steps up right above the threshold, within a thousandth of its
    /// magnitude, so that the few voxels above it are seen and the rest is not. Numbers that are not finite count as 0.
    #[must_use]
    pub fn default_for(otsu: f64, q999: f64) -> Self {
        let (lo, hi, _) = default_range(otsu, q999);
        Self {
            colors: vec![ColorPoint { x: lo, rgb: [0.0; 3] }, ColorPoint { x: hi, rgb: [1.0; 3] }],
            opacities: default_opacities(otsu, q999),
        }
    }
}

/// The default function's opacities alone, for presets that bring only colours.
#[must_use]
pub fn default_opacities(otsu: f64, q999: f64) -> Vec<OpacityPoint> {
    let (lo, hi, _) = default_range(otsu, q999);
    vec![OpacityPoint { x: lo, opacity: 0.0 }, OpacityPoint { x: hi, opacity: DEFAULT_OPACITY }]
}

/// The line that tells the user what the default function is and how to change it.
#[must_use]
pub fn describe_default(otsu: f64, q999: f64) -> String {
    let (_, _, has_range) = default_range(otsu, q999);
    let ramp = describe_default_opacities(otsu, q999);
    let colors = if has_range { ", black to white" } else { "" };
    format!("transfer function: {ramp}{colors}; change it with --window LO,HI --opacity X --colormap NAME")
}

/// The default function's opacities in words, where colours come from elsewhere.
#[must_use]
pub fn describe_default_opacities(otsu: f64, q999: f64) -> String {
    let (lo, hi, has_range) = default_range(otsu, q999);
    if has_range {
        format!(
            "opacity 0 below {lo} (Otsu's threshold), then linear to {DEFAULT_OPACITY} at {hi} (the 99.9 % quantile)"
        )
    } else {
        format!(
            "opacity {DEFAULT_OPACITY} above {lo} (Otsu's threshold), 0 below, since the 99.9 % quantile {q999} leaves \
             no range above it"
        )
    }
}

/// Where the default function rises, and whether the two numbers leave a range of their own. Bounded, so that the
/// points made of it are always valid.
fn default_range(otsu: f64, q999: f64) -> (f64, f64, bool) {
    let bounded = |v: f64| if v.is_finite() { v.clamp(-MAX_X, MAX_X) } else { 0.0 };
    let (lo, hi) = (bounded(otsu), bounded(q999));
    if lo < hi {
        return (lo, hi, true);
    }
    // Wide enough that f32 codes tell both ends apart, narrow enough to be a step.
    let width = match lo.abs().max(hi.abs()) {
        0.0 => 1e-3,
        magnitude => (magnitude * 1e-3).max(f64::MIN_POSITIVE),
    };
    if lo + width > MAX_X { (lo - width, lo, false) } else { (lo, lo + width, false) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn window_rises_from_lo_to_hi_and_is_clamped_outside() {
        let f = TransferFunction::window(-100.0, 300.0, 0.8, Colormap::Viridis).unwrap();
        for (x, want) in [(-1e9, 0.0), (-100.0, 0.0), (100.0, 0.4), (300.0, 0.8), (1e9, 0.8)] {
            assert!((f.opacity(x) - want).abs() < 1e-12, "{x}");
        }
        assert_eq!(f.color(-200.0), Colormap::Viridis.points()[0].rgb);
        assert_eq!(f.color(400.0), Colormap::Viridis.points().last().unwrap().rgb);
    }

    #[test]
    fn impossible_windows_are_refused_with_their_numbers() {
        for (lo, hi) in [(5.0, 5.0), (6.0, 5.0), (f64::NAN, 1.0), (0.0, f64::INFINITY), (1.0, 1.0_f64.next_up())] {
            let error = TransferFunction::window(lo, hi, 0.5, Colormap::Turbo).unwrap_err();
            assert!(matches!(error, TransferFunctionError::Window { .. }), "{error}");
            assert!(error.to_string().contains(&hi.to_string()), "{error}");
        }
        let error = TransferFunction::window(0.0, 1.0, 1.5, Colormap::Turbo).unwrap_err();
        assert!(error.to_string().contains("1.5"), "{error}");
    }

    #[test]
    fn default_is_the_documented_ramp() {
        let f = TransferFunction::default_for(100.0, 300.0);
        assert_eq!((f.opacity(99.0), f.opacity(200.0), f.opacity(300.0), f.opacity(900.0)), (0.0, 0.25, 0.5, 0.5));
        assert_eq!((f.color(100.0), f.color(200.0), f.color(300.0)), ([0.0; 3], [0.5; 3], [1.0; 3]));
        let line = describe_default(100.0, 300.0);
        for part in ["100", "300", "--window LO,HI", "--opacity X", "--colormap NAME"] {
            assert!(line.contains(part), "{line}");
        }
    }

    #[test]
    fn default_of_volumes_without_contrast_is_valid() {
        let strange = [0.0, -0.0, 1.0, -7.5, 1e300, -1e300, f64::MAX, f64::MIN, f64::NAN, f64::INFINITY, 5e-324];
        for otsu in strange {
            for q999 in strange {
                let f = TransferFunction::default_for(otsu, q999);
                let again = TransferFunction::new(f.colors().to_vec(), f.opacities().to_vec());
                assert_eq!(again.as_ref(), Ok(&f), "{otsu} {q999}");
                assert!(describe_default(otsu, q999).contains("--window"));
            }
        }
        let sparse = TransferFunction::default_for(40.0, 0.0);
        assert_eq!((sparse.opacity(40.0), sparse.opacity(41.0)), (0.0, 0.5));
    }
}

//! Functions of projections: each shows another statistic of a ray, which lies elsewhere than the voxels' values do.

use super::colormap::Colormap;
use super::function::{OpacityPoint, TransferFunction, TransferFunctionError};

/// Grey values from black at `lo` to white at `hi`, data units; opaque, or clear up to `lo` and opaque from there on by
/// this share of the way to `hi`.
///
/// # Errors
/// As [`TransferFunction::window`].
fn grays(lo: f64, hi: f64, clear: Option<f64>) -> Result<TransferFunction, TransferFunctionError> {
    let window = TransferFunction::window(lo, hi, 1.0, Colormap::Grayscale)?;
    let opacities = match clear {
        Some(share) => [(lo, 0.0), (lo + share * (hi - lo), 1.0)],
        None => [(lo, 1.0), (hi, 1.0)],
    };
    let opacities = opacities.map(|(x, opacity)| OpacityPoint { x, opacity });
    TransferFunction::new(window.colors().to_vec(), opacities.to_vec())
}

/// What is known of a volume's values, data units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Values {
    pub min: f64,
    pub max: f64,
    pub mean: f64,
    pub median: f64,
    /// Otsu's threshold of all voxels.
    pub otsu: f64,
    /// The 99.9 % quantile.
    pub q999: f64,
}

/// A function of a projection, and the values between which its grey runs, data units.
#[derive(Debug, Clone, PartialEq)]
pub struct Grays {
    pub function: TransferFunction,
    pub from: f64,
    pub to: f64,
}

impl Values {
    /// Of two ends in the wrong order, or one twice, those of all values; or a width of one.
    fn ends(&self, lo: f64, hi: f64) -> (f64, f64) {
        match (lo < hi, self.min < self.max) {
            (true, _) => (lo, hi),
            (false, true) => (self.min, self.max),
            (false, false) => (self.min - 0.5, self.min + 0.5),
        }
    }

    /// For the smallest value of each ray: all values, opaque; what is dark is what a ray met of the least dense.
    ///
    /// # Errors
    /// Values too close for the map's points.
    pub fn of_minimum(&self) -> Result<Grays, TransferFunctionError> {
        let (from, to) = self.ends(self.min, self.q999);
        Ok(Grays { function: grays(from, to, None)?, from, to })
    }

    /// For the mean of each ray, an X-ray picture: clear at the median, which is air where most voxels are (at the
    /// smallest value where Otsu's threshold is not above the median), opaque from a sixth of the way to white
    /// on, white half-way between the mean of all voxels and the 99.9 % quantile, which few rays exceed.
    ///
    /// # Errors
    /// As [`Values::of_minimum`].
    pub fn of_average(&self) -> Result<Grays, TransferFunctionError> {
        let air = if self.median < self.otsu { self.median } else { self.min };
        let (from, to) = self.ends(air, 0.5 * (self.mean + self.q999));
        Ok(Grays { function: grays(from, to, Some(1.0 / 6.0))?, from, to })
    }

    /// For the largest value of each ray: clear below half of Otsu's threshold (from the smallest value), black there,
    /// white at the 99.9 % quantile.
    ///
    /// # Errors
    /// As [`Values::of_minimum`].
    pub fn of_maximum(&self) -> Result<Grays, TransferFunctionError> {
        let (from, to) = self.ends(0.5 * (self.min + self.otsu), self.q999);
        Ok(Grays { function: grays(from, to, Some(0.05))?, from, to })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_projection_shows_what_its_rays_tell() {
        let values = Values { min: -10.0, max: 300.0, mean: 20.0, median: -4.0, otsu: 90.0, q999: 200.0 };
        let (least, mean, most) = (values.of_minimum(), values.of_average(), values.of_maximum());
        let (least, mean, most) = (least.unwrap(), mean.unwrap(), most.unwrap());
        assert_eq!(
            [least.from, least.to, mean.from, mean.to, most.from, most.to],
            [-10.0, 200.0, -4.0, 110.0, 40.0, 200.0]
        );
        // Air shows in the first, black; and not in the others.
        assert_eq!((least.function.opacity(-10.0), mean.function.opacity(-10.0)), (1.0, 0.0));
        assert_eq!(mean.function.opacity(30.0), 1.0);
        assert_eq!(least.function.color(-10.0), [0.0; 3]);
        assert_eq!((most.function.opacity(-10.0), most.function.opacity(90.0)), (0.0, 1.0));
        for grays in [&least, &mean, &most] {
            assert_eq!(grays.function.color(grays.to), [1.0; 3]);
        }
    }

    #[test]
    fn volumes_without_contrast_have_functions_too() {
        for value in [0.0, 7.0, -1e12] {
            let one = Values { min: value, max: value, mean: value, median: value, otsu: value, q999: value };
            assert!(one.of_minimum().is_ok() && one.of_average().is_ok() && one.of_maximum().is_ok(), "{value}");
        }
        // Less than a thousandth of the voxels is no air.
        let sparse = Values { min: 0.0, max: 255.0, mean: 0.01, median: 0.0, otsu: 100.0, q999: 0.0 };
        assert_eq!(sparse.of_maximum().unwrap().to, 255.0);
    }
}

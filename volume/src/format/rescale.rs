//! From the numbers of voxels to values.

/// `value = slope * number + intercept`, as DICOM and NIfTI say what their voxels' numbers mean. Values rise with the
/// numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rescale {
    slope: f64,
    intercept: f64,
}

impl Rescale {
    /// A voxel's number is its value.
    pub const IDENTITY: Self = Self { slope: 1.0, intercept: 0.0 };

    /// Nothing where not both are finite, or the slope is not above 0.
    #[must_use]
    pub fn new(slope: f64, intercept: f64) -> Option<Self> {
        (slope.is_normal() && slope > 0.0 && intercept.is_finite()).then_some(Self { slope, intercept })
    }

    #[must_use]
    pub fn is_identity(self) -> bool {
        self == Self::IDENTITY
    }

    /// The value of a number.
    #[must_use]
    pub fn value(self, number: f64) -> f64 {
        // Not computed: -0 stays what it is.
        if self.is_identity() { number } else { self.slope * number + self.intercept }
    }

    /// The number of a value.
    #[must_use]
    pub fn number(self, value: f64) -> f64 {
        if self.is_identity() { value } else { (value - self.intercept) / self.slope }
    }

    /// Of numbers that are `scale * stored + offset`: scale and offset of their values.
    #[must_use]
    pub fn after(self, scale: f64, offset: f64) -> (f64, f64) {
        (self.slope * scale, self.value(offset))
    }
}

impl Default for Rescale {
    fn default() -> Self {
        Self::IDENTITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_rise_with_numbers_and_come_back() {
        for (slope, intercept) in [(0.0, 0.0), (-1.0, 0.0), (f64::NAN, 0.0), (5e-324, 0.0), (1.0, f64::INFINITY)] {
            assert_eq!(Rescale::new(slope, intercept), None, "{slope}, {intercept}");
        }
        let hounsfield = Rescale::new(0.5, -1024.0).unwrap();
        assert_eq!((hounsfield.value(2048.0), hounsfield.number(0.0)), (0.0, 2048.0));
        assert_eq!(hounsfield.after(2.0, 8.0), (1.0, -1020.0));
        let (scale, offset) = Rescale::IDENTITY.after(3.0, -0.0);
        assert!(scale == 3.0 && offset.is_sign_negative(), "the same bits");
    }
}

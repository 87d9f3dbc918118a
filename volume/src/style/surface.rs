//! Isosurfaces (Krueger & Westermann 2003, section 4).

use super::error::StyleError;

/// Where the volume has one value. A ray meets it between two samples on either side of the value, and where it enters
/// the volume (or what clipping leaves of it) at the value or above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Isosurface {
    /// Data units.
    pub value: f64,
    /// Straight, display-referred, each channel in 0..=1.
    pub color: [f32; 3],
    /// In 0..=1; 1 is opaque.
    pub opacity: f32,
}

impl Isosurface {
    pub(super) fn validate(&self) -> Result<(), StyleError> {
        let channels = self.color.iter().chain([&self.opacity]);
        if self.value.is_finite() && channels.into_iter().all(|c| (0.0..=1.0).contains(c)) {
            return Ok(());
        }
        Err(StyleError::Surface { value: self.value })
    }

    /// The value as a stretched code: 0 and 1 at the ends of `range` (data units), beyond them outside. In a volume
    /// without range everything is code 0.
    #[must_use]
    pub fn code(&self, (lo, hi): (f64, f64)) -> f32 {
        if hi > lo {
            return ((self.value - lo) / (hi - lo)).clamp(-1.0, 2.0) as f32;
        }
        if self.value <= lo { -1.0 } else { 2.0 }
    }
}

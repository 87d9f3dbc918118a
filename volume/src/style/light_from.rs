//! How long a gradient must be for light to count: homogeneous material must not be lit by its noise
//! (docs/adr/0009-light-from-noise.md).

use super::{Phong, Style};

/// Light fades in from a gradient of this many standard deviations of the noise a voxel. Central differences of
/// independent noise exceed it at 0.04 % of all voxels' centres; between them interpolation smooths noise, and a few in
/// a million do.
pub const NOISE_DEVIATIONS: f64 = 3.0;
/// A gradient below this share of the range per smallest spacing is none, whatever the noise: codes may be rounded to
/// 14 bits.
pub const LEAST_GRADIENT: f64 = 1.0 / 16383.0;

impl Phong {
    /// The gradient from which light fades in, as a share of `range` per smallest spacing.
    #[must_use]
    pub fn light_from_share(&self, (lo, hi): (f64, f64)) -> f64 {
        let width = hi - lo;
        let asked = self.light_from.filter(|_| width > 0.0).unwrap_or(0.0);
        (asked / width.max(f64::MIN_POSITIVE)).clamp(LEAST_GRADIENT, 1e6)
    }
}

impl Style {
    /// With light that fades in above a volume's noise (standard deviation, data units), where no other length was
    /// asked for.
    #[must_use]
    pub fn above_noise(mut self, noise: Option<f64>) -> Self {
        if let Some(phong) = &mut self.shading {
            phong.light_from = phong.light_from.or(noise.map(|noise| NOISE_DEVIATIONS * noise));
        }
        self
    }
}

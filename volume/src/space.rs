//! Space: dims, spacing and origin, and the map between world and index space (conventions.md, "Space").

use glam::{DVec3, UVec3};

/// The longest axis that a volume may have, in voxels. Keeps every product of two axes inside 64 bits and every global
/// voxel index exactly representable in the kernels' f32.
pub const MAX_DIM: u32 = 1 << 20;
/// The largest number of voxels of a volume (16 Ti).
pub const MAX_VOXELS: u64 = 1 << 44;

/// A volume's shape in the world. Index space: voxel i covers `[i, i + 1)`, its centre is `i + 0.5`;
/// `index = (world - origin) / spacing + 0.5`. `origin` is the world position of the centre of voxel (0, 0, 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    dims: UVec3,
    spacing: DVec3,
    origin: DVec3,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GeometryError {
    #[error("dims {0:?}: every axis must have between 1 and {MAX_DIM} voxels")]
    Dims([u32; 3]),
    #[error("dims {dims:?} are {voxels} voxels, more than the {MAX_VOXELS} that a volume may have")]
    TooManyVoxels { dims: [u32; 3], voxels: u128 },
    #[error("spacing {0:?}: every axis must be finite, positive and between 1e-12 and 1e12")]
    Spacing([f64; 3]),
    #[error("spacing {0:?}: the axes differ by more than a factor of 10,000")]
    Anisotropy([f64; 3]),
    #[error("origin {0:?}: every axis must be finite and below 1e15 in magnitude")]
    Origin([f64; 3]),
}

impl Geometry {
    /// # Errors
    /// Zero or oversized dims, spacing that is not finite and positive, an origin that is not finite.
    pub fn new(dims: [u32; 3], spacing: [f64; 3], origin: [f64; 3]) -> Result<Self, GeometryError> {
        if dims.iter().any(|&n| n == 0 || n > MAX_DIM) {
            return Err(GeometryError::Dims(dims));
        }
        let voxels = dims.iter().map(|&n| u128::from(n)).product::<u128>();
        if voxels > u128::from(MAX_VOXELS) {
            return Err(GeometryError::TooManyVoxels { dims, voxels });
        }
        if spacing.iter().any(|s| !(s.is_finite() && (1e-12..=1e12).contains(s))) {
            return Err(GeometryError::Spacing(spacing));
        }
        let (lo, hi) = (spacing.iter().copied().fold(f64::MAX, f64::min), spacing.iter().copied().fold(0.0, f64::max));
        if hi / lo > 1e4 {
            return Err(GeometryError::Anisotropy(spacing));
        }
        if origin.iter().any(|o| !o.is_finite() || o.abs() > 1e15) {
            return Err(GeometryError::Origin(origin));
        }
        Ok(Self { dims: dims.into(), spacing: spacing.into(), origin: origin.into() })
    }

    /// Voxels per axis, x fastest.
    #[must_use]
    pub fn dims(&self) -> UVec3 {
        self.dims
    }

    /// World units per voxel and axis.
    #[must_use]
    pub fn spacing(&self) -> DVec3 {
        self.spacing
    }

    /// World position of the centre of voxel (0, 0, 0).
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    #[must_use]
    pub fn voxel_count(&self) -> u64 {
        self.dims.as_u64vec3().element_product()
    }

    /// The smallest spacing, world units: the length that `step` counts in.
    #[must_use]
    pub fn min_spacing(&self) -> f64 {
        self.spacing.min_element()
    }

    /// World to index space.
    #[must_use]
    pub fn voxel_from_world(&self, p_world: DVec3) -> DVec3 {
        (p_world - self.origin) / self.spacing + 0.5
    }

    /// Index space to world.
    #[must_use]
    pub fn world_from_voxel(&self, p_voxel: DVec3) -> DVec3 {
        (p_voxel - 0.5) * self.spacing + self.origin
    }

    /// World position of the centre of the volume's box.
    #[must_use]
    pub fn center_world(&self) -> DVec3 {
        self.world_from_voxel(self.dims.as_dvec3() * 0.5)
    }

    /// Half the diagonal of the volume's box, world units.
    #[must_use]
    pub fn radius_world(&self) -> f64 {
        (self.dims.as_dvec3() * self.spacing).length() * 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxel_centres_are_halves_and_origin_is_the_first_centre() {
        let g = Geometry::new([3, 5, 7], [1.0, 2.0, 3.0], [10.0, 20.0, 30.0]).unwrap();
        assert_eq!(g.voxel_from_world(DVec3::new(10.0, 20.0, 30.0)), DVec3::splat(0.5));
        assert_eq!(g.world_from_voxel(DVec3::new(1.5, 1.5, 1.5)), DVec3::new(11.0, 22.0, 33.0));
        assert_eq!(g.center_world(), DVec3::new(11.0, 24.0, 39.0));
    }

    #[test]
    fn zero_negative_and_overflowing_shapes_are_refused() {
        assert!(Geometry::new([0, 1, 1], [1.0; 3], [0.0; 3]).is_err());
        assert!(Geometry::new([u32::MAX, 1, 1], [1.0; 3], [0.0; 3]).is_err());
        assert!(Geometry::new([MAX_DIM, MAX_DIM, MAX_DIM], [1.0; 3], [0.0; 3]).is_err());
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Geometry::new([1; 3], [1.0, bad, 1.0], [0.0; 3]).is_err(), "{bad}");
        }
        assert!(Geometry::new([1; 3], [1.0; 3], [f64::NAN, 0.0, 0.0]).is_err());
    }
}

//! Space: dims, spacing, origin and directions, and the map between world and index space (docs/definition.md, Space).

use glam::{DMat3, DVec3, UVec3};

/// The longest axis that a volume may have, in voxels. Keeps every product of two axes inside 64 bits and every global
/// voxel index exactly representable in the kernels' f32.
pub const MAX_DIM: u32 = 1 << 20;
/// The largest number of voxels of a volume (16 Ti).
pub const MAX_VOXELS: u64 = 1 << 44;

/// How far directions may be from orthonormal: readers make them so, files only round them.
const ORTHONORMAL: f64 = 1e-6;

/// A volume's shape in the world. Index space: voxel i covers `[i, i + 1)`, its centre is `i + 0.5`;
/// `world = origin + R diag(spacing) (index - 0.5)`. `origin` is the world position of the centre of voxel (0, 0, 0);
/// the columns of R, the directions, are the index axes in the world: of length one and at right angles, in any order
/// and sign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    dims: UVec3,
    spacing: DVec3,
    origin: DVec3,
    directions: DMat3,
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
    #[error("directions {0:?}: the axes must be of length one and at right angles, within {ORTHONORMAL}")]
    Directions([[f64; 3]; 3]),
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
        let directions = DMat3::IDENTITY;
        Ok(Self { dims: dims.into(), spacing: spacing.into(), origin: origin.into(), directions })
    }

    /// The same volume with other directions; [`Geometry::new`] has axes x, y, z.
    ///
    /// # Errors
    /// Columns that are not of length one and at right angles.
    pub fn with_directions(self, directions: DMat3) -> Result<Self, GeometryError> {
        let product = directions.transpose() * directions;
        // A NaN is above nothing, so it is asked whether all is below.
        let near = |a: DVec3, b: DVec3| (a - b).abs().cmplt(DVec3::splat(ORTHONORMAL)).all();
        let unit = DMat3::IDENTITY;
        if !(near(product.x_axis, unit.x_axis)
            && near(product.y_axis, unit.y_axis)
            && near(product.z_axis, unit.z_axis))
        {
            return Err(GeometryError::Directions(directions.to_cols_array_2d()));
        }
        // -0 is 0: equal geometries are written alike.
        Ok(Self { directions: DMat3::from_cols_array(&directions.to_cols_array().map(|c| c + 0.0)), ..self })
    }

    /// Where level `level` of this volume lies: each of its voxels stands for `2^level` of this one's on every axis, or
    /// for those that are left at the high ends.
    ///
    /// # Errors
    /// A level so coarse that no volume has its spacing or origin.
    pub fn at_level(&self, level: u8) -> Result<Self, GeometryError> {
        let factor = f64::from(level.min(32)).exp2();
        let dims = self.dims.map(|n| u64::from(n).div_ceil(1 << level.min(32)) as u32);
        let along = self.spacing * ((factor - 1.0) * 0.5);
        let moved = if self.is_straight() { along } else { self.directions * along };
        let level = Self::new(dims.to_array(), (self.spacing * factor).to_array(), (self.origin + moved).to_array())?;
        Ok(Self { directions: self.directions, ..level })
    }

    /// The box `[lo, hi)` of its voxels as a volume of its own, where it lies.
    ///
    /// # Errors
    /// A box without voxels, an origin too far out.
    pub fn cropped(&self, lo: [u32; 3], hi: [u32; 3]) -> Result<Self, GeometryError> {
        let dims = std::array::from_fn(|a| hi[a].saturating_sub(lo[a]));
        let along = self.spacing * UVec3::from(lo).as_dvec3();
        let moved = if self.is_straight() { along } else { self.directions * along };
        let cropped = Self::new(dims, self.spacing.to_array(), (self.origin + moved).to_array())?;
        Ok(Self { directions: self.directions, ..cropped })
    }

    /// The first `planes` planes of it, one at least.
    pub(crate) fn cut_to(self, planes: u32) -> Self {
        Self { dims: UVec3 { z: planes.clamp(1, self.dims.z), ..self.dims }, ..self }
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

    /// The index axes in the world, one a column.
    #[must_use]
    pub fn directions(&self) -> DMat3 {
        self.directions
    }

    /// True where the index axes are x, y, z.
    #[must_use]
    pub fn is_straight(&self) -> bool {
        self.directions == DMat3::IDENTITY
    }

    /// True where the index axes are a left-handed system in the world: voxels are stored as a mirror image.
    #[must_use]
    pub fn is_mirrored(&self) -> bool {
        self.directions.determinant() < 0.0
    }

    /// A world direction by its parts along the index axes, still in world units.
    #[must_use]
    pub fn along_axes(&self, v_world: DVec3) -> DVec3 {
        // Straight volumes are left alone, so that they have the same bits as ever.
        if self.is_straight() { v_world } else { self.directions.transpose() * v_world }
    }

    /// World to index space.
    #[must_use]
    pub fn voxel_from_world(&self, p_world: DVec3) -> DVec3 {
        self.along_axes(p_world - self.origin) / self.spacing + 0.5
    }

    /// Index space to world.
    #[must_use]
    pub fn world_from_voxel(&self, p_voxel: DVec3) -> DVec3 {
        let along = (p_voxel - 0.5) * self.spacing;
        (if self.is_straight() { along } else { self.directions * along }) + self.origin
    }

    /// The volume's eight corners in the world; bit a of a corner's number says whether it is high on axis a.
    #[must_use]
    pub fn corners_world(&self) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            let high = UVec3::new(corner as u32 & 1, corner as u32 >> 1 & 1, corner as u32 >> 2);
            self.world_from_voxel((self.dims * high).as_dvec3())
        })
    }

    /// The smallest box along x, y, z around the volume, world.
    #[must_use]
    pub fn bounds_world(&self) -> (DVec3, DVec3) {
        let corners = self.corners_world();
        corners.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)))
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

    /// The first voxel of a level has its centre in the midst of those that it stands for, whichever way axes point.
    #[test]
    fn levels_lie_where_the_voxels_lie_that_they_stand_for() {
        let straight = Geometry::new([9, 5, 8], [1.0, 2.0, 3.0], [10.0, 20.0, 30.0]).unwrap();
        let turned = straight.with_directions(DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::NEG_Z)).unwrap();
        for g in [straight, turned, straight.with_directions(DMat3::from_rotation_y(0.7)).unwrap()] {
            assert_eq!(g.at_level(0).unwrap(), g);
            for (level, dims) in [(1, [5, 3, 4]), (2, [3, 2, 2]), (3, [2, 1, 1]), (9, [1, 1, 1])] {
                let coarse = g.at_level(level).unwrap();
                assert_eq!((coarse.dims().to_array(), coarse.directions()), (dims, g.directions()));
                let scale = f64::from(1 << level);
                for p in [DVec3::ZERO, DVec3::new(0.5, 1.0, 2.5)] {
                    let apart = coarse.world_from_voxel(p) - g.world_from_voxel(p * scale);
                    assert!(apart.length() < 1e-9, "level {level}: {apart}");
                }
            }
            assert!(g.at_level(200).is_ok_and(|far| far.dims() == UVec3::ONE));
        }
        assert!(Geometry::new([9; 3], [4e11; 3], [0.0; 3]).unwrap().at_level(2).is_err());
    }

    /// Both ways, for a mirror, a permutation and a rotation; by hand for one of them.
    #[test]
    fn directions_turn_both_ways() {
        let straight = Geometry::new([3, 5, 7], [1.0, 2.0, 3.0], [10.0, 20.0, 30.0]).unwrap();
        let turned = DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::NEG_Z);
        let g = straight.with_directions(turned).unwrap();
        assert_eq!(g.world_from_voxel(DVec3::new(1.5, 2.5, 3.5)), DVec3::new(10.0 - 4.0, 20.0 + 1.0, 30.0 - 9.0));
        assert_eq!(g.along_axes(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(2.0, -1.0, -3.0));
        assert!(!g.is_straight() && g.is_mirrored() && !straight.is_mirrored());
        assert_eq!(g.bounds_world(), (DVec3::new(1.0, 19.5, 10.5), DVec3::new(11.0, 22.5, 31.5)));
        for directions in [turned, DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)), DMat3::from_rotation_y(0.7)] {
            let g = straight.with_directions(directions).unwrap();
            for p in [DVec3::ZERO, DVec3::new(0.3, 4.1, 6.6), DVec3::new(-9.0, 80.0, 3.0)] {
                assert!((g.voxel_from_world(g.world_from_voxel(p)) - p).length() < 1e-12, "{directions} {p}");
            }
            let middle = g.corners_world().iter().sum::<DVec3>() / 8.0;
            assert!((middle - g.center_world()).length() < 1e-12);
            assert!((g.corners_world()[5] - g.center_world()).length() - g.radius_world() < 1e-12);
        }
    }

    #[test]
    fn directions_that_shear_stretch_or_are_no_numbers_are_refused() {
        let g = Geometry::new([4; 3], [1.0; 3], [0.0; 3]).unwrap();
        for bad in [
            DMat3::from_cols(DVec3::X, DVec3::new(1e-4, 1.0, 0.0), DVec3::Z),
            DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1.001)),
            DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z),
            DMat3::ZERO,
            DMat3::from_diagonal(DVec3::new(f64::NAN, 1.0, 1.0)),
            DMat3::from_diagonal(DVec3::new(1.0, f64::INFINITY, 1.0)),
        ] {
            assert!(matches!(g.with_directions(bad), Err(GeometryError::Directions(_))), "{bad}");
        }
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

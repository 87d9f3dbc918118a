//! The brick grid: which voxels a brick owns and which it stores. Owned and stored boxes are different types, so that a
//! ghost voxel cannot be integrated by mistake.

use glam::{IVec3, UVec3};

use crate::ids::{BrickId, BrickIndex};

/// Voxels that a brick integrates, global index space, half-open `[lo, hi)`; inside the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OwnedBox {
    pub lo: UVec3,
    pub hi: UVec3,
}

/// Voxels that a brick holds: the owned box grown by the ghost layers on every side, global index space, half-open.
/// It may reach beyond the volume, where voxels are clamped to the edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StoredBox {
    pub lo: IVec3,
    pub hi: IVec3,
}

impl OwnedBox {
    #[must_use]
    pub fn dims(&self) -> UVec3 {
        self.hi - self.lo
    }

    #[must_use]
    pub fn voxel_count(&self) -> u64 {
        self.dims().as_u64vec3().element_product()
    }

    /// The box that holds this one with `ghost` more voxels on each side.
    #[must_use]
    pub fn stored(&self, ghost: u32) -> StoredBox {
        let ghost = IVec3::splat(ghost as i32);
        StoredBox { lo: self.lo.as_ivec3() - ghost, hi: self.hi.as_ivec3() + ghost }
    }
}

impl StoredBox {
    #[must_use]
    pub fn dims(&self) -> UVec3 {
        (self.hi - self.lo).as_uvec3()
    }

    #[must_use]
    pub fn voxel_count(&self) -> u64 {
        self.dims().as_u64vec3().element_product()
    }
}

/// Stretched codes of a stored box, x fastest: `round(65535 (v - lo) / (hi - lo))`, clamped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrickVoxels {
    pub stored: StoredBox,
    pub codes: Vec<u16>,
    /// Some voxels hold no data: those of code [`crate::store::NO_DATA_CODE`], which is a code like all others else.
    pub has_holes: bool,
}

/// Ghost layers that plain trilinear sampling needs: a sample inside the owned box reads at most one voxel beyond it.
/// Slabs and gradients read further: [`crate::style::Style::ghost`].
pub const GHOST_SAMPLED: u32 = 1;

/// The margin, in voxels, over which the store keeps each brick's value range, so that the range bounds every value
/// that sampling and slabs up to a step of one voxel can read.
pub const RANGE_MARGIN: u32 = 2;

/// Bricks of `brick_size`^3 voxels from the volume's corner; those at the high ends may be smaller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BrickGrid {
    volume_dims: UVec3,
    brick_size: u32,
}

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BrickGridError {
    #[error("brick size {0}: must be a power of two between 8 and 512")]
    Size(u32),
    #[error("{bricks} bricks of {size}^3 are more than the {max} that one store may have; use a larger brick size")]
    TooMany { bricks: u64, size: u32, max: u64 },
}

/// The most bricks a store may have: keeps the table of brick ranges under 16 MiB.
pub const MAX_BRICKS: u64 = 1 << 22;

impl BrickGrid {
    /// # Errors
    /// A brick size that is no power of two in 8..=512, or more than [`MAX_BRICKS`] bricks.
    pub fn new(volume_dims: UVec3, brick_size: u32) -> Result<Self, BrickGridError> {
        if !(8..=512).contains(&brick_size) || !brick_size.is_power_of_two() {
            return Err(BrickGridError::Size(brick_size));
        }
        let grid = Self { volume_dims, brick_size };
        if grid.brick_count() > MAX_BRICKS {
            return Err(BrickGridError::TooMany { bricks: grid.brick_count(), size: brick_size, max: MAX_BRICKS });
        }
        Ok(grid)
    }

    #[must_use]
    pub fn volume_dims(&self) -> UVec3 {
        self.volume_dims
    }

    /// Voxels per brick edge.
    #[must_use]
    pub fn brick_size(&self) -> u32 {
        self.brick_size
    }

    /// Bricks per axis.
    #[must_use]
    pub fn dims(&self) -> UVec3 {
        self.volume_dims.map(|n| n.div_ceil(self.brick_size))
    }

    #[must_use]
    pub fn brick_count(&self) -> u64 {
        self.dims().as_u64vec3().element_product()
    }

    #[must_use]
    pub fn contains(&self, brick: BrickIndex) -> bool {
        UVec3::from(brick.0).cmplt(self.dims()).all()
    }

    /// The voxels that `brick` owns.
    #[must_use]
    pub fn owned_box(&self, brick: BrickIndex) -> OwnedBox {
        let lo = UVec3::from(brick.0) * self.brick_size;
        OwnedBox { lo, hi: (lo + self.brick_size).min(self.volume_dims) }
    }

    /// The place of `brick` in tables over all bricks, x fastest.
    #[must_use]
    pub fn id(&self, brick: BrickIndex) -> BrickId {
        let (d, [x, y, z]) = (self.dims(), brick.0);
        BrickId::finest(x + d.x * (y + d.y * z))
    }

    /// The brick at a place of such a table, of level 0.
    #[must_use]
    pub fn index_of(&self, brick: BrickId) -> BrickIndex {
        let (d, linear) = (self.dims(), brick.linear());
        BrickIndex([linear % d.x, linear / d.x % d.y, linear / d.x / d.y])
    }

    /// All places of such a table, ascending.
    pub fn ids(&self) -> impl Iterator<Item = BrickId> + use<> {
        // No more than `MAX_BRICKS`.
        (0..self.brick_count() as u32).map(BrickId::finest)
    }

    /// All bricks, x fastest.
    pub fn bricks(&self) -> impl Iterator<Item = BrickIndex> + use<> {
        let grid = *self;
        grid.ids().map(move |id| grid.index_of(id))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_volume_sizes_are_covered_once() {
        let grid = BrickGrid::new(UVec3::new(33, 64, 65), 32).unwrap();
        assert_eq!(grid.dims(), UVec3::new(2, 2, 3));
        let voxels: u64 = grid.bricks().map(|b| grid.owned_box(b).voxel_count()).sum();
        assert_eq!(voxels, 33 * 64 * 65);
        for (i, b) in grid.bricks().enumerate() {
            let id = grid.id(b);
            assert_eq!((id.level(), id.index(), grid.index_of(id)), (0, i, b));
        }
    }
}

//! What a store says of its regions, and of each brick's share in them.

use super::code::Density;
use crate::brick::StoredBox;

/// The label of voxels that belong to no region; regions are labelled 1, 2, ... in the order of their first voxel.
pub const NO_REGION: u32 = 0;

/// The most regions of a store: the table of all is in the memory of every node.
pub const MAX_REGIONS: u32 = 1 << 24;

/// One region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// Its smallest global voxel index, x fastest.
    pub root: u64,
    pub voxels: u64,
    /// Of its voxels' densities.
    pub sum: u64,
    /// Smallest and largest density.
    pub min: Density,
    pub max: Density,
}

impl Region {
    /// The density that V' has everywhere in the region: the mean, half up.
    #[must_use]
    pub fn mean(&self) -> Density {
        ((self.sum + self.voxels / 2) / self.voxels.max(1)) as Density
    }

    /// The furthest that a voxel of the region is from its mean, in densities.
    #[must_use]
    pub fn deviation(&self) -> Density {
        let mean = self.mean();
        mean.abs_diff(self.min).max(mean.abs_diff(self.max))
    }
}

/// All regions of a store; label `l` is entry `l - 1`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RegionTable(pub Vec<Region>);

impl RegionTable {
    /// `None` for [`NO_REGION`] and for labels that the store does not have.
    #[must_use]
    pub fn get(&self, label: u32) -> Option<&Region> {
        self.0.get((label as usize).checked_sub(1)?)
    }
}

/// What planning must know of one brick in V', over its owned box grown by [`crate::brick::RANGE_MARGIN`], cut at the
/// volume's edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BrickFacts {
    /// Smallest and largest 16-bit code of V'.
    pub min: u16,
    pub max: u16,
    /// The furthest that a voxel's own code is from its code in V'.
    pub deviation: u16,
    /// True where a voxel belongs to a region: then V' differs from the volume.
    pub has_regions: bool,
    /// True where a voxel could leap with the narrowest guard (2): all voxels within that distance are its region's.
    pub has_leaps: bool,
    /// The region that holds every voxel; [`super::NO_REGION`] where there is none such.
    pub only_region: u32,
}

/// Labels and distances of a box of voxels, x fastest; beyond the volume's edge they are those of the nearest voxel
/// inside.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrickRegions {
    /// The brick's stored box, grown by the margin that was asked for.
    pub covered: StoredBox,
    pub labels: Vec<u32>,
    /// Chebyshev distance to the nearest voxel of another label (1 for a neighbour), at most 255; 0 for [`NO_REGION`].
    pub distances: Vec<u8>,
}

//! How far halos reach, and which bricks have them.

use crate::store::profile::CHUNK_EDGE;

/// Records of a brick's halo. Trilinear sampling reads 1 voxel beyond the owned box, slabs up to a step of one voxel
/// another, and gradients one more (docs/adr/0003-halos.md).
pub(crate) const VOXEL_HALO: HaloReach = HaloReach { first: 1, last: 3 };
/// The same of labels and distances: inner guards look one voxel beyond what is sampled, and another where there are
/// gradients. Nothing reads fewer than 2.
pub(crate) const REGION_HALO: HaloReach = HaloReach { first: 2, last: 5 };

/// True where bricks of `brick_size` are made of whole inner chunks, so that they have halos.
pub(crate) fn has_halos(brick_size: u32) -> bool {
    brick_size >= CHUNK_EDGE
}

/// How far the records of a halo reach, in voxels beyond the owned box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct HaloReach {
    /// The first record's: all layers up to this one.
    pub(crate) first: u32,
    /// The last record's; those between hold a layer each.
    pub(crate) last: u32,
}

impl HaloReach {
    /// Records of a brick.
    pub(crate) fn records(self) -> usize {
        (self.last - self.first) as usize + 1
    }

    /// The outermost layer of a brick's `nth` record, from 0.
    pub(crate) fn layer(self, nth: usize) -> u32 {
        self.first + nth as u32
    }

    /// How many records, from the first on, hold all that a read of `margin` voxels beyond the owned box needs; nothing
    /// where they do not, or where the brick's own inner chunks do.
    pub(crate) fn serving(self, margin: u32) -> Option<usize> {
        (1..=self.last).contains(&margin).then(|| margin.saturating_sub(self.first) as usize + 1)
    }
}

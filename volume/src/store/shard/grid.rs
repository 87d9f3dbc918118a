//! Which shards and inner chunks a volume has.

use std::ops::Range;

use glam::UVec3;

use crate::store::error::StoreError;
use crate::store::profile::{CHUNK_EDGE, InnerChunk, MAX_SHARDS, SHARD_EDGE, ShardIndex};

/// The shards and inner chunks of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ShardGrid {
    volume_dims: UVec3,
}

impl ShardGrid {
    pub(crate) fn new(volume_dims: UVec3) -> Result<Self, StoreError> {
        let grid = Self { volume_dims };
        match grid.count() {
            shards if shards > MAX_SHARDS => Err(StoreError::TooManyShards { shards }),
            _ => Ok(grid),
        }
    }

    /// Shards per axis.
    pub(crate) fn dims(&self) -> UVec3 {
        self.volume_dims.map(|n| n.div_ceil(SHARD_EDGE))
    }

    /// Inner chunks per axis that hold at least one voxel of the volume.
    pub(crate) fn chunk_dims(&self) -> UVec3 {
        self.volume_dims.map(|n| n.div_ceil(CHUNK_EDGE))
    }

    pub(crate) fn count(&self) -> u64 {
        self.dims().as_u64vec3().element_product()
    }

    /// Position of `shard` in the shard table, x fastest.
    pub(crate) fn linear(&self, shard: ShardIndex) -> usize {
        let (d, [x, y, z]) = (self.dims(), shard.0.map(|v| v as usize));
        x + d.x as usize * (y + d.y as usize * z)
    }

    /// The shard at a position of the shard table.
    pub(crate) fn at(&self, linear: usize) -> ShardIndex {
        let (dx, dy) = (self.dims().x as usize, self.dims().y as usize);
        ShardIndex([(linear % dx) as u32, (linear / dx % dy) as u32, (linear / dx / dy) as u32])
    }

    /// The places in the shard table of those that begin in `planes`.
    pub(crate) fn places(&self, planes: &Range<u32>) -> Range<usize> {
        let d = self.dims();
        let at = |z: u32| z.div_ceil(SHARD_EDGE) as usize * d.x as usize * d.y as usize;
        at(planes.start)..at(planes.end)
    }

    /// True where the inner chunk holds at least one voxel of the volume.
    pub(crate) fn holds(&self, chunk: InnerChunk) -> bool {
        UVec3::from(chunk.0).cmplt(self.chunk_dims()).all()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_in_the_table_and_shards_are_inverse_and_their_number_is_bounded() {
        let grid = ShardGrid::new(UVec3::new(257, 513, 1025)).unwrap();
        for linear in 0..grid.count() as usize {
            assert_eq!(grid.linear(grid.at(linear)), linear);
        }
        assert!(ShardGrid::new(UVec3::new(1 << 20, 1 << 20, 1)).is_err());
    }
}

//! Parts of a volume's planes that are prepared one after the other, each through all z, so that memory does not follow
//! the plane.
//!
//! Tiles begin and end at faces of shards and bricks, or at the volume's end: every shard and brick is written from one
//! tile. A volume whose planes are small enough is one tile.

use std::ops::Range;

use glam::UVec3;

use super::profile::{CHUNK_EDGE, SHARD_EDGE};
use crate::brick::BrickGrid;

/// The most voxels of a plane that are held at once.
pub(super) const MAX_TILE_VOXELS: u64 = 4 << 20;

/// A rectangle of every plane, half-open, in voxels: x, y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) lo: [u32; 2],
    pub(super) hi: [u32; 2],
}

impl Tile {
    /// All of a volume's planes.
    pub(super) fn whole(volume_dims: UVec3) -> Self {
        Self { lo: [0; 2], hi: [volume_dims.x, volume_dims.y] }
    }

    /// Voxels along x, and along y.
    pub(super) fn size(&self) -> [usize; 2] {
        std::array::from_fn(|a| (self.hi[a] - self.lo[a]) as usize)
    }

    /// Voxels of a plane of it.
    pub(super) fn voxels(&self) -> usize {
        self.size().iter().product()
    }

    /// The voxels of the next coarser level that it holds a part of.
    pub(super) fn halved(&self) -> Self {
        Self { lo: self.lo.map(|n| n / 2), hi: self.hi.map(|n| n.div_ceil(2)) }
    }

    /// With `layers` more voxels on each side, inside the volume.
    pub(super) fn grown(&self, layers: u32, volume_dims: UVec3) -> Self {
        let end = [volume_dims.x, volume_dims.y];
        Self {
            lo: self.lo.map(|n| n.saturating_sub(layers)),
            hi: std::array::from_fn(|a| (self.hi[a] + layers).min(end[a])),
        }
    }

    /// The cells of edge `edge` that begin in it, along one axis.
    pub(super) fn cells(&self, axis: usize, edge: u32) -> Range<u32> {
        self.lo[axis].div_ceil(edge)..self.hi[axis].div_ceil(edge)
    }

    /// Where a voxel of the tile lies in one of its planes.
    pub(super) fn at(&self, x: u32, y: u32) -> usize {
        (y - self.lo[1]) as usize * self.size()[0] + (x - self.lo[0]) as usize
    }

    /// Copies the voxels of this tile out of planes of a larger one, `held`.
    pub(super) fn cut<T: Copy>(&self, held: &Tile, from: &[T], out: &mut [T]) {
        let [width, _] = self.size();
        let planes = from.chunks_exact(held.voxels()).zip(out.chunks_exact_mut(self.voxels()));
        for (from, out) in planes {
            for (y, row) in (self.lo[1]..).zip(out.chunks_exact_mut(width)) {
                row.copy_from_slice(&from[held.at(self.lo[0], y)..][..width]);
            }
        }
    }
}

/// All tiles of a volume, x fastest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tiles {
    volume_dims: UVec3,
    /// Of all tiles but those at the volume's end: a multiple of the edges of shards and bricks, or all there is.
    size: [u32; 2],
}

impl Tiles {
    /// Tiles of at most `most` voxels, unless one shard or brick has more; whole rows where that can be.
    pub(super) fn new(grid: &BrickGrid, most: u64) -> Self {
        let volume_dims = grid.volume_dims();
        let [nx, ny] = [volume_dims.x, volume_dims.y];
        if u64::from(nx) * u64::from(ny) <= most {
            return Self { volume_dims, size: [nx, ny] };
        }
        let edge = grid.brick_size().max(SHARD_EDGE);
        // Whole edges of at most `most` voxels, when the other axis has `other`.
        let along = |other: u32, n: u32| {
            let edges = (most / u64::from(other) / u64::from(edge)).max(1);
            (edges * u64::from(edge)).min(n.into()) as u32
        };
        let width = along(edge.min(ny), nx);
        Self { volume_dims, size: [width, if width == nx { along(nx, ny) } else { edge.min(ny) }] }
    }

    /// Tiles per axis.
    fn dims(&self) -> [u32; 2] {
        [self.volume_dims.x.div_ceil(self.size[0]), self.volume_dims.y.div_ceil(self.size[1])]
    }

    pub(super) fn count(&self) -> usize {
        self.dims().iter().map(|n| *n as usize).product()
    }

    pub(super) fn iter(self) -> impl Iterator<Item = Tile> {
        let [tx, ty] = self.dims();
        let end = [self.volume_dims.x, self.volume_dims.y];
        (0..ty).flat_map(move |y| (0..tx).map(move |x| [x, y])).map(move |at| {
            let lo: [u32; 2] = std::array::from_fn(|a| at[a] * self.size[a]);
            Tile { lo, hi: std::array::from_fn(|a| (lo[a] + self.size[a]).min(end[a])) }
        })
    }

    /// Voxels of a layer of inner chunks of the largest tile, with `layers` more voxels on each side.
    pub(super) fn largest_slab(&self, layers: u32) -> usize {
        let planes = self.volume_dims.z.min(CHUNK_EDGE) as usize;
        self.iter().map(|tile| tile.grown(layers, self.volume_dims).voxels()).max().unwrap_or(0) * planes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn planes_of_any_size_have_tiles_of_a_bounded_one() {
        let size = |dims: [u32; 3], brick| {
            let tiles = Tiles::new(&BrickGrid::new(UVec3::from(dims), brick).unwrap(), MAX_TILE_VOXELS);
            (tiles.size, tiles.count())
        };
        assert_eq!(size([2048, 2048, 2048], 64), ([2048, 2048], 1));
        assert_eq!(size([8192, 8192, 64], 64), ([8192, 512], 16));
        assert_eq!(size([16384, 16384, 8], 512), ([8192, 512], 64));
        assert_eq!(size([65536, 65536, 64], 64), ([16384, 256], 1024));
        assert_eq!(size([1 << 20, 9, 1], 64), ([465_920, 9], 3));
        assert_eq!(size([9, 1 << 20, 1], 64), ([9, 465_920], 3));
    }

    proptest! {
        /// A voxel in no tile is missing in the store; a brick in two is written twice.
        #[test]
        fn tiles_cover_every_voxel_once_and_cut_no_shard_and_no_brick(
            dims in [1_u32..1500, 1_u32..1500, 1_u32..3], size in 3_u32..10, most in 1_u64..400_000,
        ) {
            let grid = BrickGrid::new(UVec3::from(dims), 1 << size).unwrap();
            let tiles = Tiles::new(&grid, most);
            let edge = grid.brick_size().max(SHARD_EDGE);
            let voxels: usize = tiles.iter().map(|t| t.voxels()).sum();
            prop_assert_eq!(voxels, (dims[0] * dims[1]) as usize);
            prop_assert_eq!(tiles.count(), tiles.iter().count());
            let one = (edge.min(dims[0]) * edge.min(dims[1])) as u64;
            for tile in tiles.iter() {
                prop_assert!(tile.voxels() as u64 <= most.max(one), "{tile:?}");
                for ((lo, hi), n) in tile.lo.into_iter().zip(tile.hi).zip(dims) {
                    prop_assert_eq!(lo % edge, 0);
                    prop_assert!(hi.is_multiple_of(edge) || hi == n, "{:?}", tile);
                }
            }
            let bricks: usize = tiles.iter().map(|t| t.cells(0, 1 << size).len() * t.cells(1, 1 << size).len()).sum();
            prop_assert_eq!(bricks as u64, u64::from(grid.dims().x * grid.dims().y));
        }
    }
}

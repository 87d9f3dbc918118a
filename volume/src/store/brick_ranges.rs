//! The table of brick ranges: which stretched codes sampling a brick can meet.

use rayon::prelude::*;

use super::error::{RangesError, StoreError};
use super::hash::ContentHash;
use super::manifest::Manifest;
use super::tiles::Tile;
use super::voxel::Voxel;
use crate::brick::{BrickGrid, RANGE_MARGIN};

/// Per brick, in the grid's linear order: smallest and largest stretched code over the owned box grown by
/// [`crate::brick::RANGE_MARGIN`], inside the volume; voxels without data left out. [`BrickRanges::NONE`] where none
/// holds any.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrickRanges(pub Vec<[u16; 2]>);

impl BrickRanges {
    /// Of a brick that meets no data: joined with other ranges it changes nothing.
    pub const NONE: [u16; 2] = [u16::MAX, 0];

    /// The bytes of `bricks.bin`: minimum and maximum of each brick, u16 little endian.
    ///
    /// # Errors
    /// Bytes that are not the ones that `manifest` speaks of.
    pub fn from_bytes(manifest: &Manifest, bytes: &[u8]) -> Result<Self, StoreError> {
        let bricks = manifest.grid.brick_count();
        let want = bricks * 4;
        if bytes.len() as u64 != want {
            return Err(RangesError::Length { got: bytes.len(), want, bricks }.into());
        }
        let (got, want) = (ContentHash::of(bytes), manifest.files.ranges);
        if got != want {
            return Err(RangesError::Hash { got, want }.into());
        }
        let u16_at = |b: &[u8], i| u16::from_le_bytes([b[i], b[i + 1]]);
        let ranges: Vec<_> = bytes.chunks_exact(4).map(|b| [u16_at(b, 0), u16_at(b, 2)]).collect();
        let may_lack = manifest.no_data.is_some();
        let sound = |range: &[u16; 2]| range[0] <= range[1] || (may_lack && *range == Self::NONE);
        if let Some((&[min, max], brick)) = ranges.iter().zip(manifest.grid.bricks()).find(|(range, _)| !sound(range)) {
            return Err(RangesError::Inverted { brick, min, max }.into());
        }
        Ok(Self(ranges))
    }

    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.0.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()
    }
}

/// Brick ranges in ordinals, gathered slab by slab: what they are stretched to is known only at the end.
#[derive(Debug)]
pub(super) struct RangeBuilder {
    grid: BrickGrid,
    /// Minimum and maximum ordinal; `[MAX, 0]` before the first voxel.
    table: Vec<[u16; 2]>,
    /// The ordinal of voxels without data.
    no_data: Option<u16>,
}

/// Voxels of bricks `b` of edge `size`, grown by the margin and cut to `n`.
pub(super) fn grown(b: u32, size: u32, n: u32) -> std::ops::Range<u32> {
    (b * size).saturating_sub(RANGE_MARGIN)..(b * size + size).saturating_add(RANGE_MARGIN).min(n)
}

impl RangeBuilder {
    pub(super) fn new(grid: BrickGrid, no_data: Option<u16>) -> Self {
        Self { grid, table: vec![BrickRanges::NONE; grid.brick_count() as usize], no_data }
    }

    /// Takes a tile's planes that start at `z0`, x fastest. Tiles and planes may come in any pieces; voxels on a margin
    /// count for all bricks that they touch.
    pub(super) fn add<T: Voxel>(&mut self, tile: &Tile, z0: u32, slab: &[T]) {
        let (n, bricks, size) = (self.grid.volume_dims(), self.grid.dims(), self.grid.brick_size());
        let [nx, ny] = tile.size();
        let z1 = z0 + (slab.len() / (nx * ny)) as u32;
        if z1 == z0 {
            return;
        }
        // Bricks that reach into voxels `lo..hi` of an axis, and what of that each of them reaches.
        let met = |lo: u32, hi: u32, bricks: u32| {
            lo.saturating_sub(RANGE_MARGIN) / size..((hi - 1 + RANGE_MARGIN) / size + 1).min(bricks)
        };
        let reached = |b: u32, n: u32, lo: u32, hi: u32| {
            let all = grown(b, size, n);
            (all.start.max(lo) - lo) as usize..(all.end.min(hi) - lo) as usize
        };
        let no_data = self.no_data.map(T::at);
        let (xs, ys) = (met(tile.lo[0], tile.hi[0], bricks.x), met(tile.lo[1], tile.hi[1], bricks.y));
        let x_boxes: Vec<_> = xs.clone().map(|bx| reached(bx, n.x, tile.lo[0], tile.hi[0])).collect();
        let (layer, row) = ((bricks.x * bricks.y) as usize, bricks.x as usize);
        for bz in met(z0, z1, bricks.z) {
            let zs = reached(bz, n.z, z0, z1);
            let rows = &mut self.table[bz as usize * layer..][..layer][ys.start as usize * row..ys.end as usize * row];
            rows.par_chunks_mut(row).zip(ys.clone().into_par_iter()).for_each(|(row, by)| {
                let row = &mut row[xs.start as usize..xs.end as usize];
                let mut found = vec![(T::MAX, T::MIN); row.len()];
                for z in zs.clone() {
                    for y in reached(by, n.y, tile.lo[1], tile.hi[1]) {
                        let line = &slab[(z * ny + y) * nx..][..nx];
                        for (range, xs) in found.iter_mut().zip(&x_boxes) {
                            let row = line[xs.clone()].iter().copied();
                            let join = |(a, b): (T, T), v: T| (a.min(v), b.max(v));
                            *range = match no_data {
                                None => row.fold(*range, join),
                                Some(none) => row.filter(|v| *v != none).fold(*range, join),
                            };
                        }
                    }
                }
                for ([min, max], (a, b)) in row.iter_mut().zip(found) {
                    *min = (*min).min(a.ordinal());
                    *max = (*max).max(b.ordinal());
                }
            });
        }
    }

    /// `code_of_ordinal` must not descend over the data, so that the extremes stay the extremes.
    pub(super) fn finish(self, code_of_ordinal: &[u16]) -> BrickRanges {
        let code = |ordinal: u16| code_of_ordinal[usize::from(ordinal)];
        let codes = |[min, max]: [u16; 2]| if min > max { BrickRanges::NONE } else { [code(min), code(max)] };
        BrickRanges(self.table.into_iter().map(codes).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec3;

    /// Every brick size, slabs that cut bricks and margins in every way, against the definition voxel by voxel.
    #[test]
    fn ranges_reach_over_the_margin_and_no_further() {
        let n = UVec3::new(37, 21, 70);
        let at = |x: u32, y: u32, z: u32| x.wrapping_mul(7919) ^ y.wrapping_mul(104_729) ^ z.wrapping_mul(1_299_709);
        let voxels: Vec<i16> = (0..n.z)
            .flat_map(|z| (0..n.y).flat_map(move |y| (0..n.x).map(move |x| (x, y, z))))
            .map(|(x, y, z)| (at(x, y, z).wrapping_mul(2_654_435_761) >> 16) as i16)
            .collect();
        // No data beyond z = 40 but for a few voxels, and the smallest value of all.
        let mostly = i16::MIN;
        let holed: Vec<i16> = voxels
            .iter()
            .enumerate()
            .map(|(i, v)| if i > 40 * 37 * 21 && i % 10_007 != 0 { mostly } else { (*v).max(mostly + 1) })
            .collect();
        for size in [8, 16, 32, 64] {
            let grid = BrickGrid::new(n, size).unwrap();
            for (planes, no_data) in [(1usize, None), (5, None), (32, None), (5, Some(mostly.ordinal()))] {
                let mut builder = RangeBuilder::new(grid, no_data);
                let plane = (n.x * n.y) as usize;
                let voxels = if no_data.is_some() { &holed } else { &voxels };
                for (i, slab) in voxels.chunks(planes * plane).enumerate() {
                    builder.add(&Tile::whole(n), (i * planes) as u32, slab);
                }
                let identity: Vec<u16> = (0..=u16::MAX).collect();
                let got = builder.finish(&identity);
                for (linear, brick) in grid.bricks().enumerate() {
                    let stored = grid.owned_box(brick).stored(RANGE_MARGIN);
                    let (lo, hi) = (stored.lo.max(glam::IVec3::ZERO), stored.hi.min(n.as_ivec3()));
                    let mut want = [u16::MAX, 0];
                    for z in lo.z..hi.z {
                        for y in lo.y..hi.y {
                            for x in lo.x..hi.x {
                                let v = voxels[(x + n.x as i32 * (y + n.y as i32 * z)) as usize].ordinal();
                                if Some(v) == no_data {
                                    continue;
                                }
                                want = [want[0].min(v), want[1].max(v)];
                            }
                        }
                    }
                    assert_eq!(got.0[linear], want, "brick {brick} of size {size}, {planes} planes");
                }
            }
        }
    }
}

//! The table of brick ranges: which stretched codes sampling a brick can meet.

use std::ops::Range;

use glam::UVec3;
use rayon::prelude::*;

use super::error::{RangesError, StoreError};
use super::hash::ContentHash;
use super::manifest::Manifest;
use super::tiles::Tile;
use super::voxel::Voxel;
use crate::brick::{BrickGrid, RANGE_MARGIN};
use crate::ids::BrickIndex;

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
        let cubes = Cubes::bricks(manifest.grid);
        table_from_bytes("brick", cubes, bytes, manifest.files.ranges, manifest.no_data.is_some()).map(Self)
    }

    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        table_to_bytes(&self.0)
    }
}

/// Minimum and maximum of each cube, u16 little endian, x fastest.
pub(super) fn table_to_bytes(ranges: &[[u16; 2]]) -> Vec<u8> {
    ranges.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()
}

/// The ranges in `bytes`, which must be those of `hash` and one for each of `cubes`; only where voxels may lack data,
/// a cube may hold none. `what` is a cube, in words.
pub(super) fn table_from_bytes(
    what: &'static str,
    cubes: Cubes,
    bytes: &[u8],
    hash: ContentHash,
    may_lack: bool,
) -> Result<Vec<[u16; 2]>, StoreError> {
    let want = cubes.count() * 4;
    if bytes.len() as u64 != want {
        return Err(RangesError::Length { what, got: bytes.len(), want, count: cubes.count() }.into());
    }
    let got = ContentHash::of(bytes);
    if got != hash {
        return Err(RangesError::Hash { got, want: hash }.into());
    }
    let u16_at = |b: &[u8], i| u16::from_le_bytes([b[i], b[i + 1]]);
    let ranges: Vec<_> = bytes.chunks_exact(4).map(|b| [u16_at(b, 0), u16_at(b, 2)]).collect();
    let sound = |range: &[u16; 2]| range[0] <= range[1] || (may_lack && *range == BrickRanges::NONE);
    if let Some((index, &[min, max])) = ranges.iter().enumerate().find(|(_, range)| !sound(range)) {
        let at = BrickIndex(cubes.at(index).to_array());
        return Err(RangesError::Inverted { what, at, min, max }.into());
    }
    Ok(ranges)
}

/// Voxels of bricks `b` of edge `size`, grown by the margin and cut to `n`.
pub(super) fn grown(b: u32, size: u32, n: u32) -> Range<u32> {
    Cubes { dims: UVec3::splat(n), edge: size, margin: RANGE_MARGIN }.grown(b, n)
}

/// Cubes of one edge from the volume's corner, each grown by a margin and cut to the volume.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cubes {
    /// The volume's, voxels.
    pub(super) dims: UVec3,
    pub(super) edge: u32,
    pub(super) margin: u32,
}

impl Cubes {
    /// Bricks, as sampling and slabs reach them.
    pub(super) fn bricks(grid: BrickGrid) -> Self {
        Self { dims: grid.volume_dims(), edge: grid.brick_size(), margin: RANGE_MARGIN }
    }

    /// Cubes per axis.
    pub(super) fn counts(self) -> UVec3 {
        self.dims.map(|n| n.div_ceil(self.edge))
    }

    pub(super) fn count(self) -> u64 {
        self.counts().as_u64vec3().element_product()
    }

    /// The cube at a place of the table, in cubes.
    pub(super) fn at(self, index: usize) -> UVec3 {
        let (d, index) = (self.counts().as_u64vec3(), index as u64);
        UVec3::new((index % d.x) as u32, (index / d.x % d.y) as u32, (index / (d.x * d.y)) as u32)
    }

    /// Voxels of an axis of `n` that cube `b` reaches.
    fn grown(self, b: u32, n: u32) -> Range<u32> {
        (b * self.edge).saturating_sub(self.margin)..(b * self.edge + self.edge).saturating_add(self.margin).min(n)
    }

    /// Cubes that reach into voxels `lo..hi` of an axis with `count` of them.
    fn met(self, lo: u32, hi: u32, count: u32) -> Range<u32> {
        lo.saturating_sub(self.margin) / self.edge..((hi - 1 + self.margin) / self.edge + 1).min(count)
    }

    /// What of `lo..hi` cube `b` reaches, from `lo` on.
    fn reached(self, b: u32, n: u32, lo: u32, hi: u32) -> Range<usize> {
        let all = self.grown(b, n);
        (all.start.max(lo) - lo) as usize..(all.end.min(hi) - lo) as usize
    }
}

/// Fewer voxels are not worth the waking of threads.
const ALONE: usize = 1 << 17;

/// Ranges of cubes in ordinals, gathered slab by slab: what they are stretched to is known only at the end.
#[derive(Debug)]
pub(super) struct RangeBuilder {
    cubes: Cubes,
    /// Minimum and maximum ordinal, x fastest; `[MAX, 0]` before the first voxel.
    table: Vec<[u16; 2]>,
    /// The ordinal of voxels without data.
    no_data: Option<u16>,
}

impl RangeBuilder {
    pub(super) fn new(cubes: Cubes, no_data: Option<u16>) -> Self {
        Self { cubes, table: vec![BrickRanges::NONE; cubes.count() as usize], no_data }
    }

    /// Takes a tile's planes that start at `z0`, x fastest. Tiles and planes may come in any pieces; voxels on a margin
    /// count for all cubes that they touch.
    pub(super) fn add<T: Voxel>(&mut self, tile: &Tile, z0: u32, slab: &[T]) {
        let ([nx, _], no_data) = (tile.size(), self.no_data.map(T::at));
        self.add_lines(tile, z0..z0 + (slab.len() / tile.voxels()) as u32, |line, lows: &mut [T], highs| {
            widen(lows, highs, &slab[line * nx..][..nx], no_data);
        });
    }

    /// Takes a tile's plane of voxels that stand for others: the smallest and the largest ordinal of each, the first
    /// above the second where none holds data.
    pub(super) fn add_bounds(&mut self, tile: &Tile, z: u32, low: &[u16], high: &[u16]) {
        let [nx, _] = tile.size();
        self.add_lines(tile, z..z + 1, |line, lows: &mut [u16], highs| {
            let of_line = line * nx..(line + 1) * nx;
            lows.iter_mut().zip(&low[of_line.clone()]).for_each(|(low, v)| *low = (*low).min(*v));
            highs.iter_mut().zip(&high[of_line]).for_each(|(high, v)| *high = (*high).max(*v));
        });
    }

    /// `widen` widens bounds at each x by a row of the tile's planes.
    fn add_lines<T: Voxel>(
        &mut self,
        tile: &Tile,
        Range { start: z0, end: z1 }: Range<u32>,
        widen: impl Fn(usize, &mut [T], &mut [T]) + Sync,
    ) {
        let (cubes, n, counts) = (self.cubes, self.cubes.dims, self.cubes.counts());
        let [nx, ny] = tile.size();
        if z1 == z0 {
            return;
        }
        let (xs, ys) = (cubes.met(tile.lo[0], tile.hi[0], counts.x), cubes.met(tile.lo[1], tile.hi[1], counts.y));
        let x_boxes: Vec<_> = xs.clone().map(|bx| cubes.reached(bx, n.x, tile.lo[0], tile.hi[0])).collect();
        let (layer, row) = ((counts.x * counts.y) as usize, counts.x as usize);
        for bz in cubes.met(z0, z1, counts.z) {
            let zs = cubes.reached(bz, n.z, z0, z1);
            let rows = &mut self.table[bz as usize * layer..][..layer][ys.start as usize * row..ys.end as usize * row];
            let widen_row = |(row, by): (&mut [[u16; 2]], u32)| {
                let row = &mut row[xs.start as usize..xs.end as usize];
                // Over all rows of voxels that the row of cubes reaches, at each x.
                let (mut lows, mut highs) = (vec![T::MAX; nx], vec![T::MIN; nx]);
                for z in zs.clone() {
                    for y in cubes.reached(by, n.y, tile.lo[1], tile.hi[1]) {
                        widen(z * ny + y, &mut lows, &mut highs);
                    }
                }
                for ([min, max], xs) in row.iter_mut().zip(&x_boxes) {
                    let low = lows[xs.clone()].iter().copied().fold(T::MAX, T::min);
                    let high = highs[xs.clone()].iter().copied().fold(T::MIN, T::max);
                    *min = (*min).min(low.ordinal());
                    *max = (*max).max(high.ordinal());
                }
            };
            if nx * ny * zs.len() < ALONE {
                rows.chunks_mut(row).zip(ys.clone()).for_each(widen_row);
            } else {
                rows.par_chunks_mut(row).zip(ys.clone().into_par_iter()).for_each(widen_row);
            }
        }
    }

    /// What voxels of these planes can have said.
    pub(super) fn part(&self, planes: &Range<u32>) -> &[[u16; 2]] {
        &self.table[self.reached(planes)]
    }

    /// Widens the same ranges by `others`; how many they are.
    pub(super) fn join(&mut self, planes: &Range<u32>, others: &mut impl Iterator<Item = [u16; 2]>) -> usize {
        let reached = self.reached(planes);
        for ([min, max], [low, high]) in self.table[reached.clone()].iter_mut().zip(others) {
            (*min, *max) = ((*min).min(low), (*max).max(high));
        }
        reached.len()
    }

    /// Places of the cubes that these planes reach.
    fn reached(&self, planes: &Range<u32>) -> Range<usize> {
        let counts = self.cubes.counts();
        let layers = self.cubes.met(planes.start, planes.end, counts.z);
        let at = |z: u32| z as usize * counts.x as usize * counts.y as usize;
        at(layers.start)..at(layers.end)
    }

    /// `code_of_ordinal` must not descend over the data, so that the extremes stay the extremes.
    pub(super) fn finish(self, code_of_ordinal: &[u16]) -> Vec<[u16; 2]> {
        let code = |ordinal: u16| code_of_ordinal[usize::from(ordinal)];
        let codes = |[min, max]: [u16; 2]| if min > max { BrickRanges::NONE } else { [code(min), code(max)] };
        self.table.into_iter().map(codes).collect()
    }
}

fn widen<T: Voxel>(lows: &mut [T], highs: &mut [T], line: &[T], no_data: Option<T>) {
    let each = lows.iter_mut().zip(highs).zip(line.iter().copied());
    match no_data {
        None => each.for_each(|((low, high), v)| (*low, *high) = ((*low).min(v), (*high).max(v))),
        Some(none) => each.for_each(|((low, high), v)| {
            *low = (*low).min(if v == none { T::MAX } else { v });
            *high = (*high).max(if v == none { T::MIN } else { v });
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
                let mut builder = RangeBuilder::new(Cubes::bricks(grid), no_data);
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
                    assert_eq!(got[linear], want, "brick {brick} of size {size}, {planes} planes");
                }
            }
        }
    }
}

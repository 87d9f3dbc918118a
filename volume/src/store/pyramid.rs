//! What the finest voxels under each voxel of a coarser level are, gathered as they pass by: plane by plane, level by
//! level, each level's planes from those of the next finer one. Memory: a plane of a tile, a third more than of level
//! 1.
//!
//! Tiles begin and end at multiples of 2^8 voxels, so a voxel of levels 1 to 8 lies in one tile. One of a coarser level
//! may lie in several: what is under the voxels of level 8, one for each shard, is kept until all tiles have passed.

use std::ops::Range;

use glam::UVec3;
use rayon::prelude::*;

use super::error::StoreError;
use super::profile::SHARD_EDGE;
use super::tiles::Tile;

/// The coarsest level whose voxels lie in one tile each.
pub(super) const TILED: usize = SHARD_EDGE.ilog2() as usize;

/// Voxels of a plane: fewer are not worth the waking of threads.
const ALONE: usize = 1 << 16;

/// What is gathered of the finest voxels under one voxel of a level.
pub(super) trait Under: Clone + Send + Sync {
    /// Of no voxels.
    const NOTHING: Self;

    fn join(&mut self, other: &Self);
}

/// The planes that are being gathered.
#[derive(Debug)]
pub(super) struct Pyramid<U> {
    /// From level 1 on.
    levels: Vec<Rising<U>>,
    /// Of all voxels of level 8, x fastest, where there are several tiles and coarser levels.
    seam: Option<Vec<U>>,
}

#[derive(Debug)]
struct Rising<U> {
    /// The level's, voxels.
    dims: UVec3,
    /// Of one tile, until all that is under it has passed.
    plane: Vec<U>,
}

/// Takes a whole plane of a tile of a level: its place among the coarser levels, tile, z, x fastest.
pub(super) trait Take<U>: FnMut(usize, &Tile, u32, &[U]) -> Result<(), StoreError> {}
impl<U, F: FnMut(usize, &Tile, u32, &[U]) -> Result<(), StoreError>> Take<U> for F {}

impl<U: Under> Pyramid<U> {
    /// `dims` of the coarser levels, from level 1 on. Where what comes is cut into tiles or parts, voxels of levels
    /// above 8 may lie in several.
    pub(super) fn new(dims: impl Iterator<Item = UVec3>, may_be_cut: bool) -> Self {
        let levels: Vec<_> = dims.map(|dims| Rising { dims, plane: Vec::new() }).collect();
        let seam = (may_be_cut && levels.len() > TILED)
            .then(|| vec![U::NOTHING; levels[TILED - 1].dims.as_u64vec3().element_product() as usize]);
        Self { levels, seam }
    }

    /// With what was gathered elsewhere of all voxels of level 8, x fastest; nothing where they are not so many, or
    /// where no level is coarser.
    pub(super) fn above(dims: impl Iterator<Item = UVec3>, seam: Vec<U>) -> Option<Self> {
        let levels: Vec<_> = dims.map(|dims| Rising { dims, plane: Vec::new() }).collect();
        let tiled = levels.get(TILED - 1).filter(|_| levels.len() > TILED)?;
        let is_whole = tiled.dims.as_u64vec3().element_product() == seam.len() as u64;
        is_whole.then_some(Self { levels, seam: Some(seam) })
    }

    /// What was gathered of the planes `planes` of level 8, x fastest, where coarser levels need it.
    pub(super) fn into_seam(self, planes: Range<u32>) -> Option<Vec<U>> {
        let seam = self.seam?;
        let plane = Tile::whole(self.levels[TILED - 1].dims).voxels();
        Some(seam[planes.start as usize * plane..planes.end as usize * plane].to_vec())
    }

    pub(super) fn is_empty(&self) -> bool {
        self.levels.is_empty()
    }

    /// Takes planes of a tile of the finest voxels from `z0` on, which is even: an even number of them, unless they are
    /// the last. `gather` adds a row of them to a row of half the length.
    pub(super) fn add<T: Sync>(
        &mut self,
        tile: &Tile,
        z0: u32,
        slab: &[T],
        gather: impl Fn(&[T], &mut [U]) + Sync,
        take: &mut impl Take<U>,
    ) -> Result<(), StoreError> {
        let Some(first) = self.levels.first_mut() else { return Ok(()) };
        let mut plane = std::mem::take(&mut first.plane);
        let above = tile.halved();
        for (z, pair) in (z0 / 2..).zip(slab.chunks(2 * tile.voxels())) {
            plane.clear();
            plane.resize(above.voxels(), U::NOTHING);
            for below in pair.chunks(tile.voxels()) {
                halve(tile, below, &mut plane, &gather);
            }
            self.risen(0, &above, z, &plane, take)?;
        }
        self.levels[0].plane = plane;
        Ok(())
    }

    /// Gathers what lies in several tiles, once all have passed.
    pub(super) fn finish(mut self, take: &mut impl Take<U>) -> Result<(), StoreError> {
        let Some(seam) = self.seam.take() else { return Ok(()) };
        let dims = self.levels[TILED - 1].dims;
        let tile = Tile::whole(dims);
        (0..).zip(seam.chunks_exact(tile.voxels())).try_for_each(|(z, plane)| self.rise(TILED, &tile, z, plane, take))
    }

    /// Goes on with a whole plane of the level at `at`.
    fn risen(
        &mut self,
        at: usize,
        tile: &Tile,
        z: u32,
        plane: &[U],
        take: &mut impl Take<U>,
    ) -> Result<(), StoreError> {
        take(at, tile, z, plane)?;
        match &mut self.seam {
            Some(seam) if at + 1 == TILED => {
                let whole = Tile::whole(self.levels[at].dims);
                let start = z as usize * whole.voxels();
                for (y, row) in (tile.lo[1]..).zip(plane.chunks_exact(tile.size()[0])) {
                    seam[start + whole.at(tile.lo[0], y)..][..row.len()].clone_from_slice(row);
                }
                Ok(())
            }
            _ => self.rise(at + 1, tile, z, plane, take),
        }
    }

    /// Adds a plane to the level at `at`, which is the next coarser one.
    fn rise(&mut self, at: usize, tile: &Tile, z: u32, below: &[U], take: &mut impl Take<U>) -> Result<(), StoreError> {
        if at == self.levels.len() {
            return Ok(());
        }
        let (above, depth) = (tile.halved(), self.levels[at - 1].dims.z);
        let mut plane = std::mem::take(&mut self.levels[at].plane);
        if z.is_multiple_of(2) {
            plane.clear();
            plane.resize(above.voxels(), U::NOTHING);
        }
        halve(tile, below, &mut plane, &|row: &[U], out: &mut [U]| {
            row.chunks(2).zip(out).for_each(|(pair, under)| pair.iter().for_each(|other| under.join(other)));
        });
        if !z.is_multiple_of(2) || z + 1 == depth {
            self.risen(at, &above, z / 2, &plane, take)?;
        }
        self.levels[at].plane = plane;
        Ok(())
    }
}

/// Adds a plane of `tile` to one of half as many voxels on either axis, by `gather` row by row.
fn halve<T: Sync, U: Send>(tile: &Tile, below: &[T], above: &mut [U], gather: &(impl Fn(&[T], &mut [U]) + Sync)) {
    let ([width, _], above_width) = (tile.size(), tile.halved().size()[0]);
    let gather_rows = |(out, rows): (&mut [U], &[T])| rows.chunks_exact(width).for_each(|row| gather(row, out));
    if below.len() < ALONE {
        above.chunks_mut(above_width).zip(below.chunks(2 * width)).for_each(gather_rows);
    } else {
        above.par_chunks_mut(above_width).zip(below.par_chunks(2 * width)).for_each(gather_rows);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum of what is under it.
    #[derive(Debug, Clone, PartialEq)]
    struct Sum(u64);

    impl Under for Sum {
        const NOTHING: Self = Self(0);

        fn join(&mut self, other: &Self) {
            self.0 += other.0;
        }
    }

    fn gather(row: &[u64], out: &mut [Sum]) {
        row.chunks(2).zip(out).for_each(|(pair, sum)| sum.0 += pair.iter().sum::<u64>());
    }

    /// Every level of a volume of `dims` in tiles of `tile` voxels, against the sums of the finest voxels.
    fn check(dims: [u32; 3], tile: [u32; 2], slab: u32, levels: u32) {
        let coarse = |level: u32| UVec3::from(dims.map(|n| n.div_ceil(1 << level)));
        let value = |x: u32, y: u32, z: u32| u64::from(x * 7 + y * 1000 + z * 100_003) % 997;
        let mut found: Vec<Vec<Option<u64>>> = Vec::new();
        found.extend((1..=levels).map(|level| vec![None; coarse(level).element_product() as usize]));
        let tiles: Vec<Tile> = (0..dims[1])
            .step_by(tile[1] as usize)
            .flat_map(|y| (0..dims[0]).step_by(tile[0] as usize).map(move |x| [x, y]))
            .map(|lo| Tile { lo, hi: std::array::from_fn(|a| (lo[a] + tile[a]).min(dims[a])) })
            .collect();
        let mut pyramid = Pyramid::<Sum>::new((1..=levels).map(coarse), tiles.len() > 1);
        let mut take = |at: usize, tile: &Tile, z: u32, plane: &[Sum]| {
            let whole = Tile::whole(coarse(at as u32 + 1));
            let [width, _] = tile.size();
            for (i, sum) in plane.iter().enumerate() {
                let (x, y) = (tile.lo[0] + (i % width) as u32, tile.lo[1] + (i / width) as u32);
                let place = &mut found[at][z as usize * whole.voxels() + whole.at(x, y)];
                assert!(place.replace(sum.0).is_none(), "level {}, {x} {y} {z} twice", at + 1);
            }
            Ok(())
        };
        for tile in &tiles {
            for z0 in (0..dims[2]).step_by(slab as usize) {
                let plane = |z| {
                    let row = move |y| (tile.lo[0]..tile.hi[0]).map(move |x| value(x, y, z));
                    (tile.lo[1]..tile.hi[1]).flat_map(row)
                };
                let voxels: Vec<u64> = (z0..(z0 + slab).min(dims[2])).flat_map(plane).collect();
                pyramid.add(tile, z0, &voxels, gather, &mut take).unwrap();
            }
        }
        pyramid.finish(&mut take).unwrap();
        for (level, found) in (1..).zip(found) {
            let d = coarse(level);
            let mut want = vec![0; d.element_product() as usize];
            for z in 0..dims[2] {
                for y in 0..dims[1] {
                    for x in 0..dims[0] {
                        want[((x >> level) + d.x * ((y >> level) + d.y * (z >> level))) as usize] += value(x, y, z);
                    }
                }
            }
            assert!(found.into_iter().eq(want.into_iter().map(Some)), "level {level} of {dims:?} in tiles of {tile:?}");
        }
    }

    #[test]
    fn every_voxel_of_every_level_holds_what_is_under_it() {
        check([13, 7, 21], [13, 7], 16, 5);
        check([16, 16, 16], [16, 16], 2, 4);
        check([300, 5, 18], [256, 5], 16, 9);
        check([5, 1, 1], [5, 1], 16, 3);
    }

    /// Voxels of levels 9 and 10 lie in several tiles.
    #[test]
    fn what_lies_in_several_tiles_is_joined() {
        check([1200, 600, 3], [512, 256], 16, 11);
    }
}

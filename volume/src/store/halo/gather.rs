//! Shells gathered as planes pass by: a halo is cut from the very slabs that the arrays are written from, so nothing is
//! decoded to make it.

use std::collections::VecDeque;
use std::ops::Range;

use rayon::prelude::*;

use super::reach::HaloReach;
use super::shell::Shell;
use crate::brick::BrickGrid;
use crate::ids::BrickIndex;
use crate::store::error::StoreError;
use crate::store::tiles::Tile;

/// What is gathered of one shell, in the order of its runs.
pub(crate) trait Gathered: Send + Sync {
    /// Empty, with room for so many voxels.
    fn with_room(voxels: usize) -> Self;
}

impl<T: Send + Sync> Gathered for Vec<T> {
    fn with_room(voxels: usize) -> Self {
        Self::with_capacity(voxels)
    }
}

/// Labels and distances.
impl Gathered for (Vec<u32>, Vec<u8>) {
    fn with_room(voxels: usize) -> Self {
        (Vec::with_capacity(voxels), Vec::with_capacity(voxels))
    }
}

/// Appends a run, most of which are a voxel or two at a brick's side.
#[inline(always)]
pub(crate) fn append<T: Copy>(out: &mut Vec<T>, run: &[T]) {
    match run {
        [voxel] => out.push(*voxel),
        [one, other] => out.extend([*one, *other]),
        run => out.extend_from_slice(run),
    }
}

/// Gathers the shells of a tile's bricks, a layer of bricks (all those with the same z) at a time. Memory: their
/// shells, which is seven to thirteen planes of the tile for each layer of voxels of the halo, whatever the brick size.
#[derive(Debug)]
pub(crate) struct ShellGatherer<G> {
    grid: BrickGrid,
    reach: HaloReach,
    tile: Tile,
    /// z of the first layer of bricks in `open`.
    first: u32,
    /// Behind the last layer of bricks whose shells are wanted.
    end: u32,
    /// Layers of bricks that began and are not complete; shells x fastest, those of a brick from the inside out.
    open: VecDeque<Vec<G>>,
}

impl<G: Gathered> ShellGatherer<G> {
    /// Of the layers of bricks `layers`.
    pub(crate) fn new(grid: BrickGrid, reach: HaloReach, tile: Tile, layers: Range<u32>) -> Self {
        Self { grid, reach, tile, first: layers.start, end: layers.end, open: VecDeque::new() }
    }

    /// What of the volume's planes is needed: the tile and the halos of its bricks.
    fn held(&self) -> Tile {
        self.tile.grown(self.reach.last, self.grid.volume_dims())
    }

    /// The shell at a place of a layer of bricks.
    fn shell(&self, bz: u32, within: usize) -> Shell {
        let (brick, nth) = (within / self.reach.records(), within % self.reach.records());
        let (xs, ys) = (self.along(0), self.along(1));
        let (along_x, linear) = (xs.len() as u32, brick as u32);
        self.reach.shell(&self.grid, BrickIndex([xs.start + linear % along_x, ys.start + linear / along_x, bz]), nth)
    }

    /// Where its bricks lie along an axis.
    fn along(&self, axis: usize) -> Range<u32> {
        self.tile.cells(axis, self.grid.brick_size())
    }

    /// Takes planes of the tile grown by the halo's reach (the volume's planes where the tile is all of it), in any
    /// pieces but in their order. `take` appends the voxels of a run, whose positions count from the first plane's
    /// first voxel; `complete` gets each layer of bricks when it is, before the next one begins.
    pub(crate) fn add(
        &mut self,
        planes: Range<u32>,
        take: impl Fn(&mut G, Range<usize>) + Sync,
        mut complete: impl FnMut(&[G]) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let (records, held) = (self.reach.records(), self.held());
        let of_layer = self.along(0).len() * self.along(1).len() * records;
        for bz in self.first..self.end {
            // Those of the outermost shell.
            let its_planes = self.shell(bz, records - 1).planes();
            if its_planes.start >= planes.end {
                break;
            }
            let mut shells = match (bz - self.first) as usize {
                open if open < self.open.len() => std::mem::take(&mut self.open[open]),
                _ => {
                    self.open.push_back(Vec::new());
                    let voxels = |i| self.shell(bz, i).voxels() as usize;
                    (0..of_layer).map(|i| G::with_room(voxels(i))).collect()
                }
            };
            shells.par_iter_mut().enumerate().for_each(|(i, out)| {
                let shell = self.shell(bz, i);
                for z in shell.planes().start.max(planes.start)..shell.planes().end.min(planes.end) {
                    let plane = (z - planes.start) as usize * held.voxels();
                    shell.each_run(z, |y, xs| {
                        let first = plane + held.at(xs.start, y);
                        take(out, first..first + xs.len());
                    });
                }
            });
            if its_planes.end <= planes.end {
                complete(&shells)?;
                self.open.pop_front();
                self.first += 1;
            } else {
                let open = (bz - self.first) as usize;
                self.open[open] = shells;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec3;
    use proptest::prelude::*;

    proptest! {
        /// Slabs that end anywhere: a plane taken twice, or for the wrong brick, would shift the rest of a record.
        #[test]
        fn gathered_shells_hold_the_volume_in_the_order_of_their_runs(
            dims in [1_u32..50, 1_u32..50, 1_u32..120], size in 4_u32..7, first in 1_u32..3, more in 0_u32..4,
            planes in 1_usize..40,
        ) {
            let grid = BrickGrid::new(UVec3::from(dims), 1 << size).unwrap();
            let reach = HaloReach { first, last: first + more };
            let [nx, ny, nz] = dims;
            let voxels: Vec<u32> = (0..nx * ny * nz).collect();
            let (tile, layers) = (Tile::whole(grid.volume_dims()), 0..grid.dims().z);
            let mut gatherer = ShellGatherer::<Vec<u32>>::new(grid, reach, tile, layers);
            let mut got: Vec<Vec<u32>> = Vec::new();
            for (i, slab) in voxels.chunks(planes * (nx * ny) as usize).enumerate() {
                let z0 = (i * planes) as u32;
                let z1 = z0 + (slab.len() as u32 / (nx * ny));
                let take = |out: &mut Vec<u32>, run: Range<usize>| out.extend_from_slice(&slab[run]);
                let complete = |shells: &[Vec<u32>]| {
                    got.extend_from_slice(shells);
                    Ok(())
                };
                gatherer.add(z0..z1, take, complete).unwrap();
            }
            prop_assert!(gatherer.open.is_empty());
            prop_assert_eq!(got.len() as u64, grid.brick_count() * reach.records() as u64);
            let records = grid.bricks().flat_map(|brick| (0..reach.records()).map(move |nth| (brick, nth)));
            for ((brick, nth), got) in records.zip(got) {
                let shell = reach.shell(&grid, brick, nth);
                let voxel = |x, y, z| x + nx * (y + ny * z);
                let want: Vec<u32> = shell.planes()
                    .flat_map(|z| shell.runs(z).flat_map(move |(y, xs)| xs.map(move |x| voxel(x, y, z))))
                    .collect();
                prop_assert_eq!(got, want, "brick {}, record {}", brick, nth);
            }
        }
    }
}

//! Shells gathered as planes pass by: a halo is cut from the very slabs that the arrays are written from, so nothing is
//! decoded to make it.

use std::collections::VecDeque;

use rayon::prelude::*;

use super::shell::Shell;
use crate::brick::BrickGrid;

/// The shells of a layer of bricks (all those with the same z), x fastest.
pub(super) type ShellLayer<T> = Vec<Vec<T>>;

/// Gathers the shells of all bricks. Memory: those of the bricks that the planes of a slab touch, which is about six planes of
/// the volume for each layer of the halo, whatever the brick size.
#[derive(Debug)]
pub(super) struct ShellGatherer<T> {
    grid: BrickGrid,
    layers: u32,
    /// z of the first layer of bricks in `open`.
    first: u32,
    open: VecDeque<ShellLayer<T>>,
}

impl<T: Copy + Send + Sync> ShellGatherer<T> {
    pub(super) fn new(grid: BrickGrid, layers: u32) -> Self {
        Self { grid, layers, first: 0, open: VecDeque::new() }
    }

    fn shell(&self, bz: u32, within: usize) -> Shell {
        let (bx, linear) = (self.grid.dims().x, within as u32);
        Shell::of(&self.grid, crate::ids::BrickIndex([linear % bx, linear / bx, bz]), self.layers)
    }

    /// Takes the whole planes that start at `z0`, x fastest, in any pieces but in their order. Gives the layers of bricks that
    /// are complete now, in their order.
    pub(super) fn add(&mut self, z0: u32, slab: &[T]) -> Vec<ShellLayer<T>> {
        let (n, bricks) = (self.grid.volume_dims(), self.grid.dims());
        let (nx, ny) = (n.x as usize, n.y as usize);
        let z1 = z0 + (slab.len() / (nx * ny)) as u32;
        let mut complete = 0;
        for bz in self.first..bricks.z {
            let planes = self.shell(bz, 0).planes();
            if planes.start >= z1 {
                break;
            }
            let open = (bz - self.first) as usize;
            if open == self.open.len() {
                let empty = |i| Vec::with_capacity(self.shell(bz, i).voxels() as usize);
                self.open.push_back((0..(bricks.x * bricks.y) as usize).map(empty).collect());
            }
            let mut shells = std::mem::take(&mut self.open[open]);
            shells.par_iter_mut().enumerate().for_each(|(i, out)| {
                let shell = self.shell(bz, i);
                for z in planes.start.max(z0)..planes.end.min(z1) {
                    for (y, xs) in shell.runs(z) {
                        let row = ((z - z0) as usize * ny + y as usize) * nx;
                        out.extend_from_slice(&slab[row + xs.start as usize..row + xs.end as usize]);
                    }
                }
            });
            self.open[open] = shells;
            complete += usize::from(planes.end <= z1);
        }
        self.first += complete as u32;
        self.open.drain(..complete).collect()
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
            dims in [1_u32..50, 1_u32..50, 1_u32..120], size in 4_u32..7, layers in 1_u32..3, planes in 1_usize..40,
        ) {
            let grid = BrickGrid::new(UVec3::from(dims), 1 << size).unwrap();
            let [nx, ny, nz] = dims;
            let voxels: Vec<u32> = (0..nx * ny * nz).collect();
            let mut gatherer = ShellGatherer::new(grid, layers);
            let mut got = Vec::new();
            for (i, slab) in voxels.chunks(planes * (nx * ny) as usize).enumerate() {
                got.extend(gatherer.add((i * planes) as u32, slab).into_iter().flatten());
            }
            prop_assert!(gatherer.open.is_empty());
            prop_assert_eq!(got.len() as u64, grid.brick_count());
            for (brick, got) in grid.bricks().zip(got) {
                let shell = Shell::of(&grid, brick, layers);
                let voxel = |x, y, z| x + nx * (y + ny * z);
                let want: Vec<u32> = shell.planes()
                    .flat_map(|z| shell.runs(z).flat_map(move |(y, xs)| xs.map(move |x| voxel(x, y, z))))
                    .collect();
                prop_assert_eq!(got, want, "brick {}", brick);
            }
        }
    }
}

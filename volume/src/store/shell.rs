//! The voxels that a brick needs beside its whole inner chunks: what its halo record holds, and in which order.
//!
//! **Core**: the inner chunks that lie in the brick's owned box with all of their voxels. **Shell**: the owned box grown by
//! the halo's layers and cut to the volume, without the core. Both together are the grown box, each voxel once, so that a
//! brick read from its core and its shell decodes no voxel that it does not hold. At the volume's high edges an inner chunk
//! is partly padding; such chunks are not in the core, and their owned voxels are in the shell.

use std::ops::Range;

use glam::{IVec3, UVec3};

use super::profile::CHUNK_EDGE;
use crate::brick::BrickGrid;
use crate::ids::BrickIndex;

/// True where bricks of `brick_size` are made of whole inner chunks, so that they have halos.
pub(super) fn has_halos(brick_size: u32) -> bool {
    brick_size >= CHUNK_EDGE
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shell {
    /// The grown box inside the volume, half-open.
    lo: UVec3,
    hi: UVec3,
    core_lo: UVec3,
    /// `core_lo` where there is no core.
    core_hi: UVec3,
}

impl Shell {
    /// Of a brick of the grid, whose bricks have halos.
    pub(super) fn of(grid: &BrickGrid, brick: BrickIndex, layers: u32) -> Self {
        let owned = grid.owned_box(brick);
        let grown = owned.stored(layers);
        let whole = owned.hi / CHUNK_EDGE * CHUNK_EDGE;
        Self {
            lo: grown.lo.max(IVec3::ZERO).as_uvec3(),
            hi: grown.hi.as_uvec3().min(grid.volume_dims()),
            core_lo: owned.lo,
            core_hi: if whole.cmpgt(owned.lo).all() { whole } else { owned.lo },
        }
    }

    /// Voxels of the shell.
    pub(super) fn voxels(&self) -> u64 {
        let count = |d: UVec3| d.as_u64vec3().element_product();
        count(self.hi - self.lo) - count(self.core_hi - self.core_lo)
    }

    pub(super) fn planes(&self) -> Range<u32> {
        self.lo.z..self.hi.z
    }

    /// The inner chunks of the core per axis, half-open.
    pub(super) fn core_chunks(&self) -> [Range<u32>; 3] {
        std::array::from_fn(|a| self.core_lo[a] / CHUNK_EDGE..self.core_hi[a] / CHUNK_EDGE)
    }

    /// The runs of voxels of the plane `z`, one of [`Shell::planes`], in the order of the record: y, and where along x.
    pub(super) fn runs(self, z: u32) -> impl Iterator<Item = (u32, Range<u32>)> {
        let of_core = (self.core_lo.z..self.core_hi.z).contains(&z);
        let rows = self.lo.y..self.hi.y;
        rows.flat_map(move |y| {
            let runs = if of_core && (self.core_lo.y..self.core_hi.y).contains(&y) {
                [self.lo.x..self.core_lo.x, self.core_hi.x..self.hi.x]
            } else {
                [self.lo.x..self.hi.x, 0..0]
            };
            runs.into_iter().filter(|run| !run.is_empty()).map(move |run| (y, run))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A voxel that neither holds is missing in pictures, one that both hold is decoded twice.
        #[test]
        fn core_and_shell_hold_each_voxel_of_the_grown_box_once(
            dims in [1_u32..90, 1_u32..90, 1_u32..90], size in 4_u32..8, layers in 1_u32..4, nth in any::<prop::sample::Index>(),
        ) {
            let grid = BrickGrid::new(UVec3::from(dims), 1 << size).unwrap();
            let brick = grid.brick_at(nth.index(grid.brick_count() as usize));
            let shell = Shell::of(&grid, brick, layers);
            let mut held = std::collections::BTreeSet::new();
            for z in shell.planes() {
                for (y, xs) in shell.runs(z) {
                    for x in xs {
                        prop_assert!(held.insert([x, y, z]), "twice: {x} {y} {z}");
                    }
                }
            }
            prop_assert_eq!(held.len() as u64, shell.voxels());
            let owned = grid.owned_box(brick);
            let [xs, ys, zs] = shell.core_chunks().map(|c| c.start * CHUNK_EDGE..c.end * CHUNK_EDGE);
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        prop_assert!(held.insert([x, y, z]), "in core and shell: {x} {y} {z}");
                        let p = UVec3::new(x, y, z);
                        prop_assert!(p.cmpge(owned.lo).all() && p.cmplt(owned.hi).all(), "not owned: {p}");
                    }
                }
            }
            let grown = owned.stored(layers);
            let inside = |p: &[u32; 3]| (0..3).all(|a| {
                (grown.lo[a]..grown.hi[a]).contains(&(p[a] as i32)) && p[a] < dims[a]
            });
            prop_assert!(held.iter().all(inside));
            let cut = (grown.hi.min(UVec3::from(dims).as_ivec3()) - grown.lo.max(IVec3::ZERO)).as_u64vec3();
            prop_assert_eq!(held.len() as u64, cut.element_product());
        }
    }
}

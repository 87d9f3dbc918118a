//! The voxels that a brick needs beside its whole inner chunks: what the records of its halo hold, and in which order.
//!
//! **Core**: the inner chunks that lie in the brick's owned box with all of their voxels. **Shell**: what a box about
//! the brick, cut to the volume, has beyond another one within it. The first shell lies about the core, each further
//! one is a layer of voxels about the one before. Core and shells are the grown box, each voxel once, so that a brick
//! read from them decodes no voxel that it does not hold. At the volume's high edges an inner chunk is partly padding;
//! such chunks are not in the core, and their owned voxels are in the first shell.

use std::ops::Range;

use glam::{IVec3, UVec3};

use super::reach::HaloReach;
use crate::brick::{BrickGrid, OwnedBox};
use crate::ids::BrickIndex;
use crate::store::profile::CHUNK_EDGE;

impl HaloReach {
    /// What a brick's `nth` record holds; its grid's bricks have halos.
    pub(crate) fn shell(self, grid: &BrickGrid, brick: BrickIndex, nth: usize) -> Shell {
        let owned = grid.owned_box(brick);
        let outer = cut(grid, &owned, self.layer(nth));
        let inner = if nth == 0 { core(&owned) } else { cut(grid, &owned, self.layer(nth - 1)) };
        Shell { lo: outer.lo, hi: outer.hi, inner_lo: inner.lo, inner_hi: inner.hi }
    }
}

/// The owned box grown by `layers`, inside the volume.
fn cut(grid: &BrickGrid, owned: &OwnedBox, layers: u32) -> OwnedBox {
    let grown = owned.stored(layers);
    OwnedBox { lo: grown.lo.max(IVec3::ZERO).as_uvec3(), hi: grown.hi.as_uvec3().min(grid.volume_dims()) }
}

/// Empty, at the owned box's low corner, where there is no core.
fn core(owned: &OwnedBox) -> OwnedBox {
    let whole = owned.hi / CHUNK_EDGE * CHUNK_EDGE;
    OwnedBox { lo: owned.lo, hi: if whole.cmpgt(owned.lo).all() { whole } else { owned.lo } }
}

/// The inner chunks of a brick's core per axis, half-open.
pub(crate) fn core_chunks(grid: &BrickGrid, brick: BrickIndex) -> [Range<u32>; 3] {
    let core = core(&grid.owned_box(brick));
    std::array::from_fn(|a| core.lo[a] / CHUNK_EDGE..core.hi[a] / CHUNK_EDGE)
}

/// The voxels of a box that are not in another one within it. Both half-open, inside the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shell {
    lo: UVec3,
    hi: UVec3,
    inner_lo: UVec3,
    /// `inner_lo` where nothing is left out.
    inner_hi: UVec3,
}

impl Shell {
    /// Voxels of the shell.
    pub(crate) fn voxels(&self) -> u64 {
        let count = |d: UVec3| d.as_u64vec3().element_product();
        count(self.hi - self.lo) - count(self.inner_hi - self.inner_lo)
    }

    pub(crate) fn planes(&self) -> Range<u32> {
        self.lo.z..self.hi.z
    }

    /// Calls `take` with each of [`Shell::runs`], whose ways of going on from one to the next are not those of an
    /// iterator: most runs are a voxel or two.
    #[inline(always)]
    pub(crate) fn each_run(self, z: u32, mut take: impl FnMut(u32, Range<u32>)) {
        let of_inner = (self.inner_lo.z..self.inner_hi.z).contains(&z);
        for y in self.lo.y..self.hi.y {
            if of_inner && (self.inner_lo.y..self.inner_hi.y).contains(&y) {
                let runs = [self.lo.x..self.inner_lo.x, self.inner_hi.x..self.hi.x];
                runs.into_iter().filter(|run| !run.is_empty()).for_each(|run| take(y, run));
            } else if self.lo.x < self.hi.x {
                take(y, self.lo.x..self.hi.x);
            }
        }
    }

    /// The runs of voxels of the plane `z`, one of [`Shell::planes`], in the order of the record: y, and where along x.
    pub(crate) fn runs(self, z: u32) -> impl Iterator<Item = (u32, Range<u32>)> {
        let of_inner = (self.inner_lo.z..self.inner_hi.z).contains(&z);
        let rows = self.lo.y..self.hi.y;
        rows.flat_map(move |y| {
            let runs = if of_inner && (self.inner_lo.y..self.inner_hi.y).contains(&y) {
                [self.lo.x..self.inner_lo.x, self.inner_hi.x..self.hi.x]
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
    use crate::store::halo::reach::{REGION_HALO, VOXEL_HALO};
    use proptest::prelude::*;

    #[test]
    fn margins_are_served_by_the_records_up_to_them() {
        let serving = |reach: HaloReach| [0, 1, 2, 3, 5, 6].map(|margin| reach.serving(margin));
        assert_eq!(serving(VOXEL_HALO), [None, Some(1), Some(2), Some(3), None, None]);
        assert_eq!(serving(REGION_HALO), [None, Some(1), Some(1), Some(2), Some(4), None]);
        for reach in [VOXEL_HALO, REGION_HALO] {
            assert_eq!(reach.layer(reach.records() - 1), reach.last);
        }
    }

    proptest! {
        /// A voxel that none holds is missing in pictures, one that two hold is decoded twice.
        #[test]
        fn core_and_shells_hold_each_voxel_of_the_grown_box_once(
            dims in [1_u32..90, 1_u32..90, 1_u32..90], size in 4_u32..8, first in 1_u32..3, more in 0_u32..4,
            nth in any::<prop::sample::Index>(),
        ) {
            let grid = BrickGrid::new(UVec3::from(dims), 1 << size).unwrap();
            let brick = grid.bricks().nth(nth.index(grid.brick_count() as usize)).unwrap();
            let (owned, reach) = (grid.owned_box(brick), HaloReach { first, last: first + more });
            let mut held = std::collections::BTreeSet::new();
            let [xs, ys, zs] = core_chunks(&grid, brick).map(|c| c.start * CHUNK_EDGE..c.end * CHUNK_EDGE);
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        held.insert([x, y, z]);
                        let p = UVec3::new(x, y, z);
                        prop_assert!(p.cmpge(owned.lo).all() && p.cmplt(owned.hi).all(), "not owned: {p}");
                    }
                }
            }
            for nth in 0..reach.records() {
                let (shell, before) = (reach.shell(&grid, brick, nth), held.len() as u64);
                for z in shell.planes() {
                    for (y, xs) in shell.runs(z) {
                        for x in xs {
                            prop_assert!(held.insert([x, y, z]), "twice: {x} {y} {z}");
                        }
                    }
                }
                prop_assert_eq!(held.len() as u64 - before, shell.voxels());
                let grown = owned.stored(reach.layer(nth));
                let inside = |p: &[u32; 3]| (0..3).all(|a| {
                    (grown.lo[a]..grown.hi[a]).contains(&(p[a] as i32)) && p[a] < dims[a]
                });
                prop_assert!(held.iter().all(inside));
                let cut = (grown.hi.min(UVec3::from(dims).as_ivec3()) - grown.lo.max(IVec3::ZERO)).as_u64vec3();
                prop_assert_eq!(held.len() as u64, cut.element_product());
            }
        }
    }
}

//! Components of equal window label, 6-connected, found slab by slab from the last planes to the first: memory holds
//! the nodes of one slab, the components that cross its first plane, and those that are kept.
//!
//! Every slab leaves a *record*: what became of each of its nodes. Most are dropped when their component ends without a
//! leap voxel; those of components that go on say "see the next slab", the one below, which [`resolve`] answers as a
//! pass goes from the first planes to the last. A component's root is its smallest voxel index, so labels in the order
//! of roots depend on nothing but voxels.

use std::ops::Range;

use rayon::prelude::*;

use super::block::{BlockNodes, BlockSpace, CodeTables, Part, Slab};
use super::runs::{BLOCK_EDGE, find, join};
use super::table::{NO_REGION, Region, RegionTable};

/// What became of a node: 0 dropped, 1 + n the n-th kept component, with this bit the n-th that the next slab goes on
/// with.
const OPEN: u32 = 1 << 31;

/// Fates of all nodes of a slab, first those that came from the slab before, the one above.
#[derive(Debug)]
pub(crate) struct Record {
    pub(crate) fates: Vec<u32>,
    pub(crate) layout: RecordLayout,
}

/// Where in a record a block's nodes are.
#[derive(Debug, Clone)]
pub(crate) struct RecordLayout {
    /// Nodes that came from the slab before.
    pub(crate) carried: usize,
    /// First node of each block.
    pub(crate) blocks: Vec<u32>,
    /// Blocks that are one part: nobody needs to find it again.
    pub(crate) whole: Vec<bool>,
}

impl RecordLayout {
    /// A block's nodes among the `all` of its slab.
    pub(crate) fn nodes(&self, block: usize, all: usize) -> Range<u32> {
        self.blocks[block]..self.blocks.get(block + 1).copied().unwrap_or(all as u32)
    }
}

#[derive(Debug)]
pub(crate) struct Components {
    dims: [usize; 3],
    min_region: u64,
    /// Components that cross into the next slab, and which of them each voxel of the first plane belongs to.
    open: Vec<Part>,
    frontier: Vec<u32>,
    /// Components that ended with a leap voxel, in the order of their ends.
    kept: Vec<Part>,
}

impl Components {
    /// Components of fewer than `min_region` voxels are dropped as they end.
    pub(crate) fn new(dims: [usize; 3], min_region: u64) -> Self {
        Self { dims, min_region, open: Vec::new(), frontier: Vec::new(), kept: Vec::new() }
    }

    /// Takes the next slab; slabs come from the last to the first, each [`BLOCK_EDGE`] planes but for the last.
    pub(crate) fn add(&mut self, slab: &Slab<'_>, tables: &CodeTables) -> Record {
        let [bx, by] = slab.blocks();
        let mut blocks: Vec<BlockNodes> = (0..bx * by)
            .into_par_iter()
            .map_init(BlockSpace::default, |space, i| space.find(slab, i, tables))
            .collect();
        let mut parts = std::mem::take(&mut self.open);
        let carried = parts.len();
        let mut starts = Vec::with_capacity(blocks.len());
        parts.reserve_exact(blocks.iter().map(|b| b.nodes.len()).sum());
        for block in &mut blocks {
            starts.push(parts.len() as u32);
            // Frees the block's: in noise they are most of what a slab holds.
            parts.append(&mut std::mem::take(&mut block.nodes));
        }
        let mut parents: Vec<u32> = (0..parts.len() as u32).collect();
        let mut joiner = Joiner { parts: &parts, parents: &mut parents, last: None };
        for (i, block) in blocks.iter().enumerate() {
            let start = starts[i];
            for (axis, there) in [(0, i + 1), (1, i + bx)] {
                let here = &block.faces[axis][1];
                // The other block's low face is empty only where this block's high face is.
                let other = blocks.get(there).map_or(&[][..], |b| &b.faces[axis][0]);
                for (a, b) in here.iter().zip(other) {
                    joiner.meet(start + a, starts[there] + b);
                }
            }
            let (lo, size) = slab.block(i);
            for (y, row) in block.faces[2][1].chunks_exact(size[0]).enumerate() {
                let above = &self.frontier[(lo[1] + y) * self.dims[0] + lo[0]..][..size[0]];
                above.iter().zip(row).for_each(|(a, b)| joiner.meet(*a, start + b));
            }
        }
        for node in 0..parts.len() {
            let root = find(&mut parents, node as u32) as usize;
            if root != node {
                let part = parts[node];
                parts[root].merge(&part);
            }
        }
        let fates = self.end(slab, &blocks, &starts, &parts, &mut parents);
        let whole = blocks.iter().map(|block| block.is_whole).collect();
        Record { fates, layout: RecordLayout { carried, blocks: starts, whole } }
    }

    /// Carries what crosses the first plane, keeps or drops the rest.
    fn end(
        &mut self,
        slab: &Slab<'_>,
        blocks: &[BlockNodes],
        starts: &[u32],
        parts: &[Part],
        parents: &mut [u32],
    ) -> Vec<u32> {
        const UNKNOWN: u32 = u32::MAX;
        let mut fates = vec![UNKNOWN; parts.len()];
        let goes_on = slab.z0 > 0;
        self.frontier.clear();
        if goes_on {
            self.frontier.resize(self.dims[0] * self.dims[1], 0);
        }
        for (i, (block, start)) in blocks.iter().zip(starts).enumerate() {
            let (lo, size) = slab.block(i);
            for (y, row) in block.faces[2][0].chunks_exact(size[0]).enumerate() {
                let out = &mut self.frontier[(lo[1] + y) * self.dims[0] + lo[0]..][..size[0]];
                for (out, node) in out.iter_mut().zip(row) {
                    let root = find(parents, start + node) as usize;
                    if fates[root] == UNKNOWN {
                        fates[root] = OPEN | self.open.len() as u32;
                        self.open.push(parts[root]);
                    }
                    *out = fates[root] & !OPEN;
                }
            }
        }
        for node in 0..parts.len() {
            let root = find(parents, node as u32) as usize;
            if fates[root] == UNKNOWN {
                let part = &parts[root];
                let keep = part.leaps > 0 && part.voxels >= self.min_region;
                if keep {
                    self.kept.push(*part);
                }
                fates[root] = if keep { self.kept.len() as u32 } else { 0 };
            }
            fates[node] = fates[root];
        }
        fates
    }

    /// How many components were kept so far.
    pub(crate) fn kept(&self) -> usize {
        self.kept.len()
    }

    /// The components that were kept, once all slabs were added; fates count them from 1.
    pub(crate) fn finish(self) -> Vec<Part> {
        self.kept
    }
}

/// Replaces what a record leaves to the next slab by that slab's answers (none for the first planes' slab).
pub(crate) fn resolve(fates: &mut [u32], answers: &[u32]) {
    for fate in fates.iter_mut().filter(|fate| **fate & OPEN != 0) {
        *fate = answers[(*fate & !OPEN) as usize];
    }
}

/// Joins the components that meet, and asks only once where two meet along a face.
struct Joiner<'a> {
    parts: &'a [Part],
    parents: &'a mut [u32],
    last: Option<(u32, u32)>,
}

impl Joiner<'_> {
    fn meet(&mut self, a: u32, b: u32) {
        if self.last == Some((a, b)) {
            return;
        }
        self.last = Some((a, b));
        if self.parts[a as usize].window == self.parts[b as usize].window {
            join(self.parents, a, b);
        }
    }
}

/// Regions of at least `min_region` voxels in the order of their roots, and for each kept component its label.
pub(crate) fn numbered(kept: &[Part], min_region: u64) -> (RegionTable, Vec<u32>) {
    let mut order: Vec<usize> = (0..kept.len()).filter(|k| kept[*k].voxels >= min_region).collect();
    order.par_sort_unstable_by_key(|k| kept[*k].root);
    let mut labels = vec![NO_REGION; kept.len()];
    let regions = order.iter().zip(1..).map(|(&k, label)| {
        labels[k] = label;
        let Part { root, voxels, sum, min, max, .. } = kept[k];
        Region { root, voxels, sum, min, max }
    });
    (RegionTable(regions.collect()), labels)
}

/// Planes of a slab.
pub(crate) const SLAB_PLANES: u32 = BLOCK_EDGE as u32;

//! What is drawn in the place of each cell.

use glam::{DVec4, UVec3};

use super::blocks::{Blocks, Row};
use crate::brick::OwnedBox;
use crate::ids::{ChunkId, ChunkIndex};
use crate::lod::borders::{Borders, Sides};
use crate::merge::MergeTree;
use crate::store::{BrickRanges, MeanRanges};

/// What is known of a level's voxels.
#[derive(Debug)]
pub(super) struct OfLevel {
    pub(super) level: u8,
    pub(super) tree: MergeTree,
    pub(super) means: MeanRanges,
}

impl DrawnBlock {
    /// Do some of the level's voxels in it take a coarser level's values?
    fn takes_coarser(&self, voxels: &OwnedBox) -> bool {
        let (lo, hi) = (voxels.lo.cmpeq(self.own.lo), voxels.hi.cmpeq(self.own.hi));
        // Inside, no place around is a neighbour's.
        let is_outermost = !self.coarser.is_empty() && (lo | hi).any();
        is_outermost && !self.coarser.within(lo.into(), hi.into()).is_empty()
    }
}

impl OfLevel {
    /// What is drawn in the blocks of a chunk; the level is at `place` of those that may be drawn.
    fn drawn(&self, place: usize, chunk: ChunkId, borders: Option<&Borders>) -> Option<DrawnBlock> {
        let own = chunk_box(&self.tree, self.tree.chunk_at(chunk)?);
        let coarser = borders.and_then(|borders| borders.of_chunk(chunk)).unwrap_or_default().coarser;
        Some(DrawnBlock { level: self.level, place, own, coarser })
    }
}

/// What is drawn in a cell of the finest level.
#[derive(Debug, Clone, Copy)]
pub(super) struct Drawn {
    pub(super) codes: [u16; 2],
    /// By the finest voxels, as they are.
    pub(super) as_it_is: bool,
}

/// What is drawn in all cells of a block, but for those that clips leave nothing of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DrawnBlock {
    pub(super) level: u8,
    /// Of the levels that may be drawn.
    place: usize,
    /// The chunk, in the level's voxels, and where a coarser level is drawn around it.
    own: OwnedBox,
    coarser: Sides,
}

/// What is known of a volume and what leaves nothing of it in a look, whatever is drawn.
#[derive(Debug)]
pub(super) struct Facts {
    pub(super) finest: MeanRanges,
    /// Of the finest level's index space: what clips leave lies above all of them.
    pub(super) clips: Vec<DVec4>,
    pub(super) levels: Vec<OfLevel>,
}

impl Facts {
    /// By block; nothing where nothing is drawn.
    pub(super) fn drawn<'a>(
        &self,
        blocks: &Blocks,
        chunks: impl Fn(u8, ChunkId) -> bool,
        borders: impl Fn(u8) -> Option<&'a Borders>,
    ) -> Vec<Option<DrawnBlock>> {
        let mut all = vec![None; blocks.count()];
        for (place, of) in self.levels.iter().enumerate() {
            let borders = borders(of.level);
            for id in of.tree.chunk_ids().filter(|id| chunks(of.level, *id)) {
                let Some(drawn) = of.drawn(place, id, borders) else { continue };
                let own = &drawn.own;
                let finest = OwnedBox { lo: own.lo << u32::from(of.level), hi: own.hi << u32::from(of.level) };
                blocks.within(&finest).for_each(|block| all[block] = Some(drawn));
            }
        }
        all
    }

    #[cfg(test)]
    pub(super) fn drawn_block(&self, level: u8, chunk: ChunkId, borders: Option<&Borders>) -> Option<DrawnBlock> {
        let place = self.levels.iter().position(|of| of.level == level)?;
        self.levels[place].drawn(place, chunk, borders)
    }

    /// In each cell of a row of a block.
    pub(super) fn drawn_in(&self, block: &DrawnBlock, row: &Row, mut draw: impl FnMut(usize, Option<Drawn>)) {
        let (of, cells) = (&self.levels[block.place], self.finest.cells());
        let (level, means, last) = (u32::from(of.level), of.means.cells(), cells.dims());
        for (place, at) in row.cells() {
            let lo = at * cells.edge();
            let voxels = OwnedBox { lo, hi: (lo + cells.edge()).min(last) };
            if self.is_clipped(&voxels) {
                draw(place, None);
                continue;
            }
            let at = OwnedBox { lo: voxels.lo >> level, hi: (voxels.hi + (1 << level) - 1) >> level };
            let codes = of.means.ranges()[means.place(at.lo)];
            draw(
                place,
                Some(match block.takes_coarser(&at) {
                    false => Drawn { codes, as_it_is: of.level == 0 },
                    true => Drawn { codes: self.taken(of.level + 1, &at, codes), as_it_is: false },
                }),
            );
        }
    }

    /// The codes of voxels some of which take the next coarser level's values: those between their own and all from
    /// which these are interpolated.
    fn taken(&self, coarser: u8, voxels: &OwnedBox, own: [u16; 2]) -> [u16; 2] {
        let Some(next) = self.levels.iter().find(|next| next.level == coarser) else { return [0, u16::MAX] };
        let near =
            OwnedBox { lo: (voxels.lo / 2).saturating_sub(UVec3::ONE), hi: voxels.hi.map(|v| v.div_ceil(2)) + 1 };
        next.means.cells().around(&near).map(|place| next.means.ranges()[place]).fold(own, around)
    }

    pub(super) fn is_clipped(&self, voxels: &OwnedBox) -> bool {
        let (lo, hi) = (voxels.lo.as_dvec3(), voxels.hi.as_dvec3());
        let most = |plane: &DVec4| (plane.truncate() * lo).max(plane.truncate() * hi).element_sum();
        self.clips.iter().any(|plane| most(plane) < plane.w)
    }

    /// From a cell to those around in which a level draws another voxel, in cells.
    pub(super) fn step(&self, level: u8) -> u32 {
        ((1 << level) / self.finest.cells().edge()).max(1)
    }

    /// How far from a cell those are at most that it is judged by.
    pub(super) fn reach(&self, level: u8) -> u32 {
        2 * self.step(level)
    }
}

/// The voxels of a level's chunk.
fn chunk_box(tree: &MergeTree, chunk: ChunkIndex) -> OwnedBox {
    let edge = tree.chunk_bricks() * tree.grid().brick_size();
    let lo = UVec3::from(chunk.0) * edge;
    OwnedBox { lo, hi: (lo + edge).min(tree.grid().volume_dims()) }
}

fn around(a: [u16; 2], b: [u16; 2]) -> [u16; 2] {
    if b == BrickRanges::NONE { a } else { [a[0].min(b[0]), a[1].max(b[1])] }
}

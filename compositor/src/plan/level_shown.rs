//! What one level draws of a picture of several.

use std::collections::{BTreeMap, BTreeSet};

use brickcast_proto::LevelPart;
use brickcast_volume::lod::{Borders, Selection};
use brickcast_volume::merge::MergeTree;
use brickcast_volume::{BrickId, BrickIndex, ChunkId, ChunkIndex, Geometry, StoreHash};

use super::shown::{Shown, StoreFacts};

/// A level's part of what is shown.
#[derive(Debug, Clone)]
pub struct LevelShown {
    pub level: u8,
    /// The level's own.
    pub store: StoreHash,
    pub geometry: Geometry,
    pub(super) tree: MergeTree,
    /// Per brick of the level, x fastest: true where it is drawn and shows something.
    pub(super) bricks: Vec<bool>,
    /// By the first chunk of the finest level in them, the level's chunks that show something.
    pub(super) chunks: BTreeMap<ChunkId, ChunkIndex>,
    borders: Option<Borders>,
}

impl LevelShown {
    /// What a level draws of a selection; nothing where none of its bricks shows anything.
    pub(super) fn new(selection: &Selection, level: u8, (store, shown): (&StoreFacts, &Shown)) -> Option<Self> {
        let (levels, part) = (selection.levels(), selection.part(level));
        let (tree, finest) = (shown.tree, levels.finest());
        let shows = |id: ChunkId| part.drawn.get(id) == Some(&true) && shown.per_chunk[id] > 0;
        let chunk = |id: ChunkId| {
            let chunk = tree.chunk_at(id).filter(|_| shows(id))?;
            Some((finest.chunk_id(levels.under(level, chunk).next()?), chunk))
        };
        let chunks: BTreeMap<ChunkId, ChunkIndex> = tree.chunk_ids().filter_map(chunk).collect();
        let is_drawn = |brick| shows(tree.chunk_id(tree.chunk_of(brick)));
        let bricks = tree.grid().bricks().zip(&shown.bricks).map(|(brick, &shown)| shown && is_drawn(brick)).collect();
        let borders = Borders::of(&tree, &part);
        let (store, geometry) = (store.hash, store.manifest.geometry);
        (!chunks.is_empty()).then_some(Self { level, store, geometry, tree, bricks, chunks, borders })
    }

    /// The level's chunks that are drawn where some of the finest level's chunks are.
    #[must_use]
    pub fn chunks_in(&self, finest: &BTreeSet<ChunkId>) -> BTreeSet<ChunkId> {
        let in_them = self.chunks.iter().filter(|(chunk, _)| finest.contains(chunk));
        in_them.map(|(_, of_level)| self.tree.chunk_id(*of_level)).collect()
    }

    /// Where it meets other levels.
    #[must_use]
    pub fn borders(&self) -> Option<&Borders> {
        self.borders.as_ref()
    }

    /// Chunks of the level.
    #[must_use]
    pub fn chunk_count(&self) -> usize {
        self.chunks.len()
    }

    #[must_use]
    pub fn brick_count(&self) -> usize {
        self.bricks.iter().filter(|&&shown| shown).count()
    }

    /// Voxels of the level that its shown bricks own.
    #[must_use]
    pub fn voxel_count(&self) -> u64 {
        voxels_of(&self.tree, &self.bricks)
    }

    /// Has a chunk of this level a part of a brick of another, which is no finer?
    pub(super) fn lies_in(&self, chunk: ChunkIndex, (brick, level): (BrickIndex, u8)) -> bool {
        let (edge, ratio) = (self.tree.chunk_bricks(), 1 << (level - self.level));
        let met = |(chunk, brick): (u32, u32)| chunk * edge < (brick + 1) * ratio && brick * ratio < (chunk + 1) * edge;
        chunk.0.into_iter().zip(brick.0).all(met)
    }

    /// The shown bricks of what this level draws in a chunk of the finest level.
    pub(super) fn bricks_of(&self, chunk: ChunkId) -> impl Iterator<Item = BrickIndex> + '_ {
        let bricks = self.chunks.get(&chunk).into_iter().flat_map(|of_level| self.tree.bricks_of(*of_level));
        bricks.filter(|b| self.bricks[self.tree.grid().id(*b).index()])
    }

    /// The shown bricks of what this level draws in some chunks of the finest level, in the grid's order.
    #[must_use]
    pub fn bricks_in(&self, chunks: &[ChunkId]) -> Vec<BrickId> {
        let all = chunks.iter().flat_map(|chunk| self.bricks_of(*chunk));
        let mut bricks: Vec<BrickId> = all.map(|brick| self.tree.grid().id(brick)).collect();
        bricks.sort_unstable();
        bricks
    }

    /// What an order of some of the finest level's chunks says of this level.
    pub(super) fn order(&self, wanted: &BTreeSet<ChunkId>) -> Option<LevelPart> {
        let mine = || self.chunks.iter().filter(|(chunk, _)| wanted.contains(chunk));
        let chunks: Vec<ChunkId> = mine().map(|(chunk, _)| *chunk).collect();
        let of_level = mine().map(|(_, of_level)| self.tree.chunk_id(*of_level));
        let borders = self.borders.as_ref().and_then(|borders| borders.only(of_level));
        (!chunks.is_empty()).then_some(LevelPart { level: self.level, store: self.store, chunks, borders })
    }
}

/// Voxels that shown bricks own.
pub(super) fn voxels_of(tree: &MergeTree, bricks: &[bool]) -> u64 {
    let grid = tree.grid();
    let shown = grid.bricks().zip(bricks).filter(|(_, shown)| **shown);
    shown.map(|(brick, _)| grid.owned_box(brick).voxel_count()).sum()
}

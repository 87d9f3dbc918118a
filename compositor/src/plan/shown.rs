//! Which bricks have something to show, whatever the view.

use std::collections::BTreeSet;
use std::sync::Arc;

use brickcast_proto::{LevelPart, UnreadableBrick};
use brickcast_volume::lod::Selection;
use brickcast_volume::look_on::{BricksOf, LookOn, NewTables};
use brickcast_volume::merge::MergeTree;
use brickcast_volume::regions::{BrickFacts, Drawn};
use brickcast_volume::scene::Scene;
use brickcast_volume::store::{BrickRanges, CellRanges, Manifest, MeanRanges, Store};
use brickcast_volume::{BrickId, BrickIndex, ChunkId, ChunkIndex, OwnedBox, PerChunk, StoreHash};

use super::level_shown::{LevelShown, voxels_of};

/// A store as the compositor knows it: no voxels, only what planning needs.
#[derive(Debug, Clone)]
pub struct StoreFacts {
    pub hash: StoreHash,
    pub manifest: Manifest,
    pub ranges: BrickRanges,
    /// What the store says of its regions, per brick; nothing where it has none.
    pub facts: Option<Vec<BrickFacts>>,
    /// The volume seen from afar: its cells, or its bricks where the store is older than cells.
    pub cells: CellRanges,
    /// What its own voxels are, cell by cell; nothing in stores older than that.
    pub means: Option<MeanRanges>,
}

impl StoreFacts {
    /// Of a store that is open here.
    #[must_use]
    pub fn of(store: &Store) -> Self {
        let facts = store.brick_facts().map(<[_]>::to_vec);
        let tables = (store.brick_ranges().clone(), store.cell_ranges().cloned(), store.mean_ranges().cloned());
        Self::new(store.hash(), store.manifest().clone(), tables, facts)
    }

    /// From what a store says; `cells` and `means` are missing in older ones.
    #[must_use]
    pub fn new(
        hash: StoreHash,
        manifest: Manifest,
        (ranges, cells, means): (BrickRanges, Option<CellRanges>, Option<MeanRanges>),
        facts: Option<Vec<BrickFacts>>,
    ) -> Self {
        let cells = cells.unwrap_or_else(|| CellRanges::of_bricks(&manifest, &ranges));
        Self { hash, manifest, ranges, facts, cells, means }
    }

    #[must_use]
    pub fn tree(&self) -> MergeTree {
        MergeTree::of(self.manifest.grid)
    }

    /// What is known of its bricks.
    #[must_use]
    pub fn bricks(&self) -> BricksOf<'_> {
        BricksOf { manifest: &self.manifest, ranges: &self.ranges.0, facts: self.facts.as_deref() }
    }
}

/// The bricks that the transfer function shows, whatever the view, and the chunks that hold them.
#[derive(Debug, Clone)]
pub struct Shown {
    pub(super) tree: MergeTree,
    /// Per brick, x fastest: true where its stored box has opacity somewhere.
    pub(super) bricks: Vec<bool>,
    /// How many of its bricks are shown.
    pub(super) per_chunk: PerChunk<u32>,
    /// The smallest box of voxels around them.
    pub(super) boxes: PerChunk<Option<OwnedBox>>,
    /// What of it is shown on which level of the volume; nothing where all is on this one.
    parts: Option<Arc<[LevelShown]>>,
}

/// Of every brick, x fastest: how it is drawn, and whether it has regions; nothing where it shows nothing.
pub(crate) fn drawn_in_scene(store: &StoreFacts, scene: &Scene) -> Vec<Option<(Drawn, bool)>> {
    let look = LookOn::new(scene, store.bricks(), &NewTables);
    let of_brick = |brick| {
        let brick = look.of(brick);
        Some((brick.drawn?, brick.has_regions()))
    };
    store.manifest.grid.bricks().map(of_brick).collect()
}

impl Shown {
    /// The bricks that a scene's transfer function shows, by the very table that the kernels read.
    #[must_use]
    pub fn in_scene(store: &StoreFacts, scene: &Scene) -> Self {
        Self::of(store.tree(), drawn_in_scene(store, scene).iter().map(Option::is_some).collect())
    }

    /// `bricks` says of each brick, x fastest, whether it is shown.
    pub(super) fn of(tree: MergeTree, bricks: Vec<bool>) -> Self {
        let mut per_chunk = PerChunk::filled(0, tree.chunk_count() as usize);
        let mut boxes: PerChunk<Option<OwnedBox>> = PerChunk::filled(None, per_chunk.count());
        for brick in tree.grid().bricks().filter(|b| bricks[tree.grid().id(*b).index()]) {
            let chunk = tree.chunk_id(tree.chunk_of(brick));
            let owned = tree.grid().owned_box(brick);
            per_chunk[chunk] += 1;
            boxes[chunk] =
                Some(boxes[chunk].map_or(owned, |b| OwnedBox { lo: b.lo.min(owned.lo), hi: b.hi.max(owned.hi) }));
        }
        Self { tree, bricks, per_chunk, boxes, parts: None }
    }

    /// What is shown of several levels, each chunk on the one that is selected; `levels` has each level's store and
    /// what is shown of it, the finest first. A chunk of a coarser level is shown in the first of this level's chunks
    /// in it.
    #[must_use]
    pub fn of_levels(selection: &Selection, levels: &[(&StoreFacts, &Self)]) -> Self {
        let tree = *selection.levels().finest();
        let mut all = Self::of(tree, vec![false; tree.grid().brick_count() as usize]);
        let part = |level: u8| {
            let (store, shown) = levels.get(usize::from(level))?;
            LevelShown::new(selection, level, (*store, *shown))
        };
        let parts: Vec<LevelShown> = selection.used().filter_map(part).collect();
        for (part, (chunk, of_level)) in parts.iter().flat_map(|part| part.chunks.iter().map(move |c| (part, c))) {
            let Some((_, shown)) = levels.get(usize::from(part.level)) else { continue };
            let of_level = shown.tree.chunk_id(*of_level);
            all.per_chunk[*chunk] = shown.per_chunk[of_level];
            let scale = 1 << part.level;
            let last = tree.grid().volume_dims();
            let finest = |voxels: OwnedBox| OwnedBox { lo: voxels.lo * scale, hi: (voxels.hi * scale).min(last) };
            all.boxes[*chunk] = shown.boxes[of_level].map(finest);
        }
        if let Some(finest) = parts.iter().find(|part| part.level == 0) {
            all.bricks.clone_from(&finest.bricks);
        }
        Self { parts: Some(parts.into()), ..all }
    }

    /// What is shown on which level, where there are several.
    #[must_use]
    pub fn parts(&self) -> Option<&[LevelShown]> {
        self.parts.as_deref()
    }

    /// What an order of some chunks says of levels.
    #[must_use]
    pub fn parts_of(&self, chunks: impl Iterator<Item = ChunkId>) -> Vec<LevelPart> {
        let Some(parts) = self.parts() else { return Vec::new() };
        let wanted: BTreeSet<ChunkId> = chunks.collect();
        parts.iter().filter_map(|part| part.order(&wanted)).collect()
    }

    /// The chunks that are shown and cannot be without a brick of `own`, the store that this is of, or of a level: it
    /// is in them, or is what they meet a coarser level by.
    #[must_use]
    pub fn needing(&self, own: StoreHash, brick: UnreadableBrick) -> Vec<ChunkId> {
        let Some(parts) = self.parts() else {
            let in_it = Some(brick).filter(|brick| brick.store == own).and_then(|brick| index_in(&self.tree, brick));
            return in_it.map(|brick| self.tree.chunk_id(self.tree.chunk_of(brick))).into_iter().collect();
        };
        let Some(of) = parts.iter().find(|part| part.store == brick.store) else { return Vec::new() };
        let Some(index) = index_in(&of.tree, brick) else { return Vec::new() };
        let finer = parts.iter().filter(|part| part.level <= of.level);
        let chunks = finer.flat_map(|part| {
            let needs = move |chunk: &ChunkIndex| part.lies_in(*chunk, (index, of.level));
            part.chunks.iter().filter(move |(_, chunk)| needs(chunk)).map(|(finest, _)| *finest)
        });
        chunks.collect()
    }

    /// Of all levels.
    #[must_use]
    pub fn brick_count(&self) -> usize {
        self.per_chunk.values().map(|&bricks| bricks as usize).sum()
    }

    /// Voxels that its shown bricks own, all of this level.
    #[must_use]
    pub fn voxel_count(&self) -> u64 {
        voxels_of(&self.tree, &self.bricks)
    }

    /// Cuts `chunks` into `runs` contiguous runs with nearly equal numbers of shown bricks: each chunk and its run.
    pub(super) fn runs(&self, chunks: &[ChunkId], runs: usize) -> Vec<(ChunkId, usize)> {
        let weight = |c: ChunkId| u64::from(self.per_chunk[c]);
        let total = chunks.iter().map(|&c| weight(c)).sum::<u64>().max(1);
        let mut before = 0;
        let run = |&chunk: &ChunkId| {
            let w = weight(chunk);
            // The run that the chunk's middle falls into; doubled to stay in integers.
            let run = (2 * before + w) * runs as u64 / (2 * total);
            before += w;
            (chunk, (run as usize).min(runs.saturating_sub(1)))
        };
        chunks.iter().map(run).collect()
    }

    /// How many bricks of each chunk are shown.
    #[must_use]
    pub fn per_chunk(&self) -> &PerChunk<u32> {
        &self.per_chunk
    }

    #[must_use]
    pub fn tree(&self) -> MergeTree {
        self.tree
    }

    /// The shown bricks of `chunks`, in the grid's order; of several levels those of this one.
    #[must_use]
    pub fn bricks_in(&self, chunks: &[ChunkId]) -> Vec<BrickId> {
        let of = |&chunk: &ChunkId| self.tree.chunk_at(chunk).map(|c| self.bricks_of(c).collect::<Vec<_>>());
        let all = chunks.iter().filter_map(of).flatten();
        let mut bricks: Vec<BrickId> = all.map(|b| self.tree.grid().id(b)).collect();
        bricks.sort_unstable();
        bricks
    }

    /// The shown bricks of a chunk.
    pub fn bricks_of(&self, chunk: ChunkIndex) -> impl Iterator<Item = BrickIndex> + '_ {
        self.tree.bricks_of(chunk).filter(|b| self.bricks[self.tree.grid().id(*b).index()])
    }
}

/// Nothing where the grid has no such brick.
fn index_in(tree: &MergeTree, brick: UnreadableBrick) -> Option<BrickIndex> {
    let grid = tree.grid();
    ((brick.brick.index() as u64) < grid.brick_count()).then(|| grid.index_of(brick.brick))
}

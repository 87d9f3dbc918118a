//! Which bricks have something to show, whatever the view.

use std::sync::Arc;

use brickcast_volume::lod::{Borders, Part};
use brickcast_volume::look_on::{BricksOf, LookOn, NewTables};
use brickcast_volume::merge::MergeTree;
use brickcast_volume::regions::{BrickFacts, Drawn};
use brickcast_volume::scene::Scene;
use brickcast_volume::store::{BrickRanges, CellRanges, Manifest, Store};
use brickcast_volume::{BrickId, BrickIndex, ChunkId, ChunkIndex, OwnedBox, PerChunk};

/// A store as the compositor knows it: no voxels, only what planning needs.
#[derive(Debug, Clone)]
pub struct StoreFacts {
    pub hash: brickcast_volume::StoreHash,
    pub manifest: Manifest,
    pub ranges: BrickRanges,
    /// What the store says of its regions, per brick; nothing where it has none.
    pub facts: Option<Vec<BrickFacts>>,
    /// The volume seen from afar: its cells, or its bricks where the store is older than cells.
    pub cells: CellRanges,
}

impl StoreFacts {
    /// Of a store that is open here.
    #[must_use]
    pub fn of(store: &Store) -> Self {
        let facts = store.brick_facts().map(<[_]>::to_vec);
        let tables = (store.brick_ranges().clone(), store.cell_ranges().cloned());
        Self::new(store.hash(), store.manifest().clone(), tables, facts)
    }

    /// From what a store says; `cells` are missing in older ones.
    #[must_use]
    pub fn new(
        hash: brickcast_volume::StoreHash,
        manifest: Manifest,
        (ranges, cells): (BrickRanges, Option<CellRanges>),
        facts: Option<Vec<BrickFacts>>,
    ) -> Self {
        let cells = cells.unwrap_or_else(|| CellRanges::of_bricks(&manifest, &ranges));
        Self { hash, manifest, ranges, facts, cells }
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
    bricks: Vec<bool>,
    /// How many of its bricks are shown.
    pub(super) per_chunk: PerChunk<u32>,
    /// The smallest box of voxels around them.
    pub(super) boxes: PerChunk<Option<OwnedBox>>,
    /// Chunks in which another level of the volume is drawn; nothing where this is all of it.
    pub(super) elsewhere: Option<Arc<PerChunk<bool>>>,
    /// Where it meets them.
    borders: Option<Arc<Borders>>,
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
        Self { tree, bricks, per_chunk, boxes, elsewhere: None, borders: None }
    }

    /// What is shown where only a part of the volume is drawn on this level.
    #[must_use]
    pub fn only(&self, part: &Part) -> Self {
        let grid = self.tree.grid();
        let is_drawn = |brick| part.drawn.get(self.tree.chunk_id(self.tree.chunk_of(brick))) == Some(&true);
        let bricks = grid.bricks().zip(&self.bricks).map(|(brick, &shown)| shown && is_drawn(brick)).collect();
        let borders = Borders::of(&self.tree, part).map(Arc::new);
        Self { elsewhere: Some(Arc::new(part.elsewhere.clone())), borders, ..Self::of(self.tree, bricks) }
    }

    /// Where it meets other levels of the volume; nothing where all of it is drawn.
    #[must_use]
    pub fn borders(&self) -> Option<&Borders> {
        self.borders.as_deref()
    }

    #[must_use]
    pub fn brick_count(&self) -> usize {
        self.bricks.iter().filter(|&&shown| shown).count()
    }

    /// Voxels that its shown bricks own.
    #[must_use]
    pub fn voxel_count(&self) -> u64 {
        let grid = self.tree.grid();
        let shown = grid.bricks().zip(&self.bricks).filter(|(_, shown)| **shown);
        shown.map(|(brick, _)| grid.owned_box(brick).voxel_count()).sum()
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

    /// The shown bricks of `chunks`, in the grid's order.
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

//! The plan: which bricks have something to show, who renders which chunk, and what each node is ordered to do.
//!
//! A plan changes nothing in the picture: chunks are joined at the canonical merge tree's nodes whoever renders them.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use brickcast_proto::{LayerOrder, TileRect};
use brickcast_volume::merge::MergeTree;
use brickcast_volume::regions::{BrickFacts, SceneTables, drawn};
use brickcast_volume::scene::Scene;
use brickcast_volume::store::{BrickRanges, Manifest};
use brickcast_volume::transfer_function::TransferTable;
use brickcast_volume::{BrickIndex, ChunkIndex, PixelRect, View};
use glam::UVec2;

/// A store as the compositor knows it: no voxels, only what planning needs.
#[derive(Debug, Clone)]
pub struct StoreFacts {
    pub hash: brickcast_volume::StoreHash,
    pub manifest: Manifest,
    pub ranges: BrickRanges,
    /// What the store says of its regions, per brick; nothing where it has none.
    pub facts: Option<Vec<BrickFacts>>,
}

impl StoreFacts {
    #[must_use]
    pub fn tree(&self) -> MergeTree {
        MergeTree::of(self.manifest.grid)
    }
}

/// The bricks that the transfer function shows, whatever the view, and the chunks that hold them.
#[derive(Debug, Clone)]
pub struct Shown {
    tree: MergeTree,
    /// Per brick, x fastest: true where its stored box has opacity somewhere.
    bricks: Vec<bool>,
    /// Per chunk, x fastest: how many of its bricks are shown.
    per_chunk: Vec<u32>,
}

impl Shown {
    /// The bricks that a scene's transfer function shows, by the very table that the kernels read.
    #[must_use]
    pub fn in_scene(store: &StoreFacts, scene: &Scene) -> Self {
        let tree = store.tree();
        let geometry = &store.manifest.geometry;
        let delta = scene.step * geometry.min_spacing();
        let table = |function| TransferTable::build(function, store.manifest.range, delta / scene.opacity_unit);
        let (main, region) = (table(&scene.transfer_function), scene.region_transfer_function.as_ref().map(table));
        let tables = SceneTables { main: &main, region: region.as_ref(), view: scene.region_view };
        let bricks: Vec<bool> = store
            .ranges
            .0
            .iter()
            .zip(tree.grid().bricks())
            .enumerate()
            .map(|(linear, (&raw, brick))| {
                let facts = store.facts.as_ref().and_then(|facts| facts.get(linear));
                drawn(scene, &tables, geometry, &tree.grid().owned_box(brick), raw, facts).is_some()
            })
            .collect();
        let mut per_chunk = vec![0; tree.chunk_count() as usize];
        for brick in tree.grid().bricks().filter(|b| bricks[tree.grid().linear(*b)]) {
            per_chunk[tree.chunk_linear(tree.chunk_of(brick)) as usize] += 1;
        }
        Self { tree, bricks, per_chunk }
    }

    #[must_use]
    pub fn brick_count(&self) -> usize {
        self.bricks.iter().filter(|&&shown| shown).count()
    }

    /// Cuts `chunks` into `runs` contiguous runs with nearly equal numbers of shown bricks: each chunk and its run.
    fn runs(&self, chunks: &[u32], runs: usize) -> Vec<(u32, usize)> {
        let weight = |c: u32| u64::from(self.per_chunk[c as usize]);
        let total = chunks.iter().map(|&c| weight(c)).sum::<u64>().max(1);
        let mut before = 0;
        let run = |&chunk: &u32| {
            let w = weight(chunk);
            // The run that the chunk's middle falls into; doubled to stay in integers.
            let run = (2 * before + w) * runs as u64 / (2 * total);
            before += w;
            (chunk, (run as usize).min(runs.saturating_sub(1)))
        };
        chunks.iter().map(run).collect()
    }

    /// The shown bricks of a chunk.
    pub fn bricks_of(&self, chunk: ChunkIndex) -> impl Iterator<Item = BrickIndex> + '_ {
        self.tree.bricks_of(chunk).filter(|b| self.bricks[self.tree.grid().linear(*b)])
    }
}

/// Who renders which chunk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assignment {
    /// Per chunk, x fastest: position in the list of nodes.
    owner: Vec<usize>,
    nodes: usize,
}

impl Assignment {
    /// Contiguous runs of the merge tree's order (compact in space, so few layers) with nearly equal numbers of shown
    /// bricks. It depends on the store and the transfer function, not on the view: an orbit moves no brick.
    #[must_use]
    pub fn contiguous(shown: &Shown, nodes: usize) -> Self {
        let order = shown.tree.chunks_in_tree_order();
        let mut owner = vec![0; order.len()];
        let linear: Vec<u32> = order.into_iter().map(|c| shown.tree.chunk_linear(c)).collect();
        for (chunk, run) in shown.runs(&linear, nodes) {
            owner[chunk as usize] = run;
        }
        Self { owner, nodes }
    }

    /// An explicit table, e.g. a scattered one in tests: `owner[chunk]` below `nodes`.
    #[must_use]
    pub fn explicit(owner: Vec<usize>, nodes: usize) -> Self {
        Self { owner, nodes }
    }

    /// The same table with the chunks of absent nodes dealt to those that are there; nobody else's move.
    #[must_use]
    pub fn without_absent(mut self, shown: &Shown, present: &[bool]) -> Self {
        let here: Vec<usize> = (0..self.nodes).filter(|&n| present.get(n) == Some(&true)).collect();
        if here.is_empty() {
            return self;
        }
        let order = shown.tree.chunks_in_tree_order().into_iter().map(|c| shown.tree.chunk_linear(c));
        let orphans: Vec<u32> = order.filter(|&c| !here.contains(&self.owner[c as usize])).collect();
        for (chunk, run) in shown.runs(&orphans, here.len()) {
            self.owner[chunk as usize] = here[run];
        }
        self
    }

    /// The node that renders a chunk.
    #[must_use]
    pub fn owner_of(&self, chunk: u32) -> usize {
        self.owner[chunk as usize]
    }

    /// The bricks that `node` must hold: linear brick indices.
    #[must_use]
    pub fn bricks_of(&self, shown: &Shown, node: usize) -> Vec<u32> {
        let tree = shown.tree;
        let mut bricks: Vec<u32> = (0..self.owner.len() as u32)
            .filter(|&c| self.owner[c as usize] == node)
            .filter_map(|c| tree.chunk_at(c))
            .flat_map(|c| shown.bricks_of(c).collect::<Vec<_>>())
            .map(|b| tree.grid().linear(b) as u32)
            .collect();
        bricks.sort_unstable();
        bricks
    }

    /// What each node is ordered to render of `view`; a node may have nothing to do.
    #[must_use]
    pub fn orders(&self, shown: &Shown, view: &View) -> Vec<Vec<LayerOrder>> {
        let in_view = InView::new(shown, view);
        (0..self.nodes).map(|node| in_view.layers(|chunk| self.owner_of(chunk) == node)).collect()
    }
}

/// The chunks of one view that have something to show, and where.
#[derive(Debug)]
pub struct InView {
    tree: MergeTree,
    /// Per chunk, x fastest: the pixels that it may touch; empty where it shows nothing.
    rects: Vec<PixelRect>,
}

const NOTHING: PixelRect = PixelRect { lo: UVec2::ZERO, hi: UVec2::ZERO };

impl InView {
    #[must_use]
    pub fn new(shown: &Shown, view: &View) -> Self {
        let tree = shown.tree;
        let rect = |(c, &bricks): (usize, &u32)| match tree.chunk_at(c as u32) {
            Some(chunk) if bricks > 0 => shown
                .bricks_of(chunk)
                .map(|b| view.project(&tree.grid().owned_box(b)))
                .fold(NOTHING, |all, one| all.union(&one)),
            _ => NOTHING,
        };
        Self { tree, rects: shown.per_chunk.iter().enumerate().map(rect).collect() }
    }

    /// The chunks in view and the tiles that they touch.
    #[must_use]
    pub fn chunks(&self) -> BTreeMap<u32, TileRect> {
        let seen = self.rects.iter().enumerate().filter(|(_, r)| !r.is_empty());
        seen.map(|(c, r)| (c as u32, TileRect::around(r))).collect()
    }

    /// The layers that render the chunks that are `mine`, and no others: maximal subtrees all of whose chunks in view are.
    #[must_use]
    pub fn layers(&self, mine: impl Fn(u32) -> bool) -> Vec<LayerOrder> {
        let tree = &self.tree;
        let rect = |c: ChunkIndex| self.rects[tree.chunk_linear(c) as usize];
        tree.layers(&|c| !rect(c).is_empty(), &|c| mine(tree.chunk_linear(c)))
            .into_iter()
            .map(|(node, chunks)| LayerOrder {
                node,
                tiles: TileRect::around(&chunks.iter().fold(NOTHING, |all, &c| all.union(&rect(c)))),
                chunks: chunks.into_iter().map(|c| tree.chunk_linear(c)).collect(),
            })
            .collect()
    }

    /// Deals `chunks`, which nobody renders any more, to `takers` nodes in runs of the tree's order: the layers of each.
    #[must_use]
    pub fn deal(&self, shown: &Shown, chunks: &BTreeSet<u32>, takers: usize) -> Vec<Vec<LayerOrder>> {
        let order = self.tree.chunks_in_tree_order().into_iter().map(|c| self.tree.chunk_linear(c));
        let ordered: Vec<u32> = order.filter(|c| chunks.contains(c)).collect();
        let run: HashMap<u32, usize> = shown.runs(&ordered, takers).into_iter().collect();
        (0..takers).map(|taker| self.layers(|chunk| run.get(&chunk) == Some(&taker))).collect()
    }
}

#[cfg(test)]
mod tests;

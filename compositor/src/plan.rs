//! The plan: which bricks have something to show, who renders which chunk, and what each node is ordered to do.
//!
//! A plan changes nothing in the picture: chunks are joined at the canonical merge tree's nodes whoever renders them.

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
        let weight = |c: &ChunkIndex| u64::from(shown.per_chunk[shown.tree.chunk_linear(*c) as usize]);
        let total = order.iter().map(weight).sum::<u64>().max(1);
        let mut owner = vec![0; order.len()];
        let mut before = 0;
        for chunk in order {
            let w = weight(&chunk);
            // The run that the chunk's middle falls into; doubled to stay in integers.
            let run = (2 * before + w) * nodes as u64 / (2 * total);
            owner[shown.tree.chunk_linear(chunk) as usize] = (run as usize).min(nodes - 1);
            before += w;
        }
        Self { owner, nodes }
    }

    /// An explicit table, e.g. a scattered one in tests: `owner[chunk]` below `nodes`.
    #[must_use]
    pub fn explicit(owner: Vec<usize>, nodes: usize) -> Self {
        Self { owner, nodes }
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
        let tree = shown.tree;
        let nothing = PixelRect { lo: UVec2::ZERO, hi: UVec2::ZERO };
        let rects: Vec<PixelRect> = (0..self.owner.len() as u32)
            .map(|c| match tree.chunk_at(c) {
                Some(chunk) if shown.per_chunk[c as usize] > 0 => shown
                    .bricks_of(chunk)
                    .map(|b| view.project(&tree.grid().owned_box(b)))
                    .fold(nothing, |all, one| all.union(&one)),
                _ => nothing,
            })
            .collect();
        let rect = |c: ChunkIndex| rects[tree.chunk_linear(c) as usize];
        (0..self.nodes)
            .map(|node| {
                let mine = |c: ChunkIndex| self.owner[tree.chunk_linear(c) as usize] == node;
                tree.layers(&|c| !rect(c).is_empty(), &mine)
                    .into_iter()
                    .map(|(tree_node, chunks)| LayerOrder {
                        node: tree_node,
                        tiles: TileRect::around(&chunks.iter().fold(nothing, |all, &c| all.union(&rect(c)))),
                        chunks: chunks.into_iter().map(|c| tree.chunk_linear(c)).collect(),
                    })
                    .collect()
            })
            .collect()
    }
}

//! Who renders which chunk.

use std::collections::BTreeMap;

use brickcast_volume::{BrickId, ChunkId, PerChunk, StoreHash};

use super::shown::Shown;

/// A node, and which strips `[from, to)` of a chunk's tiles in view it renders ([`brickcast_proto::TileRect::strips`]).
pub type Share = (usize, [u32; 2]);

/// Who renders which chunk, and which parts of the screen of those that are shared.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Position in the list of nodes.
    owner: PerChunk<usize>,
    nodes: usize,
    /// Chunks that several nodes render, each some strips of its tiles.
    shared: BTreeMap<ChunkId, Vec<Share>>,
}

impl Assignment {
    /// Contiguous runs of the merge tree's order (compact in space, so few layers) with nearly equal numbers of shown
    /// bricks. It depends on the store and the transfer function, not on the view: an orbit moves no brick.
    #[must_use]
    pub fn contiguous(shown: &Shown, nodes: usize) -> Self {
        let order = shown.tree.chunks_in_tree_order();
        let mut owner = PerChunk::filled(0, order.len());
        let chunks: Vec<ChunkId> = order.into_iter().map(|c| shown.tree.chunk_id(c)).collect();
        for (chunk, run) in shown.runs(&chunks, nodes) {
            owner[chunk] = run;
        }
        Self::explicit(owner, nodes)
    }

    /// An explicit table, e.g. a scattered one in tests: `owner[chunk]` below `nodes`.
    #[must_use]
    pub fn explicit(owner: PerChunk<usize>, nodes: usize) -> Self {
        Self { owner, nodes, shared: BTreeMap::new() }
    }

    /// The same table for one view, but for chunks whose tiles several nodes share: disjoint shares of nodes below
    /// `nodes`, together all of the chunk's strips.
    #[must_use]
    pub fn sharing(mut self, shared: BTreeMap<ChunkId, Vec<Share>>) -> Self {
        self.shared = shared;
        self
    }

    /// The same table with the chunks of absent nodes dealt to those that are there; nobody else's move.
    #[must_use]
    pub fn without_absent(mut self, shown: &Shown, present: &[bool]) -> Self {
        let here: Vec<usize> = (0..self.nodes).filter(|&n| present.get(n) == Some(&true)).collect();
        if here.is_empty() {
            return self;
        }
        let order = shown.tree.chunks_in_tree_order().into_iter().map(|c| shown.tree.chunk_id(c));
        let orphans: Vec<ChunkId> = order.filter(|&c| !here.contains(&self.owner[c])).collect();
        for (chunk, run) in shown.runs(&orphans, here.len()) {
            self.owner[chunk] = here[run];
        }
        self.shared.retain(|_, parts| parts.iter().all(|(node, _)| here.contains(node)));
        self
    }

    /// How many nodes it is for.
    pub(super) fn node_count(&self) -> usize {
        self.nodes
    }

    /// The node that renders a chunk, or most of it.
    #[must_use]
    pub fn owner_of(&self, chunk: ChunkId) -> usize {
        self.owner[chunk]
    }

    /// The nodes that share a chunk's tiles; empty where one renders it whole.
    #[must_use]
    pub fn sharers_of(&self, chunk: ChunkId) -> &[Share] {
        self.shared.get(&chunk).map_or(&[], |parts| &parts[..])
    }

    /// The chunks that `node` must hold, in the grid's order.
    #[must_use]
    pub fn chunks_of(&self, node: usize) -> Vec<ChunkId> {
        let holds = |chunk: ChunkId| match self.sharers_of(chunk) {
            [] => self.owner_of(chunk) == node,
            sharers => sharers.iter().any(|(n, _)| *n == node),
        };
        self.owner.ids().filter(|&chunk| holds(chunk)).collect()
    }

    /// The bricks that `node` must hold; of several levels those of the finest.
    #[must_use]
    pub fn bricks_of(&self, shown: &Shown, node: usize) -> Vec<BrickId> {
        shown.bricks_in(&self.chunks_of(node))
    }

    /// The bricks that `node` must hold, by their stores: `store` is that of the finest level.
    #[must_use]
    pub fn bricks_by_store(&self, shown: &Shown, store: StoreHash, node: usize) -> Vec<(StoreHash, Vec<BrickId>)> {
        let Some(parts) = shown.parts() else { return vec![(store, self.bricks_of(shown, node))] };
        let chunks = self.chunks_of(node);
        parts
            .iter()
            .map(|part| (part.store, part.bricks_in(&chunks)))
            .filter(|(_, bricks)| !bricks.is_empty())
            .collect()
    }
}

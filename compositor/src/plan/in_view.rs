//! One view of what is shown: which chunks it touches and where, and what is ordered from whom.

use std::collections::{BTreeMap, BTreeSet};

use brickcast_proto::{LayerOrder, TileRect};
use brickcast_volume::chord::expected_samples;
use brickcast_volume::merge::MergeTree;
use brickcast_volume::{ChunkId, ChunkIndex, PerChunk, PixelRect, View};
use glam::UVec2;
use rayon::prelude::*;

use super::assignment::Assignment;
use super::shown::Shown;
use super::unordered::Unordered;

/// What one node is ordered to render: the layers of each order; usually one.
pub type Orders = Vec<Vec<LayerOrder>>;

/// The chunks of one view that have something to show, and where.
#[derive(Debug)]
pub struct InView {
    tree: MergeTree,
    /// The pixels that each may touch; empty where it shows nothing.
    rects: PerChunk<PixelRect>,
}

/// Rays through a chunk, and at least through a strip of it, by which its cost in a view is told beforehand.
const RAYS: u32 = 64;
const RAYS_OF_A_STRIP: u32 = 8;

const NOTHING: PixelRect = PixelRect { lo: UVec2::ZERO, hi: UVec2::ZERO };

impl InView {
    #[must_use]
    pub fn new(shown: &Shown, view: &View) -> Self {
        let tree = shown.tree;
        let rect = |(c, &bricks): (ChunkId, &u32)| match tree.chunk_at(c) {
            Some(chunk) if bricks > 0 => shown
                .bricks_of(chunk)
                .map(|b| view.project(&tree.grid().owned_box(b)))
                .fold(NOTHING, |all, one| all.union(&one)),
            _ => NOTHING,
        };
        let rects = shown.per_chunk.iter().map(rect).collect();
        Self { tree, rects }
    }

    /// Of several levels, each seen in its own voxels: `views` are those of [`Shown::parts`].
    #[must_use]
    pub fn of_levels(shown: &Shown, views: &[View]) -> Self {
        let tree = shown.tree;
        let mut rects = PerChunk::filled(NOTHING, shown.per_chunk.count());
        for (part, view) in shown.parts().unwrap_or_default().iter().zip(views) {
            let rect = |brick| view.project(&part.tree.grid().owned_box(brick));
            for &chunk in part.chunks.keys() {
                rects[chunk] = part.bricks_of(chunk).map(rect).fold(NOTHING, |all, one| all.union(&one));
            }
        }
        Self { tree, rects }
    }

    /// The chunks in view and the tiles that they touch.
    #[must_use]
    pub fn chunks(&self) -> BTreeMap<ChunkId, TileRect> {
        let seen = self.rects.iter().filter(|(_, r)| !r.is_empty());
        seen.map(|(c, r)| (c, TileRect::around(r))).collect()
    }

    /// The chunks in view and the pixels that they may touch.
    pub fn rects(&self) -> impl Iterator<Item = (ChunkId, PixelRect)> + '_ {
        self.rects.iter().filter(|(_, rect)| !rect.is_empty()).map(|(chunk, rect)| (chunk, *rect))
    }

    /// Per chunk, and per strip of its tiles: about how many sample positions lie inside the box of its shown bricks.
    /// No strips: not in view.
    #[must_use]
    pub fn sample_positions(&self, shown: &Shown, view: &View) -> PerChunk<Vec<f64>> {
        let kernel = view.kernel();
        let of_chunk = |(chunk, rect): (ChunkId, &PixelRect)| -> Vec<f64> {
            let Some(voxels) = shown.boxes[chunk].filter(|_| !rect.is_empty()) else { return Vec::new() };
            let tiles = TileRect::around(rect);
            let strips = tiles.strip_count();
            let strip = |i: u32| {
                let pixels = tiles.strips([i, i + 1]).pixels(view.size()).intersect(rect);
                expected_samples(&kernel, &pixels, &voxels, (RAYS / strips).max(RAYS_OF_A_STRIP))
            };
            (0..strips).map(strip).collect()
        };
        let rects: Vec<_> = self.rects.iter().collect();
        rects.into_par_iter().map(of_chunk).collect::<Vec<_>>().into()
    }

    /// The layers that render the chunks that are `mine`, and no others: maximal subtrees all of whose chunks in view
    /// are.
    #[must_use]
    pub fn layers(&self, mine: impl Fn(ChunkId) -> bool) -> Vec<LayerOrder> {
        let tree = &self.tree;
        let rect = |c: ChunkIndex| self.rects[tree.chunk_id(c)];
        tree.layers(&|c| !rect(c).is_empty(), &|c| mine(tree.chunk_id(c)))
            .into_iter()
            .map(|(node, chunks)| LayerOrder {
                node,
                tiles: TileRect::around(&chunks.iter().fold(NOTHING, |all, &c| all.union(&rect(c)))),
                chunks: chunks.into_iter().map(|c| tree.chunk_id(c)).collect(),
            })
            .collect()
    }

    /// What `node` renders by `table`.
    #[must_use]
    pub fn orders_of(&self, table: &Assignment, node: usize) -> Orders {
        let mut whole = BTreeSet::new();
        let mut parts = Vec::new();
        for (chunk, tiles) in self.chunks() {
            let sharers = table.sharers_of(chunk);
            if sharers.is_empty() {
                if table.owner_of(chunk) == node {
                    whole.insert(chunk);
                }
                continue;
            }
            for part in sharers.iter().filter(|(n, _)| *n == node).map(|(_, strips)| tiles.strips(*strips)) {
                if part == tiles {
                    whole.insert(chunk);
                } else if !part.is_empty() {
                    parts.push((chunk, part));
                }
            }
        }
        self.orders(&whole, &parts)
    }

    /// Deals what nobody renders any more to `takers` nodes, in runs of the tree's order: the orders of each.
    #[must_use]
    pub fn deal(&self, shown: &Shown, open: &Unordered, takers: usize) -> Vec<Orders> {
        let order = self.tree.chunks_in_tree_order().into_iter().map(|c| self.tree.chunk_id(c));
        let ordered: Vec<ChunkId> = order.filter(|&c| !open.of(c).is_empty()).collect();
        let mut dealt = vec![(BTreeSet::new(), Vec::new()); takers];
        for (chunk, run) in shown.runs(&ordered, takers) {
            let (whole, parts) = &mut dealt[run];
            match open.of(chunk) {
                [all] if *all == TileRect::around(&self.rects[chunk]) => _ = whole.insert(chunk),
                some => parts.extend(some.iter().map(|tiles| (chunk, *tiles))),
            }
        }
        dealt.into_iter().map(|(whole, parts)| self.orders(&whole, &parts)).collect()
    }

    /// One order for all that is `whole` and the first part of each chunk of `parts`, and more where a chunk has
    /// several: an order names no layer twice.
    fn orders(&self, whole: &BTreeSet<ChunkId>, parts: &[(ChunkId, TileRect)]) -> Orders {
        let mut orders = vec![self.layers(|chunk| whole.contains(&chunk))];
        let mut taken: BTreeMap<ChunkId, usize> = BTreeMap::new();
        for &(chunk, tiles) in parts {
            let Some(index) = self.tree.chunk_at(chunk) else { continue };
            let at = taken.entry(chunk).or_insert(0);
            if *at == orders.len() {
                orders.push(Vec::new());
            }
            orders[*at].push(LayerOrder { node: self.tree.leaf(index), chunks: vec![chunk], tiles });
            *at += 1;
        }
        orders.retain(|layers| !layers.is_empty());
        orders
    }
}

impl Assignment {
    /// What each node is ordered to render of `view`; a node may have nothing to do.
    #[must_use]
    pub fn orders(&self, shown: &Shown, view: &View) -> Vec<Orders> {
        let in_view = InView::new(shown, view);
        (0..self.node_count()).map(|node| in_view.orders_of(self, node)).collect()
    }
}

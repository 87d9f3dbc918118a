//! The ledger: the layers that a frame is still owed. Completeness is counted, never guessed.
//!
//! Invariants (architecture.md, laws 1, 2 and 5): every ordered (layer, tile) pair is answered once, with pixels or
//! explicitly empty; an answer of another frame, epoch or node, to something not ordered, or a second time, changes nothing.

use std::collections::HashMap;

use brickcast_proto::{LayerOrder, TileRect};
use brickcast_volume::{Epoch, FrameId, Premul, TreeNode};

/// Pixels of a tile, row-major, clipped to the picture.
pub type TilePixels = Vec<Premul>;

/// What became of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Accepted,
    /// Answered before.
    Duplicate,
    /// Of another frame or epoch.
    Stale,
    /// Never ordered from this node.
    Unordered,
}

#[derive(Debug)]
struct Debt {
    from: usize,
    tiles: TileRect,
    answered: Vec<bool>,
    open: usize,
    pixels: HashMap<[u32; 2], TilePixels>,
}

/// What one frame is owed and what came in.
#[derive(Debug)]
pub struct Ledger {
    frame: FrameId,
    epoch: Epoch,
    debts: HashMap<TreeNode, Debt>,
    open: usize,
    duplicates: u64,
}

impl Ledger {
    /// A frame's debts: `orders[node]` are the layers that this node was ordered to answer.
    #[must_use]
    pub fn new(frame: FrameId, epoch: Epoch, orders: &[Vec<LayerOrder>]) -> Self {
        let mut debts = HashMap::new();
        for (from, layers) in orders.iter().enumerate() {
            for layer in layers {
                let open = layer.tiles.count() as usize;
                let debt = Debt { from, tiles: layer.tiles, answered: vec![false; open], open, pixels: HashMap::new() };
                debts.insert(layer.node, debt);
            }
        }
        let open = debts.values().map(|d| d.open).sum();
        Self { frame, epoch, debts, open, duplicates: 0 }
    }

    /// Enters one answer; `pixels` is `None` for an explicit empty.
    pub fn accept(
        &mut self,
        (frame, epoch): (FrameId, Epoch),
        from: usize,
        layer: TreeNode,
        tile: [u32; 2],
        pixels: Option<TilePixels>,
    ) -> Verdict {
        if frame != self.frame || epoch != self.epoch {
            return Verdict::Stale;
        }
        let Some(debt) = self.debts.get_mut(&layer).filter(|d| d.from == from) else { return Verdict::Unordered };
        let Some(index) = debt.tiles.linear(tile) else { return Verdict::Unordered };
        if std::mem::replace(&mut debt.answered[index as usize], true) {
            self.duplicates += 1;
            return Verdict::Duplicate;
        }
        debt.open -= 1;
        self.open -= 1;
        if let Some(pixels) = pixels {
            debt.pixels.insert(tile, pixels);
        }
        Verdict::Accepted
    }

    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.open == 0
    }

    /// Answers still owed, and the nodes that owe them.
    #[must_use]
    pub fn owed(&self) -> (usize, Vec<usize>) {
        let mut nodes: Vec<usize> = self.debts.values().filter(|d| d.open > 0).map(|d| d.from).collect();
        nodes.sort_unstable();
        nodes.dedup();
        (self.open, nodes)
    }

    /// True where `from` owes nothing any more.
    #[must_use]
    pub fn is_settled(&self, from: usize) -> bool {
        self.debts.values().all(|d| d.from != from || d.open == 0)
    }

    /// Tiles (of the picture) for which an answer is missing.
    #[must_use]
    pub fn missing_tiles(&self) -> Vec<[u32; 2]> {
        let mut missing: Vec<[u32; 2]> = self
            .debts
            .values()
            .flat_map(|d| d.tiles.tiles().zip(&d.answered).filter(|(_, answered)| !**answered).map(|(t, _)| t))
            .collect();
        missing.sort_unstable();
        missing.dedup();
        missing
    }

    /// How many answers came a second time.
    #[must_use]
    pub fn duplicates(&self) -> u64 {
        self.duplicates
    }

    /// Layers with pixels, per node.
    #[must_use]
    pub fn layers_with_pixels(&self, from: usize) -> usize {
        self.debts.values().filter(|d| d.from == from && !d.pixels.is_empty()).count()
    }

    /// The layers that have something to show.
    pub fn layers(&self) -> impl Iterator<Item = TreeNode> + '_ {
        self.debts.iter().filter(|(_, d)| !d.pixels.is_empty()).map(|(n, _)| *n)
    }

    /// The pixels of a layer in a tile.
    #[must_use]
    pub fn pixels(&self, layer: TreeNode, tile: [u32; 2]) -> Option<&TilePixels> {
        self.debts.get(&layer)?.pixels.get(&tile)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ledger() -> Ledger {
        let layer = |node: u64, hi: [u32; 2]| LayerOrder {
            node: TreeNode(node),
            chunks: vec![0],
            tiles: TileRect { lo: [0, 0], hi },
        };
        Ledger::new(FrameId(7), Epoch(2), &[vec![layer(2, [2, 1])], vec![layer(3, [1, 1])]])
    }

    const NOW: (FrameId, Epoch) = (FrameId(7), Epoch(2));

    #[test]
    fn every_layer_ordered_answers_exactly_once_empty_included() {
        let mut l = ledger();
        assert_eq!(l.accept(NOW, 0, TreeNode(2), [0, 0], None), Verdict::Accepted);
        assert_eq!(l.accept(NOW, 0, TreeNode(2), [1, 0], Some(vec![Premul::CLEAR])), Verdict::Accepted);
        assert!(!l.is_complete() && l.is_settled(0));
        assert_eq!(l.owed(), (1, vec![1]));
        assert_eq!(l.missing_tiles(), vec![[0, 0]]);
        assert_eq!(l.accept(NOW, 1, TreeNode(3), [0, 0], None), Verdict::Accepted);
        assert!(l.is_complete());
    }

    #[test]
    fn no_tile_of_one_epoch_blends_into_a_frame_of_the_next() {
        let mut l = ledger();
        let pixel = Some(vec![Premul { r: 1.0, g: 1.0, b: 1.0, a: 1.0 }]);
        assert_eq!(l.accept((FrameId(7), Epoch(1)), 0, TreeNode(2), [0, 0], pixel.clone()), Verdict::Stale);
        assert_eq!(l.accept((FrameId(6), Epoch(2)), 0, TreeNode(2), [0, 0], pixel), Verdict::Stale);
        assert_eq!(l.layers().count(), 0);
        assert_eq!(l.owed().0, 3);
    }

    #[test]
    fn a_duplicate_or_foreign_tile_changes_no_pixel() {
        let mut l = ledger();
        let first = vec![Premul { r: 0.5, g: 0.0, b: 0.0, a: 0.5 }];
        let other = vec![Premul { r: 0.0, g: 0.9, b: 0.0, a: 0.9 }];
        assert_eq!(l.accept(NOW, 0, TreeNode(2), [0, 0], Some(first.clone())), Verdict::Accepted);
        assert_eq!(l.accept(NOW, 0, TreeNode(2), [0, 0], Some(other.clone())), Verdict::Duplicate);
        assert_eq!(l.accept(NOW, 1, TreeNode(2), [1, 0], Some(other.clone())), Verdict::Unordered);
        assert_eq!(l.accept(NOW, 0, TreeNode(2), [5, 0], Some(other.clone())), Verdict::Unordered);
        assert_eq!(l.accept(NOW, 0, TreeNode(9), [0, 0], Some(other)), Verdict::Unordered);
        assert_eq!(l.pixels(TreeNode(2), [0, 0]), Some(&first));
        assert_eq!((l.owed().0, l.duplicates()), (2, 1));
    }
}

//! The ledger: what a frame is still owed, and by whom. Completeness is counted, never guessed.
//!
//! Invariants (docs/reference/protocol.md, laws 1, 2 and 5; docs/adr/0004-faults.md, docs/adr/0005-balance.md): every
//! tile of every chunk in view is at any time either in exactly one layer, owed by one ticket, or ordered from nobody.
//! A layer is a subtree for a rectangle of tiles: subtrees of different nodes are disjoint, and only a single chunk may
//! be shared out to several tickets, each with tiles of its own. Every (layer, tile) pair is answered once, with pixels
//! or explicitly empty; an answer of another frame, epoch or ticket, to something not owed, or a second time, changes
//! nothing. A layer that was made void leaves nothing behind, but where a frame ends before it was rendered again: then
//! what had come of it is worth showing.

use std::collections::{BTreeMap, HashMap};

use brickcast_proto::{LayerOrder, TileRect};
use brickcast_volume::{ChunkId, Epoch, FrameId, Pixels, TreeNode};

use crate::plan::Unordered;

/// Pixels of a tile, row-major, clipped to the picture.
pub type TilePixels = Pixels;

/// One order sent to one node; answers are entered under it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Ticket(pub usize);

/// Which layers of a ticket that failed are void.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Void {
    /// Those that are not answered whole.
    Open,
    /// All: what arrived cannot be trusted.
    All,
}

/// What became of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Accepted,
    /// Answered before.
    Duplicate,
    /// Of another frame or epoch.
    Stale,
    /// Not owed by this ticket: never ordered, or void by now.
    Unordered,
}

/// An order that would owe a chunk twice: a bug of the plan, never of a node.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LedgerError {
    #[error("chunk {chunk} of layer {} is ordered already for a tile, or not in view", .layer.0)]
    ChunkTaken { chunk: ChunkId, layer: TreeNode },
    #[error("layer {} lies above or below layer {}, which is owed already", .layer.0, .other.0)]
    Overlap { layer: TreeNode, other: TreeNode },
}

#[derive(Debug)]
struct Debt {
    ticket: Ticket,
    chunks: Vec<ChunkId>,
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
    /// The tiles of every chunk in view.
    in_view: BTreeMap<ChunkId, TileRect>,
    unordered: Unordered,
    /// Several of one node only where tickets share a chunk's tiles.
    debts: HashMap<TreeNode, Vec<Debt>>,
    /// Void layers of which something had come that can be trusted.
    broken: Vec<(TreeNode, Debt)>,
    open: usize,
    duplicates: u64,
}

impl Ledger {
    /// A frame that is owed these chunks, for these tiles; nothing is ordered yet.
    #[must_use]
    pub fn new(frame: FrameId, epoch: Epoch, in_view: BTreeMap<ChunkId, TileRect>) -> Self {
        let unordered = Unordered::all(&in_view);
        let (debts, broken) = (HashMap::new(), Vec::new());
        Self { frame, epoch, in_view, unordered, debts, broken, open: 0, duplicates: 0 }
    }

    /// From now on `ticket` owes these layers.
    ///
    /// # Errors
    /// A tile of a chunk that is owed already, or not at all; nothing is entered then.
    pub fn order(&mut self, ticket: Ticket, layers: &[LayerOrder]) -> Result<(), LedgerError> {
        let mut unordered = self.unordered.clone();
        for (i, layer) in layers.iter().enumerate() {
            let standing = self.debts.keys().copied().chain(layers[..i].iter().map(|l| l.node));
            let other = standing.into_iter().find(|other| *other != layer.node && related(layer.node, *other));
            if let Some(other) = other {
                return Err(LedgerError::Overlap { layer: layer.node, other });
            }
            for &chunk in &layer.chunks {
                if !unordered.take(chunk, &self.owed_of(layer, chunk)) {
                    return Err(LedgerError::ChunkTaken { chunk, layer: layer.node });
                }
            }
        }
        self.unordered = unordered;
        for layer in layers {
            let open = layer.tiles.count() as usize;
            let debt = Debt {
                ticket,
                chunks: layer.chunks.clone(),
                tiles: layer.tiles,
                answered: vec![false; open],
                open,
                pixels: HashMap::new(),
            };
            self.open += open;
            self.debts.entry(layer.node).or_default().push(debt);
        }
        Ok(())
    }

    /// The tiles of `chunk` that `layer` is for: all that it has, or of a chunk by itself those that the layer names.
    fn owed_of(&self, layer: &LayerOrder, chunk: ChunkId) -> TileRect {
        match (self.in_view.get(&chunk), &layer.chunks[..]) {
            (Some(all), [_]) if all.covers(&layer.tiles) => layer.tiles,
            (Some(all), _) => *all,
            (None, _) => layer.tiles,
        }
    }

    /// True where nothing that is ordered is open: what is missing is ordered from nobody.
    #[must_use]
    pub fn owes_nothing(&self) -> bool {
        self.open == 0
    }

    /// Makes layers of `ticket` void: their pixels go, their tiles are ordered from nobody. Returns how many.
    pub fn make_void(&mut self, ticket: Ticket, which: Void) -> usize {
        let hit = |d: &mut Debt| d.ticket == ticket && (d.open > 0 || which == Void::All);
        let void: Vec<(TreeNode, Debt)> = self
            .debts
            .iter_mut()
            .flat_map(|(node, debts)| debts.extract_if(.., hit).map(|d| (*node, d)).collect::<Vec<_>>())
            .collect();
        self.debts.retain(|_, debts| !debts.is_empty());
        let count = void.len();
        for (node, debt) in void {
            self.open -= debt.open;
            let layer = LayerOrder { node, chunks: debt.chunks.clone(), tiles: debt.tiles };
            for &chunk in &layer.chunks {
                self.unordered.put(chunk, self.owed_of(&layer, chunk));
            }
            if which == Void::Open && !debt.pixels.is_empty() {
                self.broken.push((node, debt));
            }
        }
        count
    }

    /// At the end of a frame that is not complete: what had come of void layers that nobody rendered again, the most of
    /// each.
    pub fn take_what_came(&mut self) {
        let mut broken = std::mem::take(&mut self.broken);
        broken.sort_by_key(|(node, debt)| (debt.open, *node));
        for (node, debt) in broken {
            let layer = LayerOrder { node, chunks: debt.chunks.clone(), tiles: debt.tiles };
            if self.order(debt.ticket, std::slice::from_ref(&layer)).is_ok()
                && let Some(debts) = self.debts.get_mut(&node)
            {
                debts.pop();
                self.open -= debt.tiles.count() as usize - debt.open;
                debts.push(debt);
            }
        }
    }

    /// Enters one answer; `pixels` is `None` for an explicit empty.
    pub fn accept(
        &mut self,
        (frame, epoch): (FrameId, Epoch),
        ticket: Ticket,
        layer: TreeNode,
        tile: [u32; 2],
        pixels: Option<TilePixels>,
    ) -> Verdict {
        if frame != self.frame || epoch != self.epoch {
            return Verdict::Stale;
        }
        let mine = |d: &&mut Debt| d.ticket == ticket && d.tiles.contains(tile);
        let Some(debt) = self.debts.get_mut(&layer).and_then(|debts| debts.iter_mut().find(mine)) else {
            return Verdict::Unordered;
        };
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
        self.open == 0 && self.unordered.is_empty()
    }

    /// What is in view and ordered from nobody.
    #[must_use]
    pub fn unordered(&self) -> &Unordered {
        &self.unordered
    }

    fn layers_owed(&self) -> impl Iterator<Item = &Debt> {
        self.debts.values().flatten()
    }

    /// Answers that `ticket` still owes.
    #[must_use]
    pub fn owed_by(&self, ticket: Ticket) -> usize {
        self.layers_owed().filter(|d| d.ticket == ticket).map(|d| d.open).sum()
    }

    /// The tile of every answer that a ticket still owes.
    pub fn unanswered(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        let open = |d: &'_ Debt| d.tiles.tiles().zip(d.answered.clone()).filter(|(_, answered)| !answered);
        self.layers_owed().filter(|d| d.open > 0).flat_map(move |d| open(d).map(|(tile, _)| tile).collect::<Vec<_>>())
    }

    /// Tiles (of the picture) for which an answer is missing.
    #[must_use]
    pub fn missing_tiles(&self) -> Vec<[u32; 2]> {
        let mut missing: Vec<[u32; 2]> = self.unanswered().collect();
        missing.extend(self.unordered.iter().flat_map(|(_, open)| open).flat_map(TileRect::tiles));
        missing.sort_unstable();
        missing.dedup();
        missing
    }

    /// How many answers came a second time.
    #[must_use]
    pub fn duplicates(&self) -> u64 {
        self.duplicates
    }

    /// Layers with pixels that `ticket` contributed.
    #[must_use]
    pub fn layers_with_pixels(&self, ticket: Ticket) -> usize {
        self.layers_owed().filter(|d| d.ticket == ticket && !d.pixels.is_empty()).count()
    }

    /// The layers that have something to show.
    pub fn layers(&self) -> impl Iterator<Item = TreeNode> + '_ {
        self.debts.iter().filter(|(_, debts)| debts.iter().any(|d| !d.pixels.is_empty())).map(|(n, _)| *n)
    }

    /// The pixels of a layer in a tile.
    #[must_use]
    pub fn pixels(&self, layer: TreeNode, tile: [u32; 2]) -> Option<&TilePixels> {
        self.debts.get(&layer)?.iter().find_map(|d| d.pixels.get(&tile))
    }
}

/// True where one is the other, or its ancestor.
fn related(a: TreeNode, b: TreeNode) -> bool {
    let depth = |n: TreeNode| n.0.max(1).ilog2();
    let (da, db) = (depth(a), depth(b));
    let shallow = da.min(db);
    a.0 >> (da - shallow) == b.0 >> (db - shallow)
}

#[cfg(test)]
mod property;
#[cfg(test)]
mod tests;

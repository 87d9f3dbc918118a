//! Which tiles of the picture are finished: told as the frame goes, to whom it concerns.
//!
//! A tile is finished when no layer owes an answer for it and nothing in it waits to be ordered: the ledger's
//! completeness, tile by tile.

use brickcast_proto::{LayerOrder, TileRect};
use brickcast_volume::View;
use brickcast_volume::merge::{MergeTree, Viewpoint};
use brickcast_volume::pixel::Coloring;
use brickcast_volume::scene::Scene;

use super::blend::blend_tile;
use super::ledger::Ledger;
use super::sink::FrameSink;
use crate::plan::StoreFacts;

/// What a listener was told, and what the tiles still wait for.
pub(crate) struct Finished<'a> {
    sink: &'a mut dyn FrameSink,
    tree: MergeTree,
    from: Viewpoint,
    coloring: Coloring,
    all: TileRect,
    /// Per tile, row-major: answers that are missing of layers that are ordered.
    waits: Vec<u32>,
    told: Vec<bool>,
    finished: u32,
}

impl<'a> Finished<'a> {
    /// Nothing where the sink does not listen.
    pub(crate) fn told_to(sink: &'a mut dyn FrameSink, store: &StoreFacts, scene: &Scene, view: &View) -> Option<Self> {
        let all = TileRect::of_picture(scene.view.size);
        let count = all.count() as usize;
        sink.listens().then(|| Self {
            sink,
            tree: store.tree(),
            from: view.viewpoint(),
            coloring: Coloring::new(scene.look.transfer_function.clone(), store.manifest.range),
            all,
            waits: vec![0; count],
            told: vec![false; count],
            finished: 0,
        })
    }

    /// Layers that are ordered from now on.
    pub(super) fn owed(&mut self, layers: &[LayerOrder]) {
        for tile in layers.iter().flat_map(|layer| layer.tiles.tiles()) {
            if let Some(waits) = self.index(tile).and_then(|i| self.waits.get_mut(i)) {
                *waits += 1;
            }
        }
    }

    /// An answer that the ledger accepted.
    pub(super) fn answered(&mut self, tile: [u32; 2], ledger: &Ledger) {
        let Some(index) = self.index(tile) else { return };
        self.waits[index] = self.waits[index].saturating_sub(1);
        self.tell(index, tile, ledger);
    }

    /// The ledger, read anew: at the beginning, when tiles that nothing shows in are finished, and where layers became
    /// void.
    pub(super) fn recount(&mut self, ledger: &Ledger) {
        self.waits.fill(0);
        for tile in ledger.unanswered() {
            if let Some(index) = self.index(tile) {
                self.waits[index] += 1;
            }
        }
        for (index, tile) in self.all.tiles().enumerate() {
            if self.told[index] && self.is_open(index, tile, ledger) {
                self.told[index] = false;
                self.finished -= 1;
            }
            self.tell(index, tile, ledger);
        }
    }

    fn index(&self, tile: [u32; 2]) -> Option<usize> {
        self.all.linear(tile).map(|index| index as usize)
    }

    fn is_open(&self, index: usize, tile: [u32; 2], ledger: &Ledger) -> bool {
        let nobody = || ledger.unordered().iter().any(|(_, open)| open.iter().any(|rect| rect.contains(tile)));
        self.waits[index] > 0 || nobody()
    }

    fn tell(&mut self, index: usize, tile: [u32; 2], ledger: &Ledger) {
        if self.told[index] || self.is_open(index, tile, ledger) {
            return;
        }
        // The frame ends with the same error.
        let Ok(finished) = blend_tile(ledger, &self.tree, self.from, &self.coloring, tile) else { return };
        self.told[index] = true;
        self.finished += 1;
        self.sink.tile(finished);
        self.sink.progress(self.finished, self.all.count());
    }
}

#[cfg(test)]
mod tests;

//! Which tiles of the picture are finished: told as the frame goes, to whom it concerns.
//!
//! A tile is finished when no layer owes an answer for it and nothing in it waits to be ordered: the ledger's
//! completeness, tile by tile. Where pixels are means of several rays, the ledger's tiles are of rays, and a tile of
//! the picture is made of several of them.

use brickcast_proto::{LayerOrder, TileRect};
use brickcast_volume::merge::{MergeTree, Viewpoint};
use brickcast_volume::pixel::Coloring;
use brickcast_volume::scene::{PixelSamples, Scene};
use brickcast_volume::{PictureSize, Premul, View};
use rayon::prelude::*;

use super::blend::{Layers, blend_tile};
use super::ledger::Ledger;
use super::sink::{FinishedTile, FrameSink};
use crate::picture::Picture;
use crate::plan::StoreFacts;

/// What a listener was told, and what the tiles still wait for.
pub(crate) struct Finished<'a> {
    sink: &'a mut dyn FrameSink,
    joining: Joining,
    all: TileRect,
    /// Per tile of the picture, row-major: answers that are missing of layers that are ordered.
    waits: Vec<u32>,
    told: Vec<bool>,
    /// Tiles that nothing is missing of and that were not told yet, in the order in which they became so.
    due: Vec<(usize, [u32; 2])>,
    finished: u32,
}

/// How a tile of the picture is made of the ledger's.
struct Joining {
    tree: MergeTree,
    from: Viewpoint,
    coloring: Coloring,
    size: PictureSize,
    samples: PixelSamples,
}

impl<'a> Finished<'a> {
    /// Nothing where the sink does not listen. `view` is that of the scene's rays.
    pub(crate) fn told_to(sink: &'a mut dyn FrameSink, store: &StoreFacts, scene: &Scene, view: &View) -> Option<Self> {
        let all = TileRect::of_picture(scene.view.size);
        let count = all.count() as usize;
        sink.listens().then(|| Self {
            sink,
            joining: Joining {
                tree: store.tree(),
                from: view.viewpoint(),
                coloring: Coloring::new(scene.look.transfer_function.clone(), store.manifest.range),
                size: scene.view.size,
                samples: scene.quality.samples,
            },
            all,
            waits: vec![0; count],
            told: vec![false; count],
            due: Vec::new(),
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
        self.note(index, tile_of_pixels(tile, self.joining.samples), ledger);
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
            self.note(index, tile, ledger);
        }
    }

    /// Of the picture's tile in which a tile of the ledger lies.
    fn index(&self, tile: [u32; 2]) -> Option<usize> {
        self.all.linear(tile_of_pixels(tile, self.joining.samples)).map(|index| index as usize)
    }

    fn is_open(&self, index: usize, tile: [u32; 2], ledger: &Ledger) -> bool {
        let rays = self.joining.rays_of(tile);
        let nobody = || ledger.unordered().iter().any(|(_, open)| open.iter().any(|rect| rect.meets(&rays)));
        self.waits[index] > 0 || nobody()
    }

    fn note(&mut self, index: usize, tile: [u32; 2], ledger: &Ledger) {
        let is_known = self.told[index] || self.due.iter().any(|(due, _)| *due == index);
        if !is_known && !self.is_open(index, tile, ledger) {
            self.due.push((index, tile));
        }
    }

    /// Tells of the tiles that are finished by now. Each is joined by itself, on whatever thread: their bits, and the
    /// order in which they are told, do not depend on the number of threads.
    pub(super) fn tell(&mut self, ledger: &Ledger) {
        let mut due = std::mem::take(&mut self.due);
        // What became void meanwhile will come again.
        due.retain(|(index, tile)| !self.is_open(*index, *tile, ledger));
        let joining = &self.joining;
        let joined: Vec<Option<FinishedTile>> = match due[..] {
            [] => return,
            [(_, tile)] => vec![joining.joined(tile, ledger)],
            _ => due.par_iter().with_max_len(1).map(|(_, tile)| joining.joined(*tile, ledger)).collect(),
        };
        for ((index, _), joined) in due.into_iter().zip(joined) {
            let Some(tile) = joined else { continue };
            self.told[index] = true;
            self.finished += 1;
            self.sink.tile(tile);
            self.sink.progress(self.finished, self.all.count());
        }
    }
}

impl Joining {
    /// The ledger's tiles that a tile of the picture is made of; some may lie outside it.
    fn rays_of(&self, tile: [u32; 2]) -> TileRect {
        let side = self.samples.side();
        TileRect { lo: tile.map(|t| t * side), hi: tile.map(|t| (t + 1) * side) }
    }

    /// Nothing where the frame ends with an error.
    fn joined(&self, tile: [u32; 2], ledger: &Ledger) -> Option<FinishedTile> {
        let layers = Layers { ledger, tree: &self.tree, from: self.from };
        let blend = |tile| blend_tile(layers, &self.coloring, tile).ok();
        if self.samples == PixelSamples::One {
            return blend(tile);
        }
        let pixels = TileRect::tile_pixels(tile, self.size).size();
        let size = PictureSize::new(pixels.x, pixels.y).ok()?;
        let rays = self.samples.rays_of(pixels.x, pixels.y).ok()?;
        let mut picture = Picture::new(rays, vec![Premul::CLEAR; rays.pixel_count()]).ok()?;
        let (mut shows, part) = (false, self.rays_of(tile));
        for of_rays in part.tiles() {
            let FinishedTile { tile: [x, y], pixels } = blend(of_rays)?;
            shows |= pixels.is_some();
            FinishedTile { tile: [x - part.lo[0], y - part.lo[1]], pixels }.draw(&mut picture);
        }
        let pixels = if shows { Some(picture.averaged(size, self.samples).ok()?.into_pixels()) } else { None };
        Some(FinishedTile { tile, pixels })
    }
}

/// The tile of the picture in which a tile of its rays lies.
fn tile_of_pixels(tile: [u32; 2], samples: PixelSamples) -> [u32; 2] {
    tile.map(|t| t / samples.side())
}

/// As tiles of the picture, each once, what are tiles of its rays.
pub(crate) fn tiles_of_pixels(tiles: Vec<[u32; 2]>, samples: PixelSamples) -> Vec<[u32; 2]> {
    let mut tiles: Vec<_> = tiles.into_iter().map(|tile| tile_of_pixels(tile, samples)).collect();
    tiles.sort_unstable();
    tiles.dedup();
    tiles
}

#[cfg(test)]
mod tests;

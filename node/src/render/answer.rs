//! A piece's picture cut into tiles: each ordered tile becomes pixels or an empty, exactly once.

use brickcast_proto::{LayerOrder, RenderOrder, TilePart, TileRect, encode_tile};
use brickcast_volume::Pixels;
use rayon::prelude::*;

use super::join::Layer;
use super::plan::Piece;

/// The answers to all tiles of a piece.
#[derive(Debug, Default)]
pub(super) struct Answers {
    pub tiles: Vec<TilePart>,
    /// Row-major indices in the *layer's* tile rectangle, increasing.
    pub empty: Vec<u32>,
}

pub(super) fn answer(piece: &Piece, layer: &LayerOrder, order: &RenderOrder, picture: Option<&Layer>) -> Answers {
    let tiles: Vec<[u32; 2]> = piece.tiles.tiles().collect();
    let encoded: Vec<Option<TilePart>> = tiles
        .par_iter()
        .with_max_len(1)
        .map(|&tile| {
            let pixels = cut(tile, order, picture?)?;
            let pixels = encode_tile(&pixels, order.transport)?;
            Some(TilePart { node: layer.node, tile, pixels })
        })
        .collect();
    let mut answers = Answers::default();
    for (tile, part) in tiles.into_iter().zip(encoded) {
        match part {
            Some(part) => answers.tiles.push(part),
            None => answers.empty.extend(layer.tiles.linear(tile)),
        }
    }
    answers
}

/// The pixels of a tile, clipped to the picture; `None` where the layer does not touch it.
fn cut(tile: [u32; 2], order: &RenderOrder, picture: &Layer) -> Option<Pixels> {
    let window = TileRect::tile_pixels(tile, order.scene.view.size);
    let shared = window.intersect(&picture.rect);
    if shared.is_empty() {
        return None;
    }
    let mut pixels = Pixels::clear(picture.pixels.kind(), window.pixel_count());
    let width = window.size().x as usize;
    for y in shared.lo.y..shared.hi.y {
        let at = (y - window.lo.y) as usize * width + (shared.lo.x - window.lo.x) as usize;
        let row = picture.row(y, shared.lo.x, shared.hi.x);
        pixels.raw_mut()[at..at + row.len()].copy_from_slice(row);
    }
    Some(pixels)
}

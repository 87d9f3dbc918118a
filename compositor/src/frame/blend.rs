//! Layers become a picture: tile by tile, joined at the merge tree's nodes with the project's one `over`, in f32.

use std::collections::HashSet;

use brickcast_proto::{TILE, TileRect};
use brickcast_volume::merge::{MergeTree, Viewpoint};
use brickcast_volume::style::Mode;
use brickcast_volume::transfer_function::TransferFunction;
use brickcast_volume::{PictureSize, Premul, TreeNode};
use rayon::prelude::*;

use super::ledger::{Ledger, TilePixels};
use crate::picture::{Picture, PictureError};

/// Joins everything that the ledger holds, in visibility order from `from`. The pixels of a projection stay codes.
///
/// # Errors
/// None that a picture of this size could have.
pub fn blend(
    ledger: &Ledger,
    tree: &MergeTree,
    from: Viewpoint,
    size: PictureSize,
    mode: Mode,
) -> Result<Picture, PictureError> {
    // Only subtrees that hold a layer are worth a visit.
    let mut on_the_way: HashSet<TreeNode> = HashSet::new();
    for layer in ledger.layers() {
        let mut node = layer.0;
        while node > 0 && on_the_way.insert(TreeNode(node)) {
            node /= 2;
        }
    }
    let all = TileRect::of_picture(size);
    let tiles: Vec<([u32; 2], TilePixels)> = all
        .tiles()
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(|tile| {
            let mut layer = |node: TreeNode| {
                if let Some(pixels) = ledger.pixels(node, tile) {
                    return Some(Some(pixels.clone()));
                }
                (!on_the_way.contains(&node)).then_some(None)
            };
            let mut join = |front: Option<TilePixels>, back: Option<TilePixels>| match (front, back) {
                (Some(f), Some(b)) => Some(f.into_iter().zip(b).map(|(f, b)| mode.join(f, b)).collect()),
                (one, other) => one.or(other),
            };
            let merged = tree.fold(MergeTree::ROOT, from, &mut layer, &mut join).flatten()?;
            Some((tile, merged))
        })
        .collect();
    let mut picture = vec![Premul::CLEAR; size.pixel_count()];
    for ([tx, ty], pixels) in tiles {
        let (x0, y0) = ((tx * TILE) as usize, (ty * TILE) as usize);
        let width = (TILE as usize).min(size.width() as usize - x0);
        for (row, line) in pixels.chunks_exact(width).enumerate() {
            let at = (y0 + row) * size.width() as usize + x0;
            picture[at..at + width].copy_from_slice(line);
        }
    }
    Picture::new(size, picture)
}

/// A projection's codes by the transfer function: straight colour and the opacity of one opacity unit, whatever the step.
/// `range`: data units of codes 0 and 1. Other pictures are what they are.
///
/// # Errors
/// None that a picture of this size could have.
pub fn classified(
    picture: Picture,
    mode: Mode,
    function: &TransferFunction,
    (lo, hi): (f64, f64),
) -> Result<Picture, PictureError> {
    if mode == Mode::Composite {
        return Ok(picture);
    }
    let color = |pixel: &Premul| {
        let Some(code) = mode.code(*pixel) else { return Premul::CLEAR };
        let value = lo + (hi - lo) * f64::from(code);
        let ([r, g, b], a) = (function.color(value), function.opacity(value));
        Premul::from_array([r * a, g * a, b * a, a].map(|c| c as f32))
    };
    Picture::new(picture.size(), picture.pixels().par_iter().map(color).collect())
}

//! Layers become a picture: tile by tile, joined at the merge tree's nodes with the project's one `over`, in f32.

use std::collections::HashSet;

use brickcast_proto::TileRect;
use brickcast_volume::merge::{MergeTree, Viewpoint};
use brickcast_volume::scene::Scene;
use brickcast_volume::style::Mode;
use brickcast_volume::transfer_function::TransferFunction;
use brickcast_volume::{PictureSize, Premul, TreeNode};
use rayon::prelude::*;

use super::ledger::{Ledger, TilePixels};
use super::sink::FinishedTile;
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
    let on_the_way = on_the_way(ledger.layers());
    let all: Vec<[u32; 2]> = TileRect::of_picture(size).tiles().collect();
    let tiles: Vec<([u32; 2], TilePixels)> = all
        .into_par_iter()
        .filter_map(|tile| Some((tile, joined(ledger, tree, from, mode, &on_the_way, tile)?)))
        .collect();
    let mut picture = Picture::new(size, vec![Premul::CLEAR; size.pixel_count()])?;
    for (tile, pixels) in tiles {
        FinishedTile { tile, pixels: Some(pixels) }.draw(&mut picture);
    }
    Ok(picture)
}

/// As [`blend`], of one tile; nothing where it is clear.
#[must_use]
pub(super) fn blend_tile(
    ledger: &Ledger,
    tree: &MergeTree,
    from: Viewpoint,
    mode: Mode,
    tile: [u32; 2],
) -> Option<TilePixels> {
    let here = ledger.layers().filter(|layer| ledger.pixels(*layer, tile).is_some());
    joined(ledger, tree, from, mode, &on_the_way(here), tile)
}

/// The tree's nodes from the root down to these: only subtrees that hold a layer are worth a visit.
fn on_the_way(layers: impl Iterator<Item = TreeNode>) -> HashSet<TreeNode> {
    let mut on_the_way = HashSet::new();
    for layer in layers {
        let mut node = layer.0;
        while node > 0 && on_the_way.insert(TreeNode(node)) {
            node /= 2;
        }
    }
    on_the_way
}

fn joined(
    ledger: &Ledger,
    tree: &MergeTree,
    from: Viewpoint,
    mode: Mode,
    on_the_way: &HashSet<TreeNode>,
    tile: [u32; 2],
) -> Option<TilePixels> {
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
    tree.fold(MergeTree::ROOT, from, &mut layer, &mut join).flatten()
}

/// What the pixels of a frame mean: a projection's are codes, whose colours the transfer function has.
#[derive(Debug, Clone)]
pub struct Classes {
    mode: Mode,
    function: TransferFunction,
    /// Data units of codes 0 and 1.
    range: (f64, f64),
}

impl Classes {
    /// `range`: data units of codes 0 and 1.
    #[must_use]
    pub fn new(mode: Mode, function: TransferFunction, range: (f64, f64)) -> Self {
        Self { mode, function, range }
    }

    /// Of a scene's frame.
    #[must_use]
    pub fn of(scene: &Scene, range: (f64, f64)) -> Self {
        Self::new(scene.look.style.mode, scene.look.transfer_function.clone(), range)
    }

    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// A projection's code by the transfer function: straight colour and the opacity of one opacity unit, whatever the
    /// step. Other pixels are what they are.
    #[must_use]
    pub fn color(&self, pixel: &Premul) -> Premul {
        if self.mode == Mode::Composite {
            return *pixel;
        }
        let Some(code) = self.mode.code(*pixel) else { return Premul::CLEAR };
        let (lo, hi) = self.range;
        let value = lo + (hi - lo) * f64::from(code);
        let ([r, g, b], a) = (self.function.color(value), self.function.opacity(value));
        Premul::from_array([r * a, g * a, b * a, a].map(|c| c as f32))
    }

    /// The whole picture in colours.
    ///
    /// # Errors
    /// None that a picture of this size could have.
    pub fn picture(&self, picture: Picture) -> Result<Picture, PictureError> {
        if self.mode == Mode::Composite {
            return Ok(picture);
        }
        Picture::new(picture.size(), picture.pixels().par_iter().map(|pixel| self.color(pixel)).collect())
    }
}

//! Layers become a picture: tile by tile, joined at the merge tree's nodes as their kind of pixels is, in f32; then
//! coloured.

use std::collections::HashSet;

use brickcast_proto::{TILE, TileRect};
use brickcast_volume::merge::{MergeTree, Viewpoint};
use brickcast_volume::pixel::{Coloring, KindError};
use brickcast_volume::{PictureSize, Premul, TreeNode};
use rayon::prelude::*;

use super::ledger::{Ledger, TilePixels};
use super::sink::FinishedTile;
use crate::picture::{Picture, PictureError};

/// Tiles that make no picture.
#[derive(Debug, thiserror::Error)]
pub enum BlendError {
    #[error(transparent)]
    Picture(#[from] PictureError),
    #[error("{0}, please report it")]
    Kind(#[from] KindError),
}

/// What a frame's nodes answered, and from where it is seen.
#[derive(Debug, Clone, Copy)]
pub struct Layers<'a> {
    pub ledger: &'a Ledger,
    pub tree: &'a MergeTree,
    pub from: Viewpoint,
}

/// Joins everything that the ledger holds, in visibility order, and colours it.
///
/// # Errors
/// Layers of two kinds, which no ledger has whose tiles were decoded for one scene.
pub fn blend(layers: Layers<'_>, size: PictureSize, coloring: &Coloring) -> Result<Picture, BlendError> {
    let ways = Ways::to(layers.ledger.layers());
    let finished = |tile| {
        let joined = joined(layers, &ways, tile).transpose()?;
        Some(joined.map(|pixels| FinishedTile { tile, pixels: Some(coloring.colors(&pixels)) }))
    };
    let mut picture = Picture::new(size, vec![Premul::CLEAR; size.pixel_count()])?;
    let (width, columns) = (size.width() as usize, TileRect::of_picture(size).hi[0]);
    // A thread draws what it joined, while that is at hand.
    let bands = picture.pixels_mut().par_chunks_mut(width * TILE as usize).enumerate().with_max_len(1);
    bands.try_for_each(|(row, band)| {
        let tiles = (0..columns).into_par_iter().filter_map(|column| finished([column, row as u32]));
        let tiles: Vec<FinishedTile> = tiles.collect::<Result<_, KindError>>()?;
        tiles.iter().for_each(|tile| tile.draw_in_band(band, width));
        Ok::<_, KindError>(())
    })?;
    Ok(picture)
}

/// As [`blend`], of one tile; nothing where it is clear.
pub(super) fn blend_tile(layers: Layers<'_>, coloring: &Coloring, tile: [u32; 2]) -> Result<FinishedTile, KindError> {
    let here = layers.ledger.layers().filter(|layer| layers.ledger.pixels(*layer, tile).is_some());
    let joined = joined(layers, &Ways::to(here), tile)?;
    Ok(FinishedTile { tile, pixels: joined.map(|pixels| coloring.colors(&pixels)) })
}

/// The tree's nodes from the root down to the layers: only subtrees that hold a layer are worth a visit.
struct Ways(HashSet<TreeNode>);

impl Ways {
    fn to(layers: impl Iterator<Item = TreeNode>) -> Self {
        let mut ways = HashSet::new();
        for layer in layers {
            let mut node = layer.0;
            while node > 0 && ways.insert(TreeNode(node)) {
                node /= 2;
            }
        }
        Self(ways)
    }
}

/// The pixels of a tile, where anything shows in it.
type Joined = Result<Option<TilePixels>, KindError>;

fn joined(layers: Layers<'_>, ways: &Ways, tile: [u32; 2]) -> Joined {
    let mut layer = |node: TreeNode| -> Option<Joined> {
        if let Some(pixels) = layers.ledger.pixels(node, tile) {
            return Some(Ok(Some(pixels.clone())));
        }
        (!ways.0.contains(&node)).then_some(Ok(None))
    };
    let mut join = |front: Joined, back: Joined| -> Joined {
        match (front?, back?) {
            (Some(front), Some(mut back)) => {
                front.kind_with(&back)?.join(front.raw(), back.raw_mut());
                Ok(Some(back))
            }
            (one, other) => Ok(one.or(other)),
        }
    };
    layers.tree.fold(MergeTree::ROOT, layers.from, &mut layer, &mut join).unwrap_or(Ok(None))
}

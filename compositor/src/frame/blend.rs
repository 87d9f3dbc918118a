//! Layers become a picture: tile by tile, joined at the merge tree's nodes as their kind of pixels is, in f32; then
//! coloured.

use std::collections::HashMap;

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

/// What one level of a volume brought to a frame, and from where it is seen in that level's own index space.
#[derive(Debug, Clone, Copy)]
pub struct LevelLayers<'a> {
    pub ledger: &'a Ledger,
    pub tree: &'a MergeTree,
    pub from: Viewpoint,
}

impl LevelLayers<'_> {
    /// As all of a frame: one of this level alone.
    #[must_use]
    pub fn alone(&self) -> Levels<'_> {
        Levels { finest: (self.tree, self.from), levels: std::slice::from_ref(self) }
    }
}

/// The levels of a frame; several where parts of the volume are drawn coarser. Their layers are nodes of one tree, the
/// finest's, none within another.
#[derive(Debug, Clone, Copy)]
pub struct Levels<'a> {
    /// The tree of level 0, at whose nodes all are joined, and its viewpoint.
    pub finest: (&'a MergeTree, Viewpoint),
    pub levels: &'a [LevelLayers<'a>],
}

/// Joins everything that the ledgers hold, in visibility order, and colours it.
///
/// # Errors
/// Layers of two kinds, which no ledger has whose tiles were decoded for one scene.
pub fn blend(levels: Levels<'_>, size: PictureSize, coloring: &Coloring) -> Result<Picture, BlendError> {
    let ways = Ways::to(levels.levels.iter().map(|level| level.ledger.layers()));
    let finished = |tile| {
        let joined = joined(levels, &ways, tile).transpose()?;
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

/// As [`blend`], of one tile of a frame of one level; nothing where it is clear.
pub(super) fn blend_tile(
    level: LevelLayers<'_>,
    coloring: &Coloring,
    tile: [u32; 2],
) -> Result<FinishedTile, KindError> {
    let here = level.ledger.layers().filter(|layer| level.ledger.pixels(*layer, tile).is_some());
    let joined = joined(level.alone(), &Ways::to(std::iter::once(here)), tile)?;
    Ok(FinishedTile { tile, pixels: joined.map(|pixels| coloring.colors(&pixels)) })
}

/// The tree's nodes from the root down to the layers, each with the levels that have layers at or below it, a bit each:
/// only subtrees that hold a layer are worth a visit.
struct Ways(HashMap<TreeNode, u64>);

impl Ways {
    fn to(levels: impl Iterator<Item = impl Iterator<Item = TreeNode>>) -> Self {
        let mut ways: HashMap<TreeNode, u64> = HashMap::new();
        for (place, layers) in levels.enumerate() {
            let bit = 1 << (place as u32).min(u64::BITS - 1);
            for layer in layers {
                let mut node = layer.0;
                while node > 0 {
                    let levels = ways.entry(TreeNode(node)).or_default();
                    if *levels & bit != 0 {
                        break;
                    }
                    *levels |= bit;
                    node /= 2;
                }
            }
        }
        Self(ways)
    }

    /// The only level at or below a node, where there is one.
    fn only_level(&self, node: TreeNode) -> Option<usize> {
        self.0.get(&node).filter(|levels| levels.count_ones() == 1).map(|levels| levels.trailing_zeros() as usize)
    }
}

/// The pixels of a tile, where anything shows in it.
type Joined = Result<Option<TilePixels>, KindError>;

fn joined(levels: Levels<'_>, ways: &Ways, tile: [u32; 2]) -> Joined {
    let (finest, from) = levels.finest;
    let mut layer = |node: TreeNode| -> Option<Joined> {
        if let Some(pixels) = levels.levels.iter().find_map(|level| level.ledger.pixels(node, tile)) {
            return Some(Ok(Some(pixels.clone())));
        }
        (!ways.0.contains_key(&node)).then_some(Ok(None))
    };
    // Where all is of one level, as a node would have joined it: an eye on a plane must not depend on who does.
    let order = |node: TreeNode| match ways.only_level(node).and_then(|place| levels.levels.get(place)) {
        Some(level) => level.tree.front_and_back(node, level.from),
        None => finest.front_and_back(node, from),
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
    finest.fold_by(MergeTree::ROOT, &order, &mut layer, &mut join).unwrap_or(Ok(None))
}

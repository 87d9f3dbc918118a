//! Wire to domain at the door: `TryFrom` rejects everything that breaks an invariant, `From` writes the wire.

mod acceleration;
mod cluster;
mod order;
mod part;
mod scene;
mod style;
mod unreadable;

use brickcast_volume::camera::CameraError;
use brickcast_volume::ids::NotAStoreHash;
use brickcast_volume::scene::{SceneError, Transport};
use brickcast_volume::transfer_function::TransferFunctionError;
use brickcast_volume::visibility::ViewError;
use brickcast_volume::{PixelKind, StoreHash, TreeNode};

use crate::cluster::NotAThrottle;
use crate::tile::TileError;
use crate::tile_rect::TileRect;

/// A message that breaks an invariant.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WireError {
    #[error("{0} is missing")]
    Missing(&'static str),
    #[error("{what} = {value} is none of this protocol's; both sides must run the same version")]
    Unknown { what: &'static str, value: String },
    #[error("{what}: {got} are more than the {max} that one message may have")]
    TooMany { what: &'static str, got: u64, max: u64 },
    #[error("{what}: {got} bytes of text, at most {max} may be")]
    Text { what: &'static str, got: usize, max: usize },
    #[error("{what} = {value}: must be finite and not negative")]
    Duration { what: &'static str, value: f64 },
    #[error(transparent)]
    Throttle(#[from] NotAThrottle),
    #[error(transparent)]
    StoreHash(#[from] NotAStoreHash),
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error(transparent)]
    Picture(#[from] ViewError),
    #[error(transparent)]
    TransferFunction(#[from] TransferFunctionError),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Tile(#[from] TileError),
    #[error("exact mode needs f32 transport, the order asks for {0}")]
    ExactTransport(&'static str),
    #[error("an interval picture needs f32 transport, the order asks for {0}")]
    ExtremeTransport(Transport),
    #[error("pixels of kind `{kind}` need f32 transport, the order asks for {transport}")]
    CodesTransport { kind: PixelKind, transport: Transport },
    #[error("0 is no node of a merge tree; its root is 1")]
    NoTreeNode,
    #[error("layer {} is ordered twice", .0.0)]
    LayerTwice(TreeNode),
    #[error("layer {} lies inside layer {}, which is ordered too", .inner.0, .outer.0)]
    NestedLayers { inner: TreeNode, outer: TreeNode },
    #[error("layer {} names no chunk", .0.0)]
    NoChunks(TreeNode),
    #[error("{what} {index} is named twice")]
    Twice { what: &'static str, index: u32 },
    #[error(
        "layer {}: tiles {:?} to {:?} are empty or reach beyond the picture's {:?}",
        .node.0,
        .tiles.lo,
        .tiles.hi,
        .picture.hi
    )]
    Tiles { node: TreeNode, tiles: TileRect, picture: TileRect },
    #[error("{what} {index} is beyond the last one, {last}")]
    Beyond { what: &'static str, index: u64, last: u64 },
    #[error("bricks of level {0}: this node knows level 0 only, the finest")]
    Level(u32),
    #[error("borders: {chunks} chunks, {sides} sides and {coarser} of coarser levels; each chunk has one of both")]
    BorderSides { chunks: usize, sides: usize, coarser: usize },
    #[error("borders of level {0}: there are levels 0 to 32")]
    BorderLevel(u32),
    #[error("a part of level {0}: there are levels 0 to 32")]
    PartLevel(u32),
    #[error("a part of level {level} has borders of level {other}")]
    PartBorders { level: u8, other: u8 },
    #[error("borders: chunk {chunk} has sides {bits:#x}, which are none, or coarser levels where no other level is")]
    Border { chunk: u32, bits: u32 },
    #[error("{what} must be strictly increasing; {after} follows {before}")]
    Order { what: &'static str, before: u32, after: u32 },
    #[error("the order has crc32c {got:08x}, it says {want:08x}: damaged on the way; send it again")]
    OrderChecksum { got: u32, want: u32 },
    #[error("the manifest's bytes have hash {got}, the message says {want}")]
    ManifestHash { got: StoreHash, want: StoreHash },
    #[error("store: {0}")]
    Store(String),
}

/// `text` cut to at most `max` bytes at a character's border, marked where it was cut.
#[must_use]
pub fn clip(text: &str, max: usize) -> String {
    if text.len() <= max {
        return text.to_owned();
    }
    let end = (0..=max).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
    format!("{}...", &text[..end])
}

fn text(what: &'static str, text: String, max: usize) -> Result<String, WireError> {
    if text.len() > max { Err(WireError::Text { what, got: text.len(), max }) } else { Ok(text) }
}

fn at_most(what: &'static str, got: usize, max: usize) -> Result<(), WireError> {
    if got > max { Err(WireError::TooMany { what, got: got as u64, max: max as u64 }) } else { Ok(()) }
}

fn duration(what: &'static str, value: f64) -> Result<f64, WireError> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(WireError::Duration { what, value }) }
}

fn tree_node(id: u64) -> Result<TreeNode, WireError> {
    if id == 0 { Err(WireError::NoTreeNode) } else { Ok(TreeNode(id)) }
}

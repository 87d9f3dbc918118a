//! What a compositor orders from a node for one frame.

use brickcast_volume::lod::Borders;
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::{ChunkId, Epoch, FrameId, SessionId, StoreHash, TreeNode};

use crate::tile_rect::TileRect;

/// The most layers of one order. A tree has at most 504 chunks, and layers are disjoint subtrees.
pub const MAX_LAYERS: usize = 4096;
/// The coarsest level that an order can be of: the longest axis of a volume halved until nothing is left.
pub const MAX_LEVEL: u8 = 32;
/// The most chunks of one order, all layers together.
pub const MAX_CHUNKS: usize = 65_536;
/// The most (layer, tile) pairs of one order: what the other side's ledger must hold.
pub const MAX_TILES_OWED: u64 = 1 << 24;

/// The layers of one frame that one node renders. Valid by construction where it came through `TryFrom`: at least one
/// layer, no layer twice or inside another, no chunk twice, every tile inside the picture; f32 transport in exact
/// mode and of projections.
/// What depends on the store (whether node and chunks exist) is checked by the node.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderOrder {
    /// Random, the same in all orders and calls of a session.
    pub session: SessionId,
    pub frame: FrameId,
    pub epoch: Epoch,
    pub store: StoreHash,
    pub scene: Scene,
    pub transport: Transport,
    pub layers: Vec<LayerOrder>,
    /// Of which levels of the volume the chunks are drawn, the finest first; none where all are of `store` itself,
    /// which is the finest.
    pub parts: Vec<LevelPart>,
}

/// What of an order is drawn on one level.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelPart {
    pub level: u8,
    /// That level's.
    pub store: StoreHash,
    /// Of the order's store; each stands for the level's chunk in which it lies.
    pub chunks: Vec<ChunkId>,
    /// Where the level's chunks meet those of other levels.
    pub borders: Option<Borders>,
}

/// A node of the merge tree, to be rendered whole from `chunks` for `tiles`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LayerOrder {
    pub node: TreeNode,
    /// Those under `node` that may have something to show.
    pub chunks: Vec<ChunkId>,
    pub tiles: TileRect,
}

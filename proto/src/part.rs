//! What a node answers: tiles, explicit empties, signs of life, and the receipt last.

use brickcast_volume::{ChunkId, Epoch, FrameId, TreeNode};

use crate::tile::EncodedTile;

/// One message of a frame's stream.
#[derive(Debug, Clone, PartialEq)]
pub struct FramePart {
    pub frame: FrameId,
    pub epoch: Epoch,
    pub part: Part,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// The pixels of one ordered (layer, tile) pair.
    Tile(TilePart),
    /// Ordered tiles in which the layer has nothing to show: indices row-major in the layer's tile rectangle, strictly
    /// increasing, at least one.
    Empty { node: TreeNode, tiles: Vec<u32> },
    /// The order waits or is worked on. `work` grows whenever the node has done something, for whomever.
    Progress { work: u64 },
    /// The last message: everything ordered was answered.
    Receipt(Receipt),
}

#[derive(Debug, Clone, PartialEq)]
pub struct TilePart {
    pub node: TreeNode,
    /// In units of [`crate::TILE`] pixels.
    pub tile: [u32; 2],
    pub pixels: EncodedTile,
}

/// What the rays of a frame did in one chunk on one node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ChunkCost {
    pub chunk: ChunkId,
    /// Reads of the volume, codes or labels, probes included.
    pub samples: u64,
    /// Jumps that read nothing of these.
    pub skips: u64,
}

impl ChunkCost {
    /// What a skip costs where a sample costs 1.
    pub const SKIP: f64 = 0.3;

    /// In units of one sample.
    #[must_use]
    pub fn units(&self) -> f64 {
        self.samples as f64 + Self::SKIP * self.skips as f64
    }
}

/// What a frame cost on one node.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Receipt {
    /// Wall milliseconds from order to last tile; finite, not negative.
    pub render_ms: f64,
    /// Reads of the volume, codes or labels, probes included.
    pub samples: u64,
    /// Sample positions integrated; a leap counts all that it covers.
    pub positions: u64,
    /// Of these, the positions that leaps covered.
    pub leapt_positions: u64,
    /// Bricks rendered.
    pub bricks: u32,
    pub layers: u32,
    /// Tiles with pixels.
    pub tiles: u32,
    pub empty_tiles: u32,
    /// Milliseconds spent loading bricks that were not resident.
    pub load_ms: f64,
    /// Bytes of voxels decoded from the store for this frame.
    pub decoded_bytes: u64,
    /// Bytes of voxels that the loaded bricks own.
    pub owned_bytes: u64,
    /// Bricks drawn from V'.
    pub flattened_bricks: u32,
    /// Of these, bricks inside one region: drawn without a texture.
    pub uniform_bricks: u32,
    /// Bricks that could leap, and that the scene's tolerance forbids it.
    pub over_tolerance_bricks: u32,
    /// Turns of rays that jumped and read nothing but a macrocell.
    pub skips: u64,
    /// Milliseconds of the node's own in rendering, loading left out, times its throttle; finite, not negative. Where
    /// the processor renders, processor time of the process, all threads together: nodes inside one process share that
    /// clock, so that each counts what the others do meanwhile. Wall time where a GPU does.
    pub work_ms: f64,
    /// Of the chunks that were rendered, by strictly increasing index, at most [`crate::order::MAX_CHUNKS`].
    pub costs: Vec<ChunkCost>,
}

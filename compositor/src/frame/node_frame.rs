//! What one node did for a frame, and how it failed.

use brickcast_proto::{ChunkCost, NodeDescription, Receipt};
use serde::Serialize;

/// One node's share of a frame.
#[derive(Debug, Clone, Default, Serialize)]
pub struct NodeFrame {
    pub address: String,
    /// Unique per process.
    pub node_id: String,
    pub version: String,
    pub backend: String,
    pub adapter: String,
    /// Order to last tile, on the node's clock.
    pub render_ms: f64,
    pub bricks: u32,
    pub samples: u64,
    pub positions: u64,
    /// Of the positions, those that leaps covered.
    pub leapt_positions: u64,
    /// Samples, and a part of one for every skip: what balancing counts.
    pub cost: f64,
    /// How many times slower than it could be the node declares to be.
    pub throttle: f64,
    /// Its own time for rendering, throttle included.
    pub work_ms: f64,
    /// Bricks drawn from V'; of these, bricks inside one region; bricks that the tolerance forbids to leap.
    pub flattened_bricks: u32,
    pub uniform_bricks: u32,
    pub over_tolerance_bricks: u32,
    /// Layers with pixels that it contributed.
    pub layers: usize,
    /// Time spent in this frame loading bricks that were not resident.
    pub load_ms: f64,
    pub decoded_bytes: u64,
    pub owned_bytes: u64,
}

impl NodeFrame {
    #[must_use]
    pub fn new(address: &str, node: &NodeDescription) -> Self {
        Self {
            address: address.to_owned(),
            node_id: node.node_id.clone(),
            version: node.version.clone(),
            backend: node.backend.clone(),
            adapter: node.adapter.clone(),
            throttle: node.throttle.get(),
            ..Self::default()
        }
    }

    /// Adds what the node's receipt says; a node that takes over for another gives several in a frame.
    pub fn take(&mut self, receipt: &Receipt) {
        self.render_ms += receipt.render_ms;
        self.bricks += receipt.bricks;
        self.samples += receipt.samples;
        self.positions += receipt.positions;
        self.leapt_positions += receipt.leapt_positions;
        self.cost += receipt.costs.iter().map(ChunkCost::units).sum::<f64>();
        self.work_ms += receipt.work_ms;
        self.flattened_bricks += receipt.flattened_bricks;
        self.uniform_bricks += receipt.uniform_bricks;
        self.over_tolerance_bricks += receipt.over_tolerance_bricks;
        self.load_ms += receipt.load_ms;
        self.decoded_bytes += receipt.decoded_bytes;
        self.owned_bytes += receipt.owned_bytes;
    }
}

/// A node that failed during a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LostNode {
    pub address: String,
    pub why: String,
}

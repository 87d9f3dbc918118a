//! What a frame took, as `--stats` and the bench report it.

use brickcast_proto::{ChunkCost, NodeDescription, Receipt};
use serde::Serialize;

use crate::balanced::BalanceStats;

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

/// What went wrong in a frame, and was made good.
#[derive(Debug, Clone, Default, Serialize)]
pub struct FrameFaults {
    /// Version of the chunk-to-node table.
    pub epoch: u64,
    /// Layers that were void and ordered again.
    pub reissued: usize,
    pub lost: Vec<LostNode>,
}

/// One frame.
#[derive(Debug, Clone, Serialize)]
pub struct FrameStats {
    /// Order to merged picture.
    pub frame_ms: f64,
    /// Reads of the volume, codes or labels, probes included.
    pub samples: u64,
    /// Sample positions integrated; a leap counts all that it covers.
    pub positions: u64,
    /// Of the positions, those that leaps covered.
    pub leapt_positions: u64,
    /// Tiles with pixels that arrived.
    pub tiles: u64,
    pub bytes_received: u64,
    pub complete: bool,
    #[serde(flatten)]
    pub faults: FrameFaults,
    pub nodes: Vec<NodeFrame>,
    /// Where the session balances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub balance: Option<BalanceStats>,
}

impl FrameStats {
    #[must_use]
    pub fn sum(
        frame_ms: f64,
        (tiles, bytes_received): (u64, u64),
        complete: bool,
        faults: FrameFaults,
        nodes: Vec<NodeFrame>,
    ) -> Self {
        Self {
            frame_ms,
            samples: nodes.iter().map(|n| n.samples).sum(),
            positions: nodes.iter().map(|n| n.positions).sum(),
            leapt_positions: nodes.iter().map(|n| n.leapt_positions).sum(),
            tiles,
            bytes_received,
            complete,
            faults,
            nodes,
            balance: None,
        }
    }
}

/// Loading ahead of the first frame.
#[derive(Debug, Clone, Serialize)]
pub struct LoadStats {
    pub load_ms: f64,
    /// Bytes of voxels decoded from the store, ghost layers included.
    pub decoded_bytes: u64,
    /// Bytes of voxels that the loaded bricks own.
    pub owned_bytes: u64,
    /// Bricks that the transfer function shows.
    pub shown_bricks: usize,
    /// False where a node's budget holds fewer bricks than it was given: frames load on the way.
    pub fits: bool,
}

/// What `--stats` writes: sums over the frames, and arrays where there are several; bricks are those of the last frame.
#[must_use]
pub fn report(load: &LoadStats, frames: &[FrameStats], first_frame_ms: f64) -> serde_json::Value {
    let sum = |of: fn(&FrameStats) -> u64| frames.iter().map(of).sum::<u64>();
    let times: Vec<f64> = frames.iter().map(|f| f.frame_ms).collect();
    let decoded = load.decoded_bytes + frames.iter().flat_map(|f| &f.nodes).map(|n| n.decoded_bytes).sum::<u64>();
    let owned = load.owned_bytes + frames.iter().flat_map(|f| &f.nodes).map(|n| n.owned_bytes).sum::<u64>();
    let nodes: Vec<NodeFrame> = frames.last().map(|f| f.nodes.clone()).unwrap_or_default();
    let mut out = serde_json::json!({
        "frame_ms": if let [one] = times[..] { serde_json::json!(one) } else { serde_json::json!(times) },
        "load_ms": load.load_ms,
        "first_frame_ms": first_frame_ms,
        "samples": sum(|f| f.samples),
        "positions": sum(|f| f.positions),
        "leapt_positions": sum(|f| f.leapt_positions),
        "flattened_bricks": nodes.iter().map(|n| n.flattened_bricks).sum::<u32>(),
        "uniform_bricks": nodes.iter().map(|n| n.uniform_bricks).sum::<u32>(),
        "over_tolerance_bricks": nodes.iter().map(|n| n.over_tolerance_bricks).sum::<u32>(),
        "tiles": sum(|f| f.tiles),
        "bytes_received": sum(|f| f.bytes_received),
        "complete": frames.iter().all(|f| f.complete),
        "epoch": frames.last().map_or(0, |f| f.faults.epoch),
        "reissued": frames.iter().map(|f| f.faults.reissued).sum::<usize>(),
        "lost": frames.iter().flat_map(|f| f.faults.lost.clone()).collect::<Vec<_>>(),
        "decoded_bytes": decoded,
        "owned_bytes": owned,
        "decoded_per_owned": if owned > 0 { decoded as f64 / owned as f64 } else { 0.0 },
        "shown_bricks": load.shown_bricks,
        "nodes": nodes,
    });
    if frames.len() > 1 {
        out["frames"] = serde_json::json!(frames);
    }
    out
}

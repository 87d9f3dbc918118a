//! What the balancer is told and what it answers.

use std::collections::BTreeMap;

use brickcast_volume::{ChunkId, PerChunk};
use serde::Serialize;

/// A place in the table of nodes; stays the same while its node is away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct Seat(pub u64);

/// What is known of a chunk before anything is rendered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChunkFacts {
    /// Resident bytes of its shown bricks.
    pub bytes: u64,
    /// Samples to expect per sample position in its box: the share of its bricks that are shown.
    pub prior: f64,
}

/// What a node says of itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeFacts {
    /// How many times slower than it could be it declares to be; 1 is full speed.
    pub throttle: f64,
    /// Bytes of bricks that it can hold.
    pub budget: u64,
}

/// What is shown, whatever the view: one transfer function, step and style. The same chunk costs each its own.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LookId(pub u64);

/// What a view asks of every chunk.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Demand {
    pub look: LookId,
    /// In each chunk, per strip of screen tiles (along the longer side of its tile rectangle): sample positions inside
    /// its box. No strips: not in view.
    pub strips: PerChunk<Vec<f64>>,
}

/// One owner's part of a chunk in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    pub seat: Seat,
    /// Strips of screen tiles, half-open, as [`Demand::strips`] counts them.
    pub strips: [u32; 2],
}

/// Who renders what of one frame.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Division {
    /// Per chunk in view: disjoint parts that cover its strips; the primary's first. Empty while no node is present.
    pub chunks: BTreeMap<ChunkId, Vec<Part>>,
    /// Chunks that nobody held, and who loads them on the way.
    pub adopted: Vec<(Seat, ChunkId)>,
    /// Copies that are given up on nodes without room; another present node holds each.
    pub dropped: Vec<(Seat, ChunkId)>,
}

impl Division {
    /// True where every chunk in view is whole on one node: layers need no cut.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.chunks.values().all(|parts| parts.len() == 1)
    }
}

/// What a frame turned out to cost.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Observed {
    /// Chunks that were rendered completely: cost, summed over their owners.
    pub chunks: Vec<(ChunkId, f64)>,
    /// Nodes that answered: time of rendering in ms, cost summed over their parts.
    pub nodes: Vec<(Seat, f64, f64)>,
}

/// Why a chunk is loaded on another node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Another holder, to share the work.
    Copy,
    /// The node becomes its holder and primary, the old one drops it.
    Move,
}

/// Chunks for a node to load beside its frames.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Load {
    /// Tells one request from another.
    pub id: u64,
    pub seat: Seat,
    pub chunks: Vec<ChunkId>,
    pub bytes: u64,
    /// Copies that the node gives up first; another present node holds each.
    pub drops: Vec<ChunkId>,
    pub reason: Reason,
}

/// How a [`Load`] ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoadOutcome {
    Loaded { ms: f64 },
    Failed,
    DoesNotFit,
}

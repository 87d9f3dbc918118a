//! What one node's answers cost.

use brickcast_proto::Receipt;
use brickcast_volume::ChunkId;

/// What one node's answers cost.
#[derive(Debug, Clone, Default)]
pub(crate) struct NodeCost {
    /// In the list of workers.
    pub(crate) position: usize,
    /// Its own time for rendering, throttle included.
    pub(crate) work_ms: f64,
    /// Chunks and their cost, in samples.
    pub(crate) chunks: Vec<(ChunkId, f64)>,
}

impl NodeCost {
    pub(crate) fn cost(&self) -> f64 {
        self.chunks.iter().map(|(_, cost)| cost).sum()
    }

    pub(super) fn take(&mut self, receipt: &Receipt) {
        self.work_ms += receipt.work_ms;
        self.chunks.extend(receipt.costs.iter().map(|c| (c.chunk, c.units())));
    }
}

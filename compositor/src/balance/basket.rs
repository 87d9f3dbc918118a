//! Requests to load, as they are put together.

use brickcast_volume::ChunkId;

use super::balancer::Balancer;
use super::types::{Load, Reason};

/// A request that is being put together.
pub(super) struct Basket {
    pub(super) index: usize,
    pub(super) chunks: Vec<ChunkId>,
    pub(super) drops: Vec<ChunkId>,
    bytes: u64,
}

impl Basket {
    pub(super) fn new(index: usize) -> Self {
        Self { index, chunks: Vec::new(), drops: Vec::new(), bytes: 0 }
    }

    pub(super) fn has_place(&self, b: &Balancer, bytes: u64) -> bool {
        self.chunks.len() < b.settings.request_chunks
            && (self.chunks.is_empty() || self.bytes + bytes <= b.settings.request_bytes)
    }

    /// Reserves a chunk's bytes; the caller has seen that there is room.
    pub(super) fn take(&mut self, b: &mut Balancer, chunk: ChunkId) {
        let bytes = b.table.bytes[chunk];
        self.chunks.push(chunk);
        self.bytes += bytes;
        b.table.nodes[self.index].reserved += bytes;
        b.table.nodes[self.index].asked.insert(chunk, b.frame);
    }
}

pub(super) fn send(b: &mut Balancer, baskets: Vec<Basket>, reason: Reason) -> Vec<Load> {
    let mut loads = Vec::new();
    for Basket { index, chunks, drops, bytes } in baskets.into_iter().filter(|basket| !basket.chunks.is_empty()) {
        b.next_load += 1;
        let node = &mut b.table.nodes[index];
        let load = Load { id: b.next_load, seat: node.seat, chunks, bytes, drops, reason };
        node.outstanding = Some(load.clone());
        loads.push(load);
    }
    loads
}

/// True where the node was not asked for the chunk lately, does not hold it and does not get it.
pub(super) fn may_load(b: &Balancer, index: usize, chunk: ChunkId) -> bool {
    let node = &b.table.nodes[index];
    !node.held[chunk] && node.asked.get(&chunk).is_none_or(|at| b.frame - at >= b.settings.hold_frames)
}

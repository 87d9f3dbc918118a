//! Who is present and holds what, in bytes.

use std::collections::BTreeMap;

use brickcast_volume::{ChunkId, PerChunk};

use super::types::{Load, NodeFacts, Seat};

#[derive(Debug, Clone)]
pub(super) struct Node {
    pub(super) seat: Seat,
    pub(super) facts: NodeFacts,
    pub(super) present: bool,
    pub(super) held: PerChunk<bool>,
    /// Bytes of the chunks held, and of those on the way.
    pub(super) bytes: u64,
    pub(super) reserved: u64,
    pub(super) outstanding: Option<Load>,
    /// Of each chunk that was ever asked for in the background: the frame.
    pub(super) asked: BTreeMap<ChunkId, u64>,
}

impl Node {
    /// Bytes that it can hold besides.
    pub(super) fn room(&self) -> u64 {
        self.facts.budget.saturating_sub(self.bytes + self.reserved)
    }
}

/// Nodes by index, in the order in which their seats were first taken.
#[derive(Debug, Clone)]
pub(super) struct Table {
    pub(super) nodes: Vec<Node>,
    seats: BTreeMap<Seat, usize>,
    pub(super) bytes: PerChunk<u64>,
    /// The present nodes that hold it, ascending.
    pub(super) holders: PerChunk<Vec<usize>>,
}

impl Table {
    pub(super) fn new(bytes: PerChunk<u64>) -> Self {
        let holders = PerChunk::filled(Vec::new(), bytes.count());
        Self { nodes: Vec::new(), seats: BTreeMap::new(), holders, bytes }
    }

    pub(super) fn index(&self, seat: Seat) -> Option<usize> {
        self.seats.get(&seat).copied()
    }

    /// The seat's node is present, and holds nothing yet.
    pub(super) fn seat(&mut self, seat: Seat, facts: NodeFacts) -> usize {
        let index = *self.seats.entry(seat).or_insert(self.nodes.len());
        if index == self.nodes.len() {
            let held = PerChunk::filled(false, self.bytes.count());
            let asked = BTreeMap::new();
            self.nodes.push(Node { seat, facts, present: true, held, bytes: 0, reserved: 0, outstanding: None, asked });
        }
        self.nodes[index].facts = facts;
        self.nodes[index].present = true;
        index
    }

    /// The node is away: it holds nothing, and nothing is on its way to it.
    pub(super) fn vacate(&mut self, index: usize) {
        for chunk in self.bytes.ids() {
            self.drop(index, chunk);
        }
        let node = &mut self.nodes[index];
        (node.present, node.reserved, node.outstanding) = (false, 0, None);
    }

    /// Chunks have other sizes from now on.
    pub(super) fn weigh(&mut self, bytes: PerChunk<u64>) {
        self.bytes = bytes;
        for node in &mut self.nodes {
            let held = node.held.values().zip(self.bytes.values()).filter(|(held, _)| **held);
            node.bytes = held.map(|(_, bytes)| bytes).sum();
        }
    }

    pub(super) fn present(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.nodes.len()).filter(|&n| self.nodes[n].present)
    }

    pub(super) fn hold(&mut self, index: usize, chunk: ChunkId) {
        let node = &mut self.nodes[index];
        if !std::mem::replace(&mut node.held[chunk], true) {
            node.bytes += self.bytes[chunk];
            let holders = &mut self.holders[chunk];
            let place = holders.partition_point(|&h| h < index);
            holders.insert(place, index);
        }
    }

    pub(super) fn drop(&mut self, index: usize, chunk: ChunkId) {
        let node = &mut self.nodes[index];
        if std::mem::replace(&mut node.held[chunk], false) {
            node.bytes -= self.bytes[chunk];
            self.holders[chunk].retain(|&h| h != index);
        }
    }
}

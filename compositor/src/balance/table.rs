//! Who is present and holds what, in bytes.

use std::collections::BTreeMap;

use super::types::{Load, NodeFacts, Seat};

#[derive(Debug, Clone)]
pub(super) struct Node {
    pub(super) seat: Seat,
    pub(super) facts: NodeFacts,
    pub(super) present: bool,
    /// Per chunk.
    pub(super) held: Vec<bool>,
    /// Bytes of the chunks held, and of those on the way.
    pub(super) bytes: u64,
    pub(super) reserved: u64,
    pub(super) outstanding: Option<Load>,
    /// Per chunk that was ever asked for in the background: the frame.
    pub(super) asked: BTreeMap<usize, u64>,
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
    /// Per chunk: bytes, and the present nodes that hold it, ascending.
    pub(super) bytes: Vec<u64>,
    pub(super) holders: Vec<Vec<usize>>,
}

impl Table {
    pub(super) fn new(bytes: Vec<u64>) -> Self {
        Self { nodes: Vec::new(), seats: BTreeMap::new(), holders: vec![Vec::new(); bytes.len()], bytes }
    }

    pub(super) fn index(&self, seat: Seat) -> Option<usize> {
        self.seats.get(&seat).copied()
    }

    /// The seat's node is present, and holds nothing yet.
    pub(super) fn seat(&mut self, seat: Seat, facts: NodeFacts) -> usize {
        let index = *self.seats.entry(seat).or_insert(self.nodes.len());
        if index == self.nodes.len() {
            let held = vec![false; self.bytes.len()];
            let asked = BTreeMap::new();
            self.nodes.push(Node { seat, facts, present: true, held, bytes: 0, reserved: 0, outstanding: None, asked });
        }
        self.nodes[index].facts = facts;
        self.nodes[index].present = true;
        index
    }

    /// The node is away: it holds nothing, and nothing is on its way to it.
    pub(super) fn vacate(&mut self, index: usize) {
        for chunk in 0..self.bytes.len() {
            self.drop(index, chunk);
        }
        let node = &mut self.nodes[index];
        (node.present, node.reserved, node.outstanding) = (false, 0, None);
    }

    /// Chunks have other sizes from now on.
    pub(super) fn weigh(&mut self, bytes: Vec<u64>) {
        self.bytes = bytes;
        for node in &mut self.nodes {
            let held = node.held.iter().zip(&self.bytes).filter(|(held, _)| **held);
            node.bytes = held.map(|(_, bytes)| bytes).sum();
        }
    }

    pub(super) fn present(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.nodes.len()).filter(|&n| self.nodes[n].present)
    }

    pub(super) fn hold(&mut self, index: usize, chunk: usize) {
        let node = &mut self.nodes[index];
        if !std::mem::replace(&mut node.held[chunk], true) {
            node.bytes += self.bytes[chunk];
            let holders = &mut self.holders[chunk];
            let place = holders.partition_point(|&h| h < index);
            holders.insert(place, index);
        }
    }

    pub(super) fn drop(&mut self, index: usize, chunk: usize) {
        let node = &mut self.nodes[index];
        if std::mem::replace(&mut node.held[chunk], false) {
            node.bytes -= self.bytes[chunk];
            self.holders[chunk].retain(|&h| h != index);
        }
    }
}

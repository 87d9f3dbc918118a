//! Which node renders which chunk, so that no node waits for another (docs/adr/0005-balance.md).
//!
//! Pure: no clock, no network, no order of a hash map. Equal calls give equal decisions, and the session and the simulator
//! ([`simulate`]) make the very same calls: `join` and `leave` between frames, then `divide`, `observe`, `background` per frame.
//!
//! Words: a *holder* has a chunk resident, an *owner* is a holder that renders a part of it in a frame, the *primary* is the owner that
//! keeps it from frame to frame. Cost counts in samples of the kernel (a skip is [`brickcast_proto::ChunkCost::SKIP`] of one); load is cost times the
//! node's time per unit.

mod background;
mod copies;
mod divide;
mod predict;
mod report;
mod settings;
pub mod simulate;
mod spread;
mod table;

use std::collections::BTreeMap;

use serde::Serialize;

use self::predict::Predictor;
use self::report::Totals;
use self::table::Table;

pub use self::report::{Report, SeatLoad, max_over_mean};
pub use self::settings::{LoadBy, Mode, Settings};

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

/// What a view asks of every chunk.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Demand {
    /// Per chunk, and in it per strip of screen tiles (along the longer side of its tile rectangle): sample positions inside its box.
    /// No strips: not in view.
    pub strips: Vec<Vec<f64>>,
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
    pub chunks: BTreeMap<u32, Vec<Part>>,
    /// Chunks that nobody held, and who loads them on the way.
    pub adopted: Vec<(Seat, u32)>,
    /// Copies that are given up on nodes without room; another present node holds each.
    pub dropped: Vec<(Seat, u32)>,
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
    pub chunks: Vec<(u32, f64)>,
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
    pub chunks: Vec<u32>,
    pub bytes: u64,
    /// Copies that the node gives up first; another present node holds each.
    pub drops: Vec<u32>,
    pub reason: Reason,
}

/// How a [`Load`] ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoadOutcome {
    Loaded { ms: f64 },
    Failed,
    DoesNotFit,
}

/// Decides, and remembers what it needs for that.
///
/// A division gives every chunk in view to present holders, never lost, never doubled. The bytes that a node is told to hold
/// exceed its budget only where even one copy of everything found no room. A chunk's primary changes at most once in
/// [`Settings::hold_frames`] unless it left, and so seldom is a chunk loaded on the same node.
#[derive(Debug, Clone)]
pub struct Balancer {
    settings: Settings,
    chunks: Vec<ChunkFacts>,
    table: Table,
    predictor: Predictor,
    /// The frame that was divided last; the first is 1.
    frame: u64,
    /// Per chunk: the index of its primary, and the last frame when another took over from one that was there.
    primary: Vec<Option<usize>>,
    changed: Vec<Option<u64>>,
    /// Per chunk: its share of a frame's cost, the largest that was seen, fading.
    heat: Vec<f64>,
    /// Loads that ended since the last division.
    arrived: Vec<Load>,
    /// Frames in a row whose predicted maximum is too high.
    strained: u64,
    next_load: u64,
    totals: Totals,
}

impl Balancer {
    #[must_use]
    pub fn new(settings: Settings, chunks: Vec<ChunkFacts>) -> Self {
        let count = chunks.len();
        Self {
            table: Table::new(chunks.iter().map(|c| c.bytes).collect()),
            predictor: Predictor::new(&settings, &chunks),
            settings,
            chunks,
            frame: 0,
            primary: vec![None; count],
            changed: vec![None; count],
            heat: vec![0.0; count],
            arrived: Vec::new(),
            strained: 0,
            next_load: 0,
            totals: Totals::default(),
        }
    }

    /// A node enters, or returns to its seat, with the chunks that it has loaded (unknown ones are ignored). Between frames.
    pub fn join(&mut self, seat: Seat, facts: NodeFacts, holds: &[u32]) {
        self.leave(seat);
        let index = self.table.seat(seat, facts);
        self.predictor.node(index, facts.throttle);
        for &chunk in holds.iter().filter(|c| (**c as usize) < self.chunks.len()) {
            self.table.hold(index, chunk as usize);
        }
    }

    /// A node is gone, with all that it held. Between frames; a seat that nobody has is ignored.
    pub fn leave(&mut self, seat: Seat) {
        let Some(index) = self.table.index(seat) else { return };
        self.table.vacate(index);
        self.arrived.retain(|load| load.seat != seat);
        for primary in self.primary.iter_mut().filter(|p| **p == Some(index)) {
            *primary = None;
        }
    }

    /// Who renders what of the next frame; loads that ended become effective with it.
    ///
    /// Empty while no node is present.
    pub fn divide(&mut self, demand: &Demand) -> Division {
        self.frame += 1;
        self.settle();
        self.predictor.ask(demand);
        divide::divide(self)
    }

    /// Learns from the frame that was divided last.
    pub fn observe(&mut self, seen: &Observed) {
        self.predictor.learn_chunks(&seen.chunks);
        let known = |&(seat, ms, cost): &(Seat, f64, f64)| Some((self.table.index(seat)?, ms, cost));
        let nodes: Vec<(usize, f64, f64)> = seen.nodes.iter().filter_map(known).collect();
        self.predictor.learn_nodes(&nodes);
        self.totals.measured = nodes
            .iter()
            .filter(|(index, ..)| self.table.nodes[*index].present)
            .map(|&(index, ms, cost)| (index, self.predictor.load_of(index, ms, cost)))
            .collect();
    }

    /// What to load beside the frames, to be started now. Each is outstanding until [`Balancer::finished`] hears of it, or its node leaves.
    pub fn background(&mut self) -> Vec<Load> {
        background::background(self)
    }

    /// A load ended. A request that is no longer outstanding is ignored.
    pub fn finished(&mut self, load: &Load, outcome: LoadOutcome) {
        let Some(index) = self.table.index(load.seat) else { return };
        let node = &mut self.table.nodes[index];
        if node.outstanding.as_ref().is_none_or(|o| o.id != load.id) {
            return;
        }
        let Some(load) = node.outstanding.take() else { return };
        match outcome {
            LoadOutcome::Loaded { ms } => {
                self.predictor.learn_rate(load.bytes, ms);
                self.totals.bytes_loaded += load.bytes;
                self.arrived.push(load);
            }
            LoadOutcome::Failed => node.reserved -= load.bytes,
            LoadOutcome::DoesNotFit => {
                node.reserved -= load.bytes;
                // It knows better than what it said of itself.
                node.facts.budget = node.facts.budget.min(node.bytes);
            }
        }
    }

    /// The chunks that a seat's node holds, or is to adopt; ascending.
    #[must_use]
    pub fn holds(&self, seat: Seat) -> Vec<u32> {
        let index = self.table.index(seat);
        let held = |index: usize| (0..self.chunks.len()).filter(move |&c| self.table.nodes[index].held[c]);
        index.into_iter().flat_map(held).map(|c| c as u32).collect()
    }

    /// What was decided and measured so far.
    #[must_use]
    pub fn report(&self) -> Report {
        report::report(self)
    }

    /// Applies the loads that ended since the last frame.
    fn settle(&mut self) {
        for load in std::mem::take(&mut self.arrived) {
            let Some(index) = self.table.index(load.seat) else { continue };
            self.table.nodes[index].reserved -= load.bytes;
            for &chunk in &load.chunks {
                let chunk = chunk as usize;
                self.table.hold(index, chunk);
                match load.reason {
                    Reason::Copy => self.totals.copies += 1,
                    Reason::Move => self.take_over(index, chunk),
                }
            }
        }
    }

    /// Makes a chunk that was moved the new node's, unless its primary changed meanwhile: then it is a copy.
    fn take_over(&mut self, index: usize, chunk: usize) {
        let old = self.primary[chunk];
        if self.is_settled(chunk) && old.is_some() {
            self.totals.copies += 1;
            return;
        }
        self.totals.moves += 1;
        self.appoint(index, chunk);
        if let Some(old) = old.filter(|old| *old != index) {
            self.table.drop(old, chunk);
        }
    }

    /// The node becomes the chunk's primary.
    fn appoint(&mut self, index: usize, chunk: usize) {
        let old = self.primary[chunk].replace(index);
        if old.is_some_and(|old| old != index) {
            self.changed[chunk] = Some(self.frame);
            self.totals.handovers += 1;
        }
    }

    /// True while a chunk's primary changed too recently to change again.
    fn is_settled(&self, chunk: usize) -> bool {
        self.changed[chunk].is_some_and(|at| self.frame - at < self.settings.hold_frames)
    }
}

#[cfg(test)]
mod property;
#[cfg(test)]
mod tests;

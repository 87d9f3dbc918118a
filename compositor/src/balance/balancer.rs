//! What the balancer knows between two calls, and how it learns it.

use brickcast_volume::{ChunkId, PerChunk};

use super::predict::Predictor;
use super::settings::Settings;
use super::table::Table;
use super::totals::Totals;
use super::types::{ChunkFacts, Demand, Load, LoadOutcome, LookId, NodeFacts, Observed, Reason, Seat};

/// Decides, and remembers what it needs for that. What it decides is in the files of that name:
/// [`divide`](Self::divide), [`background`](Self::background), [`report`](Self::report).
///
/// A division gives every chunk in view to present holders, never lost, never doubled. The bytes that a node is told to
/// hold exceed its budget only where even one copy of everything found no room. A chunk's primary changes at most once
/// in [`Settings::hold_frames`] unless it left, and so seldom is a chunk loaded on the same node.
#[derive(Debug, Clone)]
pub struct Balancer {
    pub(super) settings: Settings,
    pub(super) chunks: PerChunk<ChunkFacts>,
    pub(super) table: Table,
    pub(super) predictor: Predictor,
    /// The frame that was divided last; the first is 1.
    pub(super) frame: u64,
    /// The index of its primary, and the last frame when another took over from one that was there.
    pub(super) primary: PerChunk<Option<usize>>,
    pub(super) changed: PerChunk<Option<u64>>,
    /// Its share of a frame's cost, the largest that was seen, fading.
    pub(super) heat: PerChunk<f64>,
    /// Loads that ended since the last division.
    pub(super) arrived: Vec<Load>,
    /// Frames in a row whose predicted maximum is too high.
    pub(super) strained: u64,
    pub(super) next_load: u64,
    pub(super) totals: Totals,
}

impl Balancer {
    #[must_use]
    pub fn new(settings: Settings, chunks: PerChunk<ChunkFacts>) -> Self {
        let count = chunks.count();
        Self {
            table: Table::new(chunks.values().map(|c| c.bytes).collect()),
            predictor: Predictor::new(&settings, &chunks),
            settings,
            chunks,
            frame: 0,
            primary: PerChunk::filled(None, count),
            changed: PerChunk::filled(None, count),
            heat: PerChunk::filled(0.0, count),
            arrived: Vec::new(),
            strained: 0,
            next_load: 0,
            totals: Totals::default(),
        }
    }

    /// From now on these looks are rendered, and over all of them these are the facts; of as many chunks as before. Who
    /// holds what and how fast nodes are stays known; what was seen of looks that are no longer among them is
    /// forgotten.
    pub fn show(&mut self, looks: &[LookId], chunks: PerChunk<ChunkFacts>) {
        if chunks.count() != self.chunks.count() {
            return;
        }
        self.table.weigh(chunks.values().map(|c| c.bytes).collect());
        self.predictor.show(looks, &chunks);
        self.chunks = chunks;
    }

    /// A node enters, or returns to its seat, with the chunks that it has loaded (unknown ones are ignored). Between
    /// frames.
    pub fn join(&mut self, seat: Seat, facts: NodeFacts, holds: &[ChunkId]) {
        self.leave(seat);
        let index = self.table.seat(seat, facts);
        self.predictor.node(index, facts.throttle);
        for &chunk in holds.iter().filter(|c| self.chunks.get(**c).is_some()) {
            self.table.hold(index, chunk);
        }
    }

    /// A node is gone, with all that it held. Between frames; a seat that nobody has is ignored.
    pub fn leave(&mut self, seat: Seat) {
        let Some(index) = self.table.index(seat) else { return };
        self.table.vacate(index);
        self.arrived.retain(|load| load.seat != seat);
        for primary in self.primary.values_mut().filter(|p| **p == Some(index)) {
            *primary = None;
        }
    }

    /// Learns from a frame that was divided for `demand`: the last one, or one that others have overtaken.
    pub fn observe(&mut self, demand: &Demand, seen: &Observed) {
        self.predictor.learn_chunks(demand, &seen.chunks);
        let known = |&(seat, ms, cost): &(Seat, f64, f64)| Some((self.table.index(seat)?, ms, cost));
        let nodes: Vec<(usize, f64, f64)> = seen.nodes.iter().filter_map(known).collect();
        self.predictor.learn_nodes(&nodes);
        self.totals.measured = nodes
            .iter()
            .filter(|(index, ..)| self.table.nodes[*index].present)
            .map(|&(index, ms, cost)| (index, self.predictor.load_of(index, ms, cost)))
            .collect();
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

    /// All chunks, ascending.
    pub fn chunks(&self) -> impl Iterator<Item = ChunkId> + use<> {
        self.chunks.ids()
    }

    /// Who renders a chunk, as far as that is settled: its primary, else who holds it.
    #[must_use]
    pub fn home(&self, chunk: ChunkId) -> Option<Seat> {
        let holder = || self.table.holders.get(chunk)?.first().copied();
        let index = self.primary.get(chunk).copied().flatten().or_else(holder)?;
        Some(self.table.nodes[index].seat)
    }

    /// The chunks that a seat's node holds, or is to adopt; ascending.
    #[must_use]
    pub fn holds(&self, seat: Seat) -> Vec<ChunkId> {
        let index = self.table.index(seat);
        let held = |index: usize| self.chunks.ids().filter(move |&c| self.table.nodes[index].held[c]);
        index.into_iter().flat_map(held).collect()
    }

    /// Applies the loads that ended since the last frame.
    pub(super) fn settle(&mut self) {
        for load in std::mem::take(&mut self.arrived) {
            let Some(index) = self.table.index(load.seat) else { continue };
            self.table.nodes[index].reserved -= load.bytes;
            for &chunk in &load.chunks {
                self.table.hold(index, chunk);
                match load.reason {
                    Reason::Copy => self.totals.copies += 1,
                    Reason::Move => self.take_over(index, chunk),
                }
            }
        }
    }

    /// Makes a chunk that was moved the new node's, unless its primary changed meanwhile: then it is a copy.
    fn take_over(&mut self, index: usize, chunk: ChunkId) {
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
    pub(super) fn appoint(&mut self, index: usize, chunk: ChunkId) {
        let old = self.primary[chunk].replace(index);
        if old.is_some_and(|old| old != index) {
            self.changed[chunk] = Some(self.frame);
            self.totals.handovers += 1;
        }
    }

    /// True while a chunk's primary changed too recently to change again.
    pub(super) fn is_settled(&self, chunk: ChunkId) -> bool {
        self.changed[chunk].is_some_and(|at| self.frame - at < self.settings.hold_frames)
    }
}

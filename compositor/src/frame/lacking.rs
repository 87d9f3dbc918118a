//! What nodes cannot read (docs/adr/0026-what-cannot-be-had.md).
//!
//! Invariant: a chunk is ordered from no node that said it lacks it, and is waited for as long as some node has not. A
//! node that lacks something is well: what else it was ordered it is ordered again.

use brickcast_volume::ChunkId;

use super::Run;
use super::ledger::Ticket;
use super::worker::Lacking;
use crate::cluster::CallError;

impl Run<'_, '_> {
    /// Notes that the ticket's node lacks a brick; false where it said nothing that was not known.
    pub(super) fn notes_lack(&mut self, ticket: Ticket, error: &CallError) -> bool {
        let CallError::Unreadable { brick, .. } = *error else { return false };
        let lacks = &mut self.workers[self.sent[ticket.0].worker].lacks;
        let before = lacks.len();
        for chunk in self.shown.needing(self.order.store, brick) {
            lacks.entry(chunk).or_insert_with(|| Lacking { brick, why: error.to_string() });
        }
        lacks.len() > before
    }

    pub(super) fn lacks(&self, worker: usize, chunk: ChunkId) -> bool {
        self.workers[worker].lacks.contains_key(&chunk)
    }

    /// Some node lacks it, and no other can be asked.
    pub(super) fn nobody_has(&self, chunk: ChunkId) -> bool {
        let mut all = 0..self.workers.len();
        all.clone().any(|w| self.lacks(w, chunk)) && all.all(|w| !self.can_work(w) || self.lacks(w, chunk))
    }

    /// What is missing because nobody has it, each brick once.
    pub(super) fn lacking(&self) -> Vec<Lacking> {
        let missing = || self.ledger.unordered().chunks().filter(|chunk| self.nobody_has(*chunk));
        let of = |chunk: ChunkId| self.workers.iter().find_map(|worker| worker.lacks.get(&chunk)).cloned();
        let mut lacking: Vec<Lacking> = missing().filter_map(of).collect();
        lacking.sort_by_key(|lacking| lacking.brick);
        lacking.dedup_by_key(|lacking| lacking.brick);
        lacking
    }

    /// Nodes that lack what others had: their copy is damaged.
    pub(super) fn damaged(&self) -> impl Iterator<Item = (usize, String)> + '_ {
        self.workers.iter().enumerate().filter_map(|(position, worker)| {
            let (_, lacking) = worker.lacks.iter().find(|(chunk, _)| !self.nobody_has(**chunk))?;
            Some((position, lacking.why.clone()))
        })
    }
}

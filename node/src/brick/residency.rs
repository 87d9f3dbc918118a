//! Bricks in the backend's memory, within what the node's budget has for them.
//!
//! A frame takes a [`Lease`] on all bricks of a batch at once: room for the whole batch, and for what loading it holds
//! meanwhile, is reserved under one lock, so that two frames never wait for each other's bricks half-served. A thread
//! that holds a lease must not ask for another; it may have bricks fetched ahead, which waits for nothing. Each brick
//! is loaded once, whoever asks; leased bricks stay. Which go first: [`visits`].

mod lease;
mod table;
mod threads;
pub mod visits;
mod wanted;

use std::collections::HashSet;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use brickcast_volume::{BrickId, SessionId, StoreHash};

use self::lease::{Claim, Grant};
use self::table::{Slot, State, Table, Users};
use self::visits::Place;
use super::shares::{BrickShares, Need};
use crate::error::NodeError;
use crate::kernel::ResidentBrick;

pub use self::lease::Lease;
pub(crate) use self::threads::beside;
pub use self::wanted::{BrickKey, Coarser, Wanted};

/// How often a waiting thread looks whether its client is still there.
const PATIENCE: Duration = Duration::from_millis(100);

/// Who wants which bricks.
#[derive(Debug, Clone, Copy)]
pub struct Ask<'a> {
    pub session: SessionId,
    /// None twice.
    pub wanted: &'a [Wanted],
    /// Of the frame that they are for, or of the request.
    pub shares: BrickShares,
    /// Where the frame is, if there is one.
    pub place: Option<Place<'a>>,
}

/// Loads one brick into the backend; called from several threads at once.
pub type Load<'a> = dyn Fn(BrickKey) -> Result<Arc<dyn ResidentBrick>, NodeError> + Sync + 'a;

#[derive(Debug)]
pub struct Residency {
    budget: u64,
    table: Mutex<Table>,
    changed: Condvar,
}

/// What is resident.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Occupancy {
    pub bytes: u64,
    pub bricks: usize,
}

impl Residency {
    /// `budget` in bytes, for bricks and what loading them holds.
    #[must_use]
    pub fn new(budget: u64) -> Self {
        Self { budget, table: Mutex::default(), changed: Condvar::new() }
    }

    #[must_use]
    pub fn budget(&self) -> u64 {
        self.budget
    }

    /// How the budget is shared among bricks of which each needs at most `largest`; `is_far`: they come from behind a
    /// network. Nothing where not even one fits.
    #[must_use]
    pub fn shares(&self, largest: Need, is_far: bool) -> Option<BrickShares> {
        BrickShares::of(self.budget, largest, threads::count(is_far))
    }

    #[must_use]
    pub fn occupancy(&self) -> Occupancy {
        let table = self.lock();
        let bricks = table.slots.values().filter(|s| matches!(s.state, State::Ready(_))).count();
        Occupancy { bytes: table.used, bricks }
    }

    /// Bytes of those of `wanted` that are there.
    #[must_use]
    pub fn resident_bytes(&self, wanted: &[Wanted]) -> u64 {
        let table = self.lock();
        let slots = wanted.iter().filter_map(|w| table.slots.get(&w.key));
        slots.filter(|slot| matches!(slot.state, State::Ready(_))).map(|slot| slot.bytes).sum()
    }

    /// Is any of them not there, nor on its way?
    pub(crate) fn lacks(&self, wanted: &[Wanted]) -> bool {
        let table = self.lock();
        wanted.iter().any(|w| !table.slots.contains_key(&w.key))
    }

    /// Lets go of these bricks of a store, however they are drawn, but for those that a lease holds or that another
    /// session used, too. Returns their bytes.
    pub fn release(&self, session: SessionId, store: StoreHash, bricks: &[BrickId]) -> u64 {
        let bricks: HashSet<BrickId> = bricks.iter().copied().collect();
        let mut table = self.lock();
        let gone: Vec<(BrickKey, Slot)> = table
            .slots
            .extract_if(|key, slot| {
                let is_free = slot.pins == 0 && slot.users == Users::One(session);
                is_free && key.store == store && bricks.contains(&key.brick)
            })
            .collect();
        let freed = gone.iter().map(|(_, slot)| slot.bytes).sum();
        table.used = table.used.saturating_sub(freed);
        drop(table);
        self.changed.notify_all();
        freed
    }

    /// Holds all that is asked for, loading what is missing; waits for bricks that others load and for room that others
    /// hold, until `cancelled`.
    ///
    /// # Errors
    /// More than its share at once, a load that failed, `cancelled`.
    pub fn lease(
        &self,
        ask: Ask<'_>,
        load: &Load<'_>,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Lease<'_>, NodeError> {
        let (bytes, budget) = (ask.wanted.iter().map(|w| w.bytes).fold(0, u64::saturating_add), ask.shares.resident);
        if bytes > budget {
            return Err(NodeError::BatchTooLarge { bytes, budget });
        }
        let (mut lease, _grant) = self.reserve(ask, cancelled)?;
        loop {
            let mine = {
                let mut table = self.lock();
                let mine = table.claim(&lease.keys);
                if mine.is_empty() {
                    if let Some(bricks) = table.ready(&lease.keys) {
                        lease.bricks = bricks;
                        return Ok(lease);
                    }
                    if cancelled() {
                        return Err(NodeError::Cancelled);
                    }
                    drop(self.wait(table));
                    continue;
                }
                mine
            };
            lease.loaded.extend(&mine);
            self.load(Claim { residency: self, keys: mine }, ask.shares.at_once, load, cancelled)?;
        }
    }

    /// Loads of what is asked for, in its order, what fits beside that which is held, and holds none of it. Waits for
    /// nobody. Those that were loaded.
    ///
    /// # Errors
    /// A load that failed, `cancelled`.
    pub fn fetch_ahead(
        &self,
        ask: Ask<'_>,
        load: &Load<'_>,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<BrickKey>, NodeError> {
        self.fetch_beside(ask, &[], load, cancelled)
    }

    /// As [`Residency::fetch_ahead`], without bricks of the stores `keep` going for it.
    ///
    /// # Errors
    /// As [`Residency::fetch_ahead`].
    pub fn fetch_beside(
        &self,
        ask: Ask<'_>,
        keep: &[StoreHash],
        load: &Load<'_>,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<BrickKey>, NodeError> {
        let Some((lease, _grant)) = self.reserve_now(ask, keep) else { return Ok(Vec::new()) };
        let mine = self.lock().claim(&lease.keys);
        self.load(Claim { residency: self, keys: mine.clone() }, ask.shares.at_once, load, cancelled)?;
        Ok(mine)
    }

    /// Holds what is asked for, with room for what is missing and for loading it.
    fn reserve(&self, ask: Ask<'_>, cancelled: &dyn Fn() -> bool) -> Result<(Lease<'_>, Grant<'_>), NodeError> {
        let keep: HashSet<BrickKey> = ask.wanted.iter().map(|w| w.key).collect();
        let mut table = self.lock();
        let loading = loop {
            let missing = table.missing(ask.wanted);
            let is_there = ask.wanted.iter().all(|w| table.slots.contains_key(&w.key));
            let loading = if is_there { 0 } else { ask.shares.loading };
            if table.make_room(missing.saturating_add(loading), self.budget, &keep, ask.place) {
                break loading;
            }
            if cancelled() {
                return Err(NodeError::Cancelled);
            }
            table = self.wait(table);
        };
        Ok(self.hold(&mut table, ask.session, ask.wanted, loading))
    }

    /// Reserves as many of those that are missing as there is room for without bricks of `stores` going. Nothing where
    /// there is none, or nothing misses.
    fn reserve_now(&self, ask: Ask<'_>, stores: &[StoreHash]) -> Option<(Lease<'_>, Grant<'_>)> {
        let mut keep: HashSet<BrickKey> = ask.wanted.iter().map(|w| w.key).collect();
        let mut table = self.lock();
        if !stores.is_empty() {
            keep.extend(table.slots.keys().filter(|key| stores.contains(&key.store)));
        }
        let mut left = table.could_be_free(self.budget, &keep).checked_sub(ask.shares.loading)?;
        let fits = |w: &Wanted| {
            let rest = left.checked_sub(w.bytes);
            left = rest.unwrap_or(left);
            rest.is_some()
        };
        let missing = ask.wanted.iter().copied().filter(|w| !table.slots.contains_key(&w.key));
        let wanted: Vec<Wanted> = missing.take_while(fits).collect();
        let bytes: u64 = wanted.iter().map(|w| w.bytes).sum();
        let more = bytes.saturating_add(ask.shares.loading);
        let is_room = !wanted.is_empty() && table.make_room(more, self.budget, &keep, ask.place);
        is_room.then(|| self.hold(&mut table, ask.session, &wanted, ask.shares.loading))
    }

    fn hold(&self, table: &mut Table, session: SessionId, wanted: &[Wanted], loading: u64) -> (Lease<'_>, Grant<'_>) {
        table.pin(session, wanted);
        table.loading = table.loading.saturating_add(loading);
        let keys = wanted.iter().map(|w| w.key).collect();
        let lease = Lease { residency: self, keys, bricks: Vec::new(), loaded: Vec::new() };
        (lease, Grant { residency: self, bytes: loading })
    }

    /// Loads what is claimed in its order, so many at once.
    fn load(
        &self,
        claim: Claim<'_>,
        at_once: usize,
        make: &Load<'_>,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), NodeError> {
        let load = |key: &BrickKey| {
            if cancelled() {
                return Err(NodeError::Cancelled);
            }
            let brick = make(*key)?;
            let mut table = self.lock();
            let now = brick.bytes();
            if let Some(slot) = table.slots.get_mut(key) {
                let before = std::mem::replace(&mut slot.bytes, now);
                slot.state = State::Ready(brick);
                table.used = table.used.saturating_sub(before).saturating_add(now);
            }
            drop(table);
            self.changed.notify_all();
            Ok(())
        };
        threads::for_each(&claim.keys, at_once, load)
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, table: MutexGuard<'a, Table>) -> MutexGuard<'a, Table> {
        self.changed.wait_timeout(table, PATIENCE).unwrap_or_else(PoisonError::into_inner).0
    }
}

#[cfg(test)]
mod tests;

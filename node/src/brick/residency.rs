//! Bricks in the backend's memory, within a budget.
//!
//! A frame takes a [`Lease`] on all bricks of a batch at once: room for the whole batch is reserved under one lock, so
//! that two frames never wait for each other's bricks half-served. A thread that holds a lease must not ask for
//! another. Each brick is loaded once, whoever asks; the least recently used go first; leased bricks stay.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use brickcast_volume::{BrickId, SessionId, StoreHash};
use rayon::prelude::*;

use crate::error::NodeError;
use crate::kernel::{Recipe, ResidentBrick};
use crate::stores::far::spread;

/// How often a waiting thread looks whether its client is still there.
const PATIENCE: Duration = Duration::from_millis(100);

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BrickKey {
    pub store: StoreHash,
    pub brick: BrickId,
    /// Ghost layers on each side.
    pub ghost: u32,
    pub recipe: Recipe,
}

/// A brick that a batch needs, and the bytes that it is expected to occupy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted {
    pub key: BrickKey,
    pub bytes: u64,
}

/// Loads one brick into the backend; called from several threads at once.
pub type Load<'a> = dyn Fn(BrickKey) -> Result<Arc<dyn ResidentBrick>, NodeError> + Sync + 'a;

#[derive(Debug)]
pub struct Residency {
    budget: u64,
    table: Mutex<Table>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Table {
    slots: HashMap<BrickKey, Slot>,
    /// Bytes of all slots, those included that are still reserved only.
    used: u64,
    clock: u64,
}

#[derive(Debug)]
struct Slot {
    state: State,
    bytes: u64,
    /// Leases that hold it.
    pins: u32,
    used_at: u64,
    users: Users,
}

/// Whose frames used a brick since it was loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Users {
    One(SessionId),
    Several,
}

impl Users {
    fn and(self, session: SessionId) -> Self {
        if self == Self::One(session) { self } else { Self::Several }
    }
}

#[derive(Debug)]
enum State {
    /// Room is reserved, nobody loads it.
    Reserved,
    /// Somebody loads it.
    Loading,
    Ready(Arc<dyn ResidentBrick>),
}

/// What is resident.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Occupancy {
    pub bytes: u64,
    pub bricks: usize,
}

impl Residency {
    /// `budget` in bytes.
    #[must_use]
    pub fn new(budget: u64) -> Self {
        Self { budget, table: Mutex::default(), changed: Condvar::new() }
    }

    #[must_use]
    pub fn budget(&self) -> u64 {
        self.budget
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

    /// Holds all of `wanted` (none twice), loading what is missing; waits for bricks that others load and for room that
    /// others hold, until `cancelled`.
    ///
    /// # Errors
    /// More than the budget at once, a load that failed, `cancelled`.
    pub fn lease(
        &self,
        session: SessionId,
        wanted: &[Wanted],
        load: &Load<'_>,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Lease<'_>, NodeError> {
        let bytes = wanted.iter().map(|w| w.bytes).fold(0, u64::saturating_add);
        if bytes > self.budget {
            return Err(NodeError::BatchTooLarge { bytes, budget: self.budget });
        }
        let mut lease = self.reserve(session, wanted, cancelled)?;
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
            self.load(Claim { residency: self, keys: mine }, load, cancelled)?;
        }
    }

    /// Pins `wanted`, with room for what is missing.
    fn reserve(
        &self,
        session: SessionId,
        wanted: &[Wanted],
        cancelled: &dyn Fn() -> bool,
    ) -> Result<Lease<'_>, NodeError> {
        let mut table = self.lock();
        loop {
            let missing: u64 = wanted.iter().filter(|w| !table.slots.contains_key(&w.key)).map(|w| w.bytes).sum();
            if table.make_room(missing, self.budget, wanted) {
                break;
            }
            if cancelled() {
                return Err(NodeError::Cancelled);
            }
            table = self.wait(table);
        }
        table.clock += 1;
        let clock = table.clock;
        for w in wanted {
            if !table.slots.contains_key(&w.key) {
                table.used = table.used.saturating_add(w.bytes);
            }
            let slot = table.slots.entry(w.key).or_insert(Slot {
                state: State::Reserved,
                bytes: w.bytes,
                pins: 0,
                used_at: clock,
                users: Users::One(session),
            });
            slot.users = slot.users.and(session);
            slot.pins += 1;
            slot.used_at = clock;
        }
        let keys = wanted.iter().map(|w| w.key).collect();
        Ok(Lease { residency: self, keys, bricks: Vec::new(), loaded: Vec::new() })
    }

    /// Loads what is claimed, in parallel, in the grid's order so that neighbours share decoded chunks.
    fn load(
        &self,
        mut claim: Claim<'_>,
        make: &Load<'_>,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), NodeError> {
        claim.keys.sort_unstable();
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
        match &claim.keys[..] {
            // Alone, it waits for its file and its texture here, not where others compute.
            [key] => load(key),
            keys => spread(|| keys.par_iter().try_for_each(load)),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, table: MutexGuard<'a, Table>) -> MutexGuard<'a, Table> {
        self.changed.wait_timeout(table, PATIENCE).unwrap_or_else(PoisonError::into_inner).0
    }
}

impl Table {
    /// Evicts until `missing` more bytes fit; false (and nothing evicted) where leases hold too much: wait for them.
    fn make_room(&mut self, missing: u64, budget: u64, keep: &[Wanted]) -> bool {
        let over = self.used.saturating_add(missing).saturating_sub(budget);
        if over == 0 || missing == 0 {
            return true;
        }
        let keep: HashSet<BrickKey> = keep.iter().map(|w| w.key).collect();
        let mut idle: Vec<(u64, BrickKey, u64)> = self
            .slots
            .iter()
            .filter(|(key, slot)| slot.pins == 0 && !keep.contains(key))
            .map(|(key, slot)| (slot.used_at, *key, slot.bytes))
            .collect();
        // Where nobody holds anything, waiting would never end: bricks turned out larger than expected, so go over.
        let someone_holds = self.slots.values().any(|slot| slot.pins > 0);
        if someone_holds && idle.iter().map(|(_, _, bytes)| bytes).sum::<u64>() < over {
            return false;
        }
        idle.sort_unstable();
        let mut freed = 0;
        for (_, key, bytes) in idle {
            if freed >= over {
                break;
            }
            self.slots.remove(&key);
            freed += bytes;
        }
        self.used = self.used.saturating_sub(freed);
        true
    }

    /// Marks what nobody loads yet as being loaded, and returns it.
    fn claim(&mut self, keys: &[BrickKey]) -> Vec<BrickKey> {
        let mut mine = Vec::new();
        for key in keys {
            if let Some(slot) = self.slots.get_mut(key)
                && matches!(slot.state, State::Reserved)
            {
                slot.state = State::Loading;
                mine.push(*key);
            }
        }
        mine
    }

    /// All bricks, if all are there.
    fn ready(&self, keys: &[BrickKey]) -> Option<Vec<Arc<dyn ResidentBrick>>> {
        keys.iter()
            .map(|key| match self.slots.get(key).map(|slot| &slot.state) {
                Some(State::Ready(brick)) => Some(brick.clone()),
                _ => None,
            })
            .collect()
    }
}

/// Bricks being loaded by one thread; what it leaves behind (error, panic) may be loaded by others.
struct Claim<'a> {
    residency: &'a Residency,
    keys: Vec<BrickKey>,
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        let mut table = self.residency.lock();
        for key in &self.keys {
            if let Some(slot) = table.slots.get_mut(key)
                && matches!(slot.state, State::Loading)
            {
                slot.state = State::Reserved;
            }
        }
        drop(table);
        self.residency.changed.notify_all();
    }
}

/// Bricks that stay resident while this lives.
#[derive(Debug)]
pub struct Lease<'a> {
    residency: &'a Residency,
    keys: Vec<BrickKey>,
    bricks: Vec<Arc<dyn ResidentBrick>>,
    loaded: Vec<BrickKey>,
}

impl Lease<'_> {
    /// The bricks, in the order in which they were wanted.
    #[must_use]
    pub fn bricks(&self) -> &[Arc<dyn ResidentBrick>] {
        &self.bricks
    }

    /// Those that were not resident before and that this lease loaded.
    #[must_use]
    pub fn loaded(&self) -> &[BrickKey] {
        &self.loaded
    }
}

impl Drop for Lease<'_> {
    fn drop(&mut self) {
        self.bricks.clear();
        let mut table = self.residency.lock();
        for key in &self.keys {
            let Some(slot) = table.slots.get_mut(key) else { continue };
            slot.pins = slot.pins.saturating_sub(1);
            if slot.pins == 0 && matches!(slot.state, State::Reserved) {
                let bytes = slot.bytes;
                table.slots.remove(key);
                table.used = table.used.saturating_sub(bytes);
            }
        }
        drop(table);
        self.residency.changed.notify_all();
    }
}

#[cfg(test)]
mod tests;

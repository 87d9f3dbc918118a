//! Which bricks are resident, reserved and held, and which go first.

use std::cmp::Reverse;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use brickcast_volume::SessionId;

use super::visits::Place;
use super::wanted::{BrickKey, Wanted};
use crate::kernel::ResidentBrick;

#[derive(Debug, Default)]
pub(super) struct Table {
    pub(super) slots: HashMap<BrickKey, Slot>,
    /// Bytes of all slots, those included that are still reserved only.
    pub(super) used: u64,
    /// Bytes that loads under way may hold beside their bricks.
    pub(super) loading: u64,
    pub(super) clock: u64,
}

#[derive(Debug)]
pub(super) struct Slot {
    pub(super) state: State,
    pub(super) bytes: u64,
    /// Leases that hold it.
    pub(super) pins: u32,
    used_at: u64,
    pub(super) users: Users,
}

/// Whose frames used a brick since it was loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Users {
    One(SessionId),
    Several,
}

impl Users {
    fn and(self, session: SessionId) -> Self {
        if self == Self::One(session) { self } else { Self::Several }
    }
}

#[derive(Debug)]
pub(super) enum State {
    /// Room is reserved, nobody loads it.
    Reserved,
    /// Somebody loads it.
    Loading,
    Ready(Arc<dyn ResidentBrick>),
}

impl Table {
    /// Bytes of those that have no slot yet.
    pub(super) fn missing(&self, wanted: &[Wanted]) -> u64 {
        wanted.iter().filter(|w| !self.slots.contains_key(&w.key)).map(|w| w.bytes).sum()
    }

    /// Bytes that are free, or would be if all went that may.
    pub(super) fn could_be_free(&self, budget: u64, keep: &HashSet<BrickKey>) -> u64 {
        let idle = self.slots.iter().filter(|(key, slot)| slot.pins == 0 && !keep.contains(key));
        let idle: u64 = idle.map(|(_, slot)| slot.bytes).sum();
        budget.saturating_sub(self.used + self.loading - idle.min(self.used))
    }

    /// Evicts until `more` bytes fit; false (and nothing evicted) where leases hold too much: wait for them. First goes
    /// what the frame does not need, the least recently used first, and then what it needs last.
    pub(super) fn make_room(
        &mut self,
        more: u64,
        budget: u64,
        keep: &HashSet<BrickKey>,
        place: Option<Place<'_>>,
    ) -> bool {
        let taken = self.used.saturating_add(self.loading);
        let over = taken.saturating_add(more).saturating_sub(budget);
        if over == 0 || more == 0 {
            return true;
        }
        let until = |key: &BrickKey| place.and_then(|place| place.until(key));
        let mut idle: Vec<_> = self
            .slots
            .iter()
            .filter(|(key, slot)| slot.pins == 0 && !keep.contains(key))
            .map(|(key, slot)| (until(key).map(Reverse), slot.used_at, *key, slot.bytes))
            .collect();
        // Where nobody holds anything, waiting would never end: bricks turned out larger than expected, so go over.
        let someone_holds = self.slots.values().any(|slot| slot.pins > 0);
        if someone_holds && idle.iter().map(|(.., bytes)| bytes).sum::<u64>() < over {
            return false;
        }
        idle.sort_unstable();
        let mut freed = 0;
        for (.., key, bytes) in idle {
            if freed >= over {
                break;
            }
            self.slots.remove(&key);
            freed += bytes;
        }
        self.used = self.used.saturating_sub(freed);
        true
    }

    /// Holds `wanted`, with slots for what has none.
    pub(super) fn pin(&mut self, session: SessionId, wanted: &[Wanted]) {
        self.clock += 1;
        let clock = self.clock;
        for w in wanted {
            if !self.slots.contains_key(&w.key) {
                self.used = self.used.saturating_add(w.bytes);
            }
            let slot = self.slots.entry(w.key).or_insert(Slot {
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
    }

    /// Marks what nobody loads yet as being loaded, and returns it.
    pub(super) fn claim(&mut self, keys: &[BrickKey]) -> Vec<BrickKey> {
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
    pub(super) fn ready(&self, keys: &[BrickKey]) -> Option<Vec<Arc<dyn ResidentBrick>>> {
        keys.iter()
            .map(|key| match self.slots.get(key).map(|slot| &slot.state) {
                Some(State::Ready(brick)) => Some(brick.clone()),
                _ => None,
            })
            .collect()
    }
}

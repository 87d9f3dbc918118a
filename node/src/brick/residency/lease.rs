//! What holds bricks, and what loads them.

use std::sync::Arc;

use super::Residency;
use super::table::State;
use super::wanted::BrickKey;
use crate::kernel::ResidentBrick;

/// Bricks being loaded by one caller; what it leaves behind (error, panic) may be loaded by others.
pub(super) struct Claim<'a> {
    pub(super) residency: &'a Residency,
    pub(super) keys: Vec<BrickKey>,
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

/// Bytes that loading may hold, until it is dropped.
#[derive(Debug)]
pub(super) struct Grant<'a> {
    pub(super) residency: &'a Residency,
    pub(super) bytes: u64,
}

impl Drop for Grant<'_> {
    fn drop(&mut self) {
        let mut table = self.residency.lock();
        table.loading = table.loading.saturating_sub(self.bytes);
        drop(table);
        self.residency.changed.notify_all();
    }
}

/// Bricks that stay resident while this lives.
#[derive(Debug)]
pub struct Lease<'a> {
    pub(super) residency: &'a Residency,
    pub(super) keys: Vec<BrickKey>,
    pub(super) bricks: Vec<Arc<dyn ResidentBrick>>,
    pub(super) loaded: Vec<BrickKey>,
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

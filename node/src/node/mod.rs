//! A node: stores, residency and a raycaster, whose turn clients have one after the other.
//!
//! Stateless towards orders: a frame is exactly what its order says, and nothing of it stays but resident bricks.
//!
//! Invariant: nothing that computes, reads a disk, waits for threads that compute, or takes a lock that is held
//! meanwhile runs on a thread of the runtime. So the node answers at any time, whatever it is doing.

mod about;
mod frames;
mod life;
mod loads;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use brickcast_volume::SessionId;
use brickcast_volume::store::ChunkCache;
use tokio::sync::Semaphore;
use tokio::task::JoinError;

use crate::brick::residency::Residency;
use crate::brick::shares::MemoryShares;
use crate::clients::limits::MAX_WAITING;
use crate::clients::{Caller, Client, TurnQueue};
use crate::config::NodeConfig;
use crate::error::NodeError;
use crate::kernel::{Pulse, Raycaster};
use crate::render::{Pace, TableCache, Workshop};
use crate::stores::{OpenStore, Stores};

pub use frames::Parts;

use self::life::Life;

#[derive(Debug)]
pub struct Node {
    config: NodeConfig,
    raycaster: Arc<dyn Raycaster>,
    stores: Stores,
    residency: Residency,
    cache: ChunkCache,
    tables: TableCache,
    pace: Pace,
    pulse: Pulse,
    life: Life,
    /// One slice of a frame, or one batch of loading ahead, at a time.
    turns: Arc<TurnQueue>,
    /// The one that renders and those that wait.
    places: Arc<Semaphore>,
    /// Leave to load beside frames, for those to come.
    beside: Semaphore,
    draining: AtomicBool,
    /// Work stops at its next batch.
    stopped: Arc<AtomicBool>,
    /// A client that takes no part for this long is given up.
    stall_timeout: Duration,
}

impl Node {
    /// # Errors
    /// A data root that is not there.
    pub fn new(config: NodeConfig, raycaster: Arc<dyn Raycaster>) -> Result<Self, NodeError> {
        let cache = Self::chunk_cache(config.memory_budget);
        Self::sharing(config, raycaster, cache)
    }

    /// A cache of decoded inner chunks as a node of this budget has it.
    #[must_use]
    pub fn chunk_cache(memory_budget: u64) -> ChunkCache {
        ChunkCache::new(MemoryShares::of(memory_budget).cache)
    }

    /// A node whose `cache` is a handle that it shares with others of this process: none decodes what another has.
    ///
    /// # Errors
    /// A data root that is not there.
    pub fn sharing(config: NodeConfig, raycaster: Arc<dyn Raycaster>, cache: ChunkCache) -> Result<Self, NodeError> {
        let stores = Stores::new(&config.data)?.with_room(MemoryShares::of(config.memory_budget).views);
        let pace = Pace::new(config.throttle, raycaster.info().is_on_processor);
        Ok(Self {
            residency: Residency::new(MemoryShares::of(config.memory_budget).residency),
            config,
            raycaster,
            stores,
            cache,
            tables: TableCache::default(),
            pace,
            pulse: Pulse::default(),
            life: Life::new(),
            turns: Arc::default(),
            places: Arc::new(Semaphore::new(MAX_WAITING + 1)),
            beside: Semaphore::new(1),
            draining: AtomicBool::new(false),
            stopped: Arc::default(),
            stall_timeout: frames::STALL_TIMEOUT,
        })
    }

    /// From now on new orders are refused; frames under way finish, at full speed.
    pub fn drain(&self) {
        self.pace.hurry();
        self.draining.store(true, Ordering::Relaxed);
    }

    /// Frames under way end at their next batch, with an error.
    pub fn stop(&self) {
        self.drain();
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// Resolves when no frame is under way or waiting, and nothing is loaded ahead.
    pub async fn idle(&self) {
        // Closed semaphores (there are none) would count as idle.
        let _places = self.places.acquire_many(MAX_WAITING as u32 + 1).await;
        let _turn = self.turns.turn(Client::Local).await;
        let _beside = self.beside.acquire().await;
    }

    fn stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Is work for nothing: because `is_gone` for whom it is, or the node has to end?
    fn unwanted<F: Fn() -> bool + Clone>(&self, is_gone: F) -> impl Fn() -> bool + Clone + use<F> {
        let stopped = self.stopped.clone();
        move || is_gone() || stopped.load(Ordering::Relaxed)
    }

    fn accepting(&self) -> Result<(), NodeError> {
        if self.draining.load(Ordering::Relaxed) { Err(NodeError::Draining) } else { Ok(()) }
    }

    /// `cache`: a handle of whoever the work is for.
    fn workshop<'a>(&'a self, session: SessionId, cache: &'a ChunkCache) -> Workshop<'a> {
        let (raycaster, pace, pulse) = (&*self.raycaster, &self.pace, &self.pulse);
        let Self { residency, tables, .. } = self;
        Workshop { raycaster, residency, cache, tables, pace, pulse, session }
    }

    /// A store that reads badly is closed, so that a repaired one is found.
    fn note_broken(&self, error: &NodeError, store: &OpenStore) {
        if matches!(error, NodeError::Store { .. } | NodeError::Outside { .. }) {
            self.stores.forget(store.store.hash());
        }
    }

    /// Runs blocking work, whose caller counts as served until it is done.
    async fn aside<T: Send + 'static>(
        self: &Arc<Self>,
        caller: &Caller,
        work: impl FnOnce(&Self) -> Result<T, NodeError> + Send + 'static,
    ) -> Result<T, NodeError> {
        let (node, caller) = (self.clone(), caller.clone());
        let done = tokio::task::spawn_blocking(move || {
            let _caller = caller;
            work(&node)
        });
        flatten(done.await)
    }

    /// Runs blocking work when its turn comes.
    async fn in_turn<T: Send + 'static>(
        self: &Arc<Self>,
        caller: &Caller,
        work: impl FnOnce(&Self) -> Result<T, NodeError> + Send + 'static,
    ) -> Result<T, NodeError> {
        let turn = self.turns.turn(caller.client).await;
        self.aside(caller, move |node| {
            let _turn = turn;
            work(node)
        })
        .await
    }
}

/// A panic in blocking work is an error of that work, not of the node.
fn flatten<T>(done: Result<Result<T, NodeError>, JoinError>) -> Result<T, NodeError> {
    done.unwrap_or_else(|error| Err(NodeError::Panicked(panic_text(error))))
}

fn panic_text(error: JoinError) -> String {
    match error.try_into_panic() {
        Ok(payload) => payload
            .downcast_ref::<String>()
            .cloned()
            .or_else(|| payload.downcast_ref::<&str>().map(|&s| s.to_owned()))
            .unwrap_or_else(|| "a panic without words".to_owned()),
        Err(error) => error.to_string(),
    }
}

#[cfg(test)]
mod tests;

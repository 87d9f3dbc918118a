//! A node: stores, residency and a raycaster, whose turn clients have one after the other.
//!
//! Stateless towards orders: a frame is exactly what its order says, and nothing of it stays but resident bricks.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use brickcast_proto::{
    FramePart, NodeDescription, NodeState, PROTOCOL_VERSION, Part, PrepareReceipt, PrepareRequest, RenderOrder,
    StoreDescription, StoreQuery,
};
use brickcast_volume::store::{BrickFactsTable, ChunkCache};
use bytes::Bytes;
use tokio::runtime::Handle;
use tokio::sync::{Semaphore, mpsc};
use tokio::task::JoinError;

use crate::client::Client;
use crate::config::NodeConfig;
use crate::error::NodeError;
use crate::lanes::{Lanes, Turn};
use crate::meter::{FrameMeter, LoadMeter, peak_resident_set};
use crate::pace::Pace;
use crate::quota::Caller;
use crate::raycaster::{Features, Raycaster};
use crate::render::{BrickChoice, TableCache, Workshop, load_bricks, render_frame};
use crate::residency::Residency;
use crate::stores::{OpenStore, Stores};

/// Orders that may wait while one renders.
pub const MAX_WAITING: usize = 16;
/// Parts between the renderer and the connection: 4 MiB of tiles at most.
const PARTS_IN_FLIGHT: usize = 64;
/// A client that takes no part for this long is given up, so that it cannot hold memory. Others have their turn meanwhile.
const STALL_TIMEOUT: Duration = Duration::from_secs(10);
/// Decoded chunks of the store kept for neighbours, bytes, on top of the budget for bricks: a quarter of it within these. The
/// smaller a budget, the oftener bricks are read again, so the cache does not vanish with it.
const CACHE_BYTES: std::ops::RangeInclusive<u64> = 32 << 20..=256 << 20;
/// Bricks loaded ahead before a waiting frame gets its turn.
const PREPARE_BATCH: usize = 64;

#[derive(Debug)]
pub struct Node {
    config: NodeConfig,
    raycaster: Arc<dyn Raycaster>,
    stores: Stores,
    residency: Residency,
    cache: ChunkCache,
    tables: TableCache,
    pace: Pace,
    /// One frame, or one batch of loading ahead, at a time.
    lanes: Arc<Lanes>,
    /// The one that renders and those that wait.
    places: Arc<Semaphore>,
    draining: AtomicBool,
    /// Work stops at its next batch.
    stopped: AtomicBool,
}

/// The parts of a frame as they are made; ends after the receipt or an error.
pub type Parts = mpsc::Receiver<Result<FramePart, NodeError>>;

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
        ChunkCache::new((memory_budget / 4).clamp(*CACHE_BYTES.start(), *CACHE_BYTES.end()))
    }

    /// A node whose `cache` is a handle that it shares with others of this process: none decodes what another has.
    ///
    /// # Errors
    /// A data root that is not there.
    pub fn sharing(config: NodeConfig, raycaster: Arc<dyn Raycaster>, cache: ChunkCache) -> Result<Self, NodeError> {
        let stores = Stores::new(&config.data)?;
        let pace = Pace::new(config.throttle, raycaster.info().is_on_processor);
        Ok(Self {
            residency: Residency::new(config.memory_budget),
            config,
            raycaster,
            stores,
            cache,
            tables: TableCache::default(),
            pace,
            lanes: Arc::default(),
            places: Arc::new(Semaphore::new(MAX_WAITING + 1)),
            draining: AtomicBool::new(false),
            stopped: AtomicBool::new(false),
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
        let _turn = self.lanes.turn(Client::Local).await;
    }

    fn stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    fn accepting(&self) -> Result<(), NodeError> {
        if self.draining.load(Ordering::Relaxed) { Err(NodeError::Draining) } else { Ok(()) }
    }

    fn workshop(&self) -> Workshop<'_> {
        let (raycaster, pace) = (&*self.raycaster, &self.pace);
        Workshop { raycaster, residency: &self.residency, cache: &self.cache, tables: &self.tables, pace }
    }

    /// Takes an order; its parts come as they are made. Dropping the receiver cancels the frame.
    ///
    /// # Errors
    /// Draining, too many orders waiting, an unknown store. What goes wrong later comes through the channel.
    pub async fn render(self: Arc<Self>, caller: Caller, order: RenderOrder) -> Result<Parts, NodeError> {
        let started = Instant::now();
        self.accepting()?;
        let place = self.places.clone().try_acquire_owned().map_err(|_| NodeError::Busy(MAX_WAITING))?;
        let store = self.open(&caller, StoreQuery::Hash(order.store)).await?;
        let (tx, rx) = mpsc::channel(PARTS_IN_FLIGHT);
        let client = caller.client;
        let turn = self.lanes.turn(client);
        tokio::spawn(async move {
            // Free before the stream ends: the next order may come at once.
            let _places = (place, caller);
            let turn = tokio::select! {
                turn = turn => turn,
                () = tx.closed() => return,
            };
            let worker = tx.clone();
            let node = self.clone();
            let work =
                tokio::task::spawn_blocking(move || node.render_now(&order, &store, started, &worker, (client, turn)));
            if let Err(error) = flatten(work.await) {
                match &error {
                    NodeError::Cancelled => tracing::debug!("{error}"),
                    _ => tracing::warn!("frame failed: {error}"),
                }
                // Nobody may be there to hear it.
                let _ = tx.send_timeout(Err(error), STALL_TIMEOUT).await;
            }
        });
        Ok(rx)
    }

    /// Renders on this (blocking) thread. The turn is given to others while the client takes no parts.
    fn render_now(
        &self,
        order: &RenderOrder,
        store: &OpenStore,
        started: Instant,
        parts: &mpsc::Sender<Result<FramePart, NodeError>>,
        (client, turn): (Client, Turn),
    ) -> Result<(), NodeError> {
        let mut turn = Some(turn);
        let mut meter = FrameMeter::new(started, order.layers.len());
        let cancelled = || parts.is_closed() || self.stopped();
        let mut emit = |part| {
            let part = FramePart { frame: order.frame, epoch: order.epoch, part };
            match send(parts, Ok(part)) {
                Sent::Taken => Ok(()),
                Sent::Gone => Err(NodeError::Cancelled),
                Sent::Full(part) => {
                    turn = None;
                    wait_until_taken(parts, part)?;
                    turn = Some(Handle::current().block_on(self.lanes.turn(client)));
                    Ok(())
                }
            }
        };
        let result = render_frame(order, store, self.workshop(), &mut meter, &cancelled, &mut emit);
        match result {
            Ok(()) => emit(Part::Receipt(meter.receipt())),
            Err(NodeError::Cancelled) if self.stopped() => Err(NodeError::Draining),
            Err(error) => {
                self.note_broken(&error, store);
                Err(error)
            }
        }
    }

    /// A store that reads badly is closed, so that a repaired one is found.
    fn note_broken(&self, error: &NodeError, store: &OpenStore) {
        if matches!(error, NodeError::Store { .. } | NodeError::Outside { .. }) {
            self.stores.forget(store.store.hash());
        }
    }

    async fn open(self: &Arc<Self>, caller: &Caller, query: StoreQuery) -> Result<Arc<OpenStore>, NodeError> {
        self.aside(caller, move |node| node.stores.query(&query)).await
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

    /// Manifest and brick ranges of a store.
    ///
    /// # Errors
    /// A store that is not here, or not under that name, or not with that content.
    pub async fn describe_store(
        self: &Arc<Self>,
        caller: Caller,
        query: StoreQuery,
    ) -> Result<StoreDescription, NodeError> {
        let open = self.open(&caller, query).await?;
        Ok(StoreDescription {
            name: open.name.clone(),
            hash: open.store.hash(),
            manifest: open.store.manifest().clone(),
            manifest_bytes: Bytes::copy_from_slice(open.store.manifest_bytes()),
            ranges: open.store.brick_ranges().clone(),
            facts: open.store.brick_facts().map(|facts| BrickFactsTable(facts.to_vec())),
        })
    }

    /// Who this node is and what it holds.
    ///
    /// # Errors
    /// Only where looking at the stores panicked.
    pub async fn describe(self: &Arc<Self>, caller: Caller) -> Result<NodeDescription, NodeError> {
        let stores = self.aside(&caller, |node| Ok(node.stores.list())).await?;
        let info = self.raycaster.info();
        let occupancy = self.residency.occupancy();
        Ok(NodeDescription {
            node_id: self.config.node_id.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            protocol: PROTOCOL_VERSION,
            backend: info.backend.to_owned(),
            adapter: info.adapter.clone(),
            memory_budget: self.config.memory_budget,
            memory_used: occupancy.bytes,
            resident_bricks: u32::try_from(occupancy.bricks).unwrap_or(u32::MAX),
            state: if self.accepting().is_ok() { NodeState::Serving } else { NodeState::Draining },
            stores,
            notes: info.notes.clone(),
            threads: info.threads,
            max_resident_set: peak_resident_set(),
            throttle: self.config.throttle,
        })
    }

    /// Lets go of bricks, warms the pipelines and makes bricks resident, in the order asked and as many as the budget holds;
    /// frames get their turn in between, in the background after every brick.
    ///
    /// # Errors
    /// An unknown store or brick, a broken store, a failing adapter, draining.
    pub async fn prepare(
        self: &Arc<Self>,
        caller: Caller,
        request: PrepareRequest,
    ) -> Result<PrepareReceipt, NodeError> {
        self.accepting()?;
        let store = self.open(&caller, StoreQuery::Hash(request.store)).await?;
        let grid = store.store.manifest().grid;
        let choice = BrickChoice::new(&store.store, &request.scene, &self.tables)?;
        let mut wanted = Vec::with_capacity(request.bricks.len());
        let mut bytes = 0_u64;
        let all = request.bricks.iter().chain(&request.release);
        if let Some(&brick) = all.into_iter().find(|&&brick| u64::from(brick) >= grid.brick_count()) {
            return Err(NodeError::NoSuchBrick { brick, last: grid.brick_count().saturating_sub(1) });
        }
        self.residency.release(request.store, &request.release);
        for &brick in &request.bricks {
            // What the scene does not show need not be there.
            let Some(chosen) = choice.of(grid.brick_at(brick as usize), &*self.raycaster) else { continue };
            bytes = bytes.saturating_add(chosen.wanted.bytes);
            if bytes <= self.config.memory_budget {
                wanted.push(chosen.wanted);
            }
        }
        let integral = choice.kinds();
        let with = move |features| Features { integral, ..features };
        let may_lack = store.store.manifest().no_data.is_some();
        let features: HashSet<Features> =
            wanted.iter().flat_map(|w| w.key.recipe.all_features(may_lack)).map(with).collect();
        let mut load = LoadMeter::default();
        load.add(
            self.in_turn(&caller, move |node| {
                for features in features.into_iter().chain([with(Features::PLAIN)]) {
                    node.raycaster.warm_up(request.scene.filter, features)?;
                }
                Ok(LoadMeter::default())
            })
            .await?,
        );
        for batch in wanted.chunks(if request.background { 1 } else { PREPARE_BATCH }) {
            self.accepting()?;
            let (batch, store) = (batch.to_vec(), store.clone());
            let loaded = self.in_turn(&caller, move |node| {
                let loaded = load_bricks(&batch, &store, node.workshop(), &|| node.stopped());
                loaded.map(|(_, meter)| meter).inspect_err(|error| node.note_broken(error, &store))
            });
            load.add(loaded.await?);
        }
        Ok(PrepareReceipt {
            load_ms: load.milliseconds(),
            bricks: u32::try_from(wanted.len()).unwrap_or(u32::MAX),
            decoded_bytes: load.decoded_bytes,
            owned_bytes: load.owned_bytes,
            resident_bytes: self.residency.occupancy().bytes,
            fits: bytes <= self.config.memory_budget,
            bytes: self.residency.resident_bytes(&wanted),
        })
    }

    /// Runs blocking work when its turn comes.
    async fn in_turn<T: Send + 'static>(
        self: &Arc<Self>,
        caller: &Caller,
        work: impl FnOnce(&Self) -> Result<T, NodeError> + Send + 'static,
    ) -> Result<T, NodeError> {
        let turn = self.lanes.turn(caller.client).await;
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

enum Sent {
    Taken,
    Gone,
    /// The client has not taken what was sent before.
    Full(Result<FramePart, NodeError>),
}

fn send(parts: &mpsc::Sender<Result<FramePart, NodeError>>, part: Result<FramePart, NodeError>) -> Sent {
    use mpsc::error::TrySendError;
    match parts.try_send(part) {
        Ok(()) => Sent::Taken,
        Err(TrySendError::Closed(_)) => Sent::Gone,
        Err(TrySendError::Full(part)) => Sent::Full(part),
    }
}

/// Waits for the client to take parts, but not for ever.
fn wait_until_taken(
    parts: &mpsc::Sender<Result<FramePart, NodeError>>,
    part: Result<FramePart, NodeError>,
) -> Result<(), NodeError> {
    use mpsc::error::SendTimeoutError;
    match Handle::current().block_on(parts.send_timeout(part, STALL_TIMEOUT)) {
        Ok(()) => Ok(()),
        Err(SendTimeoutError::Closed(_)) => Err(NodeError::Cancelled),
        Err(SendTimeoutError::Timeout(_)) => Err(NodeError::Stalled(STALL_TIMEOUT.as_secs())),
    }
}

#[cfg(test)]
mod tests;

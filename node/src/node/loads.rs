//! Loading ahead of frames.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use brickcast_proto::{LoadReceipt, LoadRequest, StoreQuery};
use brickcast_volume::lod::Sides;
use brickcast_volume::{SessionId, StoreHash};

use super::Node;
use crate::brick::residency::{Ask, Wanted};
use crate::brick::shares::{BrickShares, Need};
use crate::clients::Caller;
use crate::error::NodeError;
use crate::kernel::{BrickTraits, KernelKey};
use crate::render::{BrickChoice, LoadMeter, load_beside, load_bricks};
use crate::stores::{OpenStore, Source};

/// Bricks loaded ahead before a waiting frame gets its turn.
const LOAD_BATCH: usize = 64;

/// Bricks loaded beside frames before it is seen whether anybody wants more.
const BESIDE_BATCH: usize = 16;

/// What a request comes to.
struct Wish {
    /// As many as the budget holds, in the order asked.
    bricks: Vec<Wanted>,
    fits: bool,
    shares: BrickShares,
    /// The kernels that they may take.
    keys: HashSet<KernelKey>,
}

/// Tells work that goes on by itself when the call that it is for is dropped.
#[derive(Debug, Default)]
struct Gone(Arc<AtomicBool>);

impl Drop for Gone {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Node {
    /// Lets go of bricks, warms the pipelines and makes bricks resident, in the order asked and as many as the budget
    /// holds; frames get their turn in between, in the background after every brick.
    ///
    /// # Errors
    /// An unknown store or brick, a broken store, a failing adapter, draining.
    pub async fn load(self: &Arc<Self>, caller: Caller, request: LoadRequest) -> Result<LoadReceipt, NodeError> {
        let client = caller.client;
        self.load_bricks(caller, request).await.inspect_err(|error| {
            self.life.failed(error);
            if !matches!(error, NodeError::Cancelled | NodeError::Draining) {
                tracing::warn!(%client, "loading failed: {error}");
            }
        })
    }

    async fn load_bricks(self: &Arc<Self>, caller: Caller, request: LoadRequest) -> Result<LoadReceipt, NodeError> {
        self.accepting()?;
        let request = Arc::new(request);
        let (session, background, filter) = (request.session, request.background, request.scene.quality.filter);
        let keep: Arc<[StoreHash]> = request.keep.clone().into();
        let wish = move |node: &Self| {
            let store = node.stores.query(&StoreQuery::Hash(request.store))?;
            let wish = node.wish(&request, &store)?;
            node.residency.release(session, request.store, &request.release);
            Ok((store, wish))
        };
        let (store, Wish { bricks, fits, shares, keys }) = self.aside(&caller, wish).await?;
        let mut load = LoadMeter::default();
        let gone = Gone::default();
        if !keep.is_empty() {
            self.load_beside(&caller, (session, &bricks, shares), (&store, &keep), &gone, &mut load).await?;
            return Ok(self.receipt(&bricks, fits, &load));
        }
        let warm_up = move |node: &Self| {
            let keys: Vec<_> = keys.into_iter().collect();
            Ok(node.raycaster.warm_up(filter, &keys)?)
        };
        self.in_turn(&caller, warm_up).await?;
        for batch in bricks.chunks(if background { 1 } else { LOAD_BATCH }) {
            self.accepting()?;
            let (batch, store, gone) = (batch.to_vec(), store.clone(), gone.0.clone());
            let loaded = self.in_turn(&caller, move |node| {
                let cancelled = node.unwanted(move || gone.load(Ordering::Relaxed));
                let cache = node.cache.share_until(cancelled.clone());
                let ask = Ask { session, wanted: &batch, shares, place: None };
                let loaded = load_bricks(ask, &[Source::of(&store)], node.workshop(session, &cache), &cancelled);
                loaded.map(|(_, meter)| meter).inspect_err(|error| node.note_broken(error, &store))
            });
            load.add(loaded.await?);
        }
        Ok(self.receipt(&bricks, fits, &load))
    }

    /// Loads for frames to come while others render: one such request at a time, without a turn, and in one thread
    /// where the processor renders. Nothing goes for it but what is of no store in `keep`.
    async fn load_beside(
        self: &Arc<Self>,
        caller: &Caller,
        (session, bricks, shares): (SessionId, &[Wanted], BrickShares),
        (store, keep): (&Arc<OpenStore>, &Arc<[StoreHash]>),
        gone: &Gone,
        load: &mut LoadMeter,
    ) -> Result<(), NodeError> {
        if bricks.is_empty() {
            return Ok(());
        }
        // Never closed.
        let _leave = self.beside.acquire().await;
        let is_on_processor = self.raycaster.info().is_on_processor;
        let at_once = if is_on_processor { 1 } else { shares.at_once };
        let shares = BrickShares { at_once, ..shares };
        for batch in bricks.chunks(BESIDE_BATCH) {
            self.accepting()?;
            let (batch, store, keep, gone) = (batch.to_vec(), store.clone(), keep.clone(), gone.0.clone());
            let loaded = self.aside(caller, move |node| {
                let cancelled = node.unwanted(move || gone.load(Ordering::Relaxed));
                let cache = node.cache.share_until(cancelled.clone());
                let ask = Ask { session, wanted: &batch, shares, place: None };
                let (sources, workshop) = ([Source::of(&store)], node.workshop(session, &cache));
                load_beside(ask, &keep, &sources, workshop, &cancelled)
                    .inspect_err(|error| node.note_broken(error, &store))
            });
            load.add(loaded.await?);
        }
        Ok(())
    }

    fn receipt(&self, bricks: &[Wanted], fits: bool, load: &LoadMeter) -> LoadReceipt {
        LoadReceipt {
            load_ms: load.milliseconds(),
            bricks: u32::try_from(bricks.len()).unwrap_or(u32::MAX),
            decoded_bytes: load.decoded_bytes,
            owned_bytes: load.owned_bytes,
            resident_bytes: self.residency.occupancy().bytes,
            fits,
            bytes: self.residency.resident_bytes(bricks),
        }
    }

    /// Works out what to load; builds the scene's tables on the way.
    fn wish(&self, request: &LoadRequest, store: &OpenStore) -> Result<Wish, NodeError> {
        let grid = store.store.manifest().grid;
        let all = request.bricks.iter().chain(&request.release);
        if let Some(&brick) = all.into_iter().find(|brick| u64::from(brick.linear()) >= grid.brick_count()) {
            return Err(NodeError::NoSuchBrick { brick, last: grid.brick_count().saturating_sub(1) });
        }
        let choice = BrickChoice::new(&*store.store, &request.scene, &self.tables)?;
        // What the scene does not show need not be there.
        let chosen = |&brick: &_| {
            choice.of(grid.index_of(brick), Sides::default(), &*self.raycaster).map(|chosen| chosen.wanted)
        };
        let mut bricks: Vec<Wanted> = request.bricks.iter().filter_map(chosen).collect();
        let largest = bricks.iter().map(Wanted::need).fold(Need::default(), Need::max);
        // A frame says which brick is too large.
        let none = BrickShares { at_once: 1, loading: 0, resident: 0 };
        let shares = self.residency.shares(largest, store.store.is_far()).unwrap_or(none);
        let mut bytes = 0_u64;
        bricks.retain(|wanted| {
            bytes = bytes.saturating_add(wanted.bytes);
            bytes <= shares.resident
        });
        let fits = bytes <= shares.resident;
        let look = choice.look_traits();
        let may_lack = store.store.manifest().no_data.is_some();
        let traits = bricks.iter().flat_map(|w| w.key.recipe.traits(may_lack)).chain([BrickTraits::default()]);
        let keys = traits.map(|brick| KernelKey::of(look, brick)).collect();
        Ok(Wish { keys, bricks, fits, shares })
    }
}

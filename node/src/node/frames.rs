//! Frames: from the order to the last part.

use std::cell::RefCell;
use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast_proto::{FramePart, LevelPart, Part, Receipt, RenderOrder, StoreQuery};
use brickcast_volume::lod::Borders;
use tokio::runtime::Handle;
use tokio::sync::mpsc;
use tokio::sync::mpsc::error::{SendTimeoutError, TrySendError};
use tokio::time::MissedTickBehavior;

use super::{Node, flatten};
use crate::clients::limits::MAX_WAITING;
use crate::clients::{Caller, Client, Turn};
use crate::error::NodeError;
use crate::render::{FrameMeter, Turns, render_frame};
use crate::stores::{OpenStore, Source, Sources};

/// Parts between the renderer and the connection: 4 MiB of tiles at most.
const PARTS_IN_FLIGHT: usize = 64;
/// A client that takes no part for this long is given up, so that it cannot hold memory. Others have their turn
/// meanwhile.
pub(super) const STALL_TIMEOUT: Duration = Duration::from_secs(10);
/// How often a client hears of an order that waits or is worked on: well below what it takes for hanging.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(200);

/// The parts of a frame as they are made; ends after the receipt or an error.
pub type Parts = mpsc::Receiver<Result<FramePart, NodeError>>;
/// A level's store, and the next coarser one where it meets that.
type OpenPart = (Arc<OpenStore>, Option<Arc<OpenStore>>);
type Sender = mpsc::Sender<Result<FramePart, NodeError>>;

impl Node {
    /// Takes an order; its parts come as they are made. Dropping the receiver cancels the frame.
    ///
    /// # Errors
    /// Draining, too many orders waiting, an unknown store. What goes wrong later comes through the channel.
    pub async fn render(self: Arc<Self>, caller: Caller, order: RenderOrder) -> Result<Parts, NodeError> {
        let started = Instant::now();
        self.accepting()?;
        let place = self.places.clone().try_acquire_owned().map_err(|_| NodeError::Busy(MAX_WAITING))?;
        let order = Arc::new(order);
        let opened = order.clone();
        let open = move |node: &Self| node.open_all(&opened);
        let (root, parts) = self.aside(&caller, open).await.inspect_err(|error| self.life.failed(error))?;
        let (tx, rx) = mpsc::channel(PARTS_IN_FLIGHT);
        let client = caller.client;
        let turn = self.turns.turn(client);
        tokio::spawn(async move {
            // Free before the stream ends: the next order may come at once.
            let _places = (place, caller);
            let coming = async {
                tokio::select! {
                    turn = turn => Some(turn),
                    () = tx.closed() => None,
                }
            };
            let Some(turn) = self.while_telling(&tx, &order, coming).await else { return };
            let (node, worker, ordered) = (self.clone(), tx.clone(), order.clone());
            let work = move || {
                let sources = match &parts[..] {
                    [] => Sources::of(&root),
                    parts => {
                        let parts = parts.iter().map(|(store, coarser)| Source { store, coarser: coarser.as_deref() });
                        Sources { root: &root, parts: parts.collect() }
                    }
                };
                node.render_now(&ordered, &sources, started, &worker, (client, turn))
            };
            let done = flatten(self.while_telling(&tx, &order, tokio::task::spawn_blocking(work)).await);
            let last = match done {
                Ok(receipt) => {
                    self.life.rendered();
                    tell(client, &order, &receipt);
                    Ok(part_of(&order, Part::Receipt(receipt)))
                }
                Err(error) => {
                    self.life.failed(&error);
                    match &error {
                        NodeError::Cancelled => tracing::debug!(%client, "{error}"),
                        _ => tracing::warn!(%client, "frame failed: {error}"),
                    }
                    Err(error)
                }
            };
            // Nobody may be there to hear it.
            let _ = tx.send_timeout(last, self.stall_timeout).await;
        });
        Ok(rx)
    }

    /// What comes of `work`, while the client is told that something is done.
    async fn while_telling<T>(&self, tx: &Sender, order: &RenderOrder, work: impl Future<Output = T>) -> T {
        let mut interval = tokio::time::interval(PROGRESS_INTERVAL);
        interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
        interval.reset();
        tokio::pin!(work);
        loop {
            tokio::select! {
                biased;
                done = &mut work => return done,
                _ = interval.tick() => {
                    // A client that takes nothing is told nothing.
                    let _ = tx.try_send(Ok(part_of(order, Part::Progress { work: self.pulse.count() })));
                }
            }
        }
    }

    /// The order's store, and of each of its parts that level's and, where bricks meet it, the next coarser one's.
    fn open_all(&self, order: &RenderOrder) -> Result<(Arc<OpenStore>, Vec<OpenPart>), NodeError> {
        let root = self.stores.query(&StoreQuery::Hash(order.store))?;
        let part = |part: &LevelPart| {
            let store = self.stores.by_hash(part.store)?;
            let meets = part.borders.as_ref().is_some_and(Borders::meet_coarser);
            let coarser = meets.then(|| self.stores.coarser(&store)).transpose()?;
            Ok((store, coarser))
        };
        let parts = order.parts.iter().map(part).collect::<Result<_, NodeError>>()?;
        Ok((root, parts))
    }

    /// Renders on this (blocking) thread. The turn is given to others between slices, and while the client takes no
    /// parts.
    fn render_now(
        &self,
        order: &RenderOrder,
        sources: &Sources<'_>,
        started: Instant,
        parts: &Sender,
        (caller, turn): (Client, Turn),
    ) -> Result<Receipt, NodeError> {
        let desk = Desk { node: self, parts, client: caller, turn: RefCell::new(Some(turn)) };
        let mut meter = FrameMeter::new(started, order.layers.len());
        let client = parts.clone();
        let cancelled = self.unwanted(move || client.is_closed());
        let cache = self.cache.share_until(cancelled.clone());
        let mut emit = |part| desk.send(Ok(part_of(order, part)));
        let workshop = self.workshop(order.session, &cache);
        match render_frame(order, sources, workshop, &mut meter, (&cancelled, &desk), &mut emit) {
            Ok(()) => Ok(meter.receipt()),
            Err(NodeError::Cancelled) if self.stopped() => Err(NodeError::Draining),
            Err(error) => {
                sources.stores().for_each(|store| self.note_broken(&error, store));
                Err(error)
            }
        }
    }
}

/// A line of the log, for whoever wants to know more.
fn tell(client: Client, order: &RenderOrder, receipt: &Receipt) {
    let (size, Receipt { bricks, samples, .. }) = (order.scene.view.size, receipt);
    let view = format!("{}x{}", size.width(), size.height());
    // A tenth of a millisecond is told.
    let ms = (receipt.render_ms * 10.0).round() / 10.0;
    tracing::debug!(%client, frame = order.frame.0, view, bricks, ms, samples, "frame");
}

fn part_of(order: &RenderOrder, part: Part) -> FramePart {
    FramePart { frame: order.frame, epoch: order.epoch, part }
}

/// Where a frame is made: its turn, and the way to its client. On a blocking thread.
struct Desk<'a> {
    node: &'a Node,
    parts: &'a Sender,
    client: Client,
    turn: RefCell<Option<Turn>>,
}

impl Desk<'_> {
    /// Sends a part. Others have the turn while the client takes none, but it must not wait for ever.
    fn send(&self, part: Result<FramePart, NodeError>) -> Result<(), NodeError> {
        let part = match self.parts.try_send(part) {
            Ok(()) => return Ok(()),
            Err(TrySendError::Closed(_)) => return Err(NodeError::Cancelled),
            Err(TrySendError::Full(part)) => part,
        };
        self.turn.replace(None);
        let limit = self.node.stall_timeout;
        match Handle::current().block_on(self.parts.send_timeout(part, limit)) {
            Ok(()) => self.wait_for_the_turn(),
            Err(SendTimeoutError::Closed(_)) => Err(NodeError::Cancelled),
            Err(SendTimeoutError::Timeout(_)) => Err(NodeError::Stalled(limit.as_secs())),
        }
    }

    fn wait_for_the_turn(&self) -> Result<(), NodeError> {
        let turn = Handle::current().block_on(async {
            tokio::select! {
                turn = self.node.turns.turn(self.client) => Some(turn),
                () = self.parts.closed() => None,
            }
        });
        let came = turn.is_some();
        self.turn.replace(turn);
        if came { Ok(()) } else { Err(NodeError::Cancelled) }
    }
}

impl Turns for Desk<'_> {
    fn are_wanted(&self) -> bool {
        self.node.turns.is_wanted()
    }

    fn give_way(&self) -> Result<(), NodeError> {
        self.turn.replace(None);
        self.wait_for_the_turn()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;

    use brickcast_volume::{BrickGrid, MergeTree, Orbit};

    use super::super::tests::Bench;
    use super::*;
    use crate::testing::{DIMS, scene, whole_order};

    const LIMIT: Duration = Duration::from_secs(30);

    impl Bench {
        /// The whole volume in a picture of `side` x `side`.
        async fn start(&self, side: u32, zoom: f64) -> Parts {
            let tree = MergeTree::of(BrickGrid::new(DIMS.into(), 8).unwrap());
            let camera = scene(1, 1, Orbit { zoom, ..Orbit::default() }).view.camera;
            let order = whole_order(&tree, self.hash, scene(side, side, Orbit::default()).seen_by(camera));
            self.node.clone().render(Caller::default(), order).await.unwrap()
        }

        /// More parts than may be in flight, as many as that being there.
        async fn render_unheard(&self) -> Parts {
            let parts = self.start(4096, 4.0).await;
            until(|| parts.len() == PARTS_IN_FLIGHT).await;
            parts
        }

        fn is_idle(&self) -> bool {
            self.node.places.available_permits() == MAX_WAITING + 1
        }
    }

    async fn until(is_so: impl Fn() -> bool) {
        let waiting = async {
            while !is_so() {
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
        };
        tokio::time::timeout(LIMIT, waiting).await.unwrap();
    }

    /// Tiles, and the receipt where there is one.
    async fn heard(mut parts: Parts) -> (u32, Option<Receipt>) {
        let (mut tiles, mut receipt) = (0, None);
        while let Some(part) = tokio::time::timeout(LIMIT, parts.recv()).await.unwrap() {
            match part.unwrap().part {
                Part::Tile(_) => tiles += 1,
                Part::Receipt(last) => receipt = Some(last),
                _ => {}
            }
        }
        (tiles, receipt)
    }

    /// Whoever takes nothing waits alone: others have their turn meanwhile, and it is told at last.
    #[tokio::test(flavor = "multi_thread")]
    async fn a_client_that_takes_no_parts_does_not_hold_the_turn() {
        let bench = Bench::with_limit(LIMIT);
        let parts = bench.render_unheard().await;
        let theirs = bench.node.turns.turn(Client::V6(1));
        let theirs = tokio::time::timeout(LIMIT / 2, theirs).await.unwrap();
        assert_eq!(parts.len(), PARTS_IN_FLIGHT, "it waits");
        drop(theirs);
        let (tiles, receipt) = heard(parts).await;
        assert_eq!(Some(tiles), receipt.map(|receipt| receipt.tiles));
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_client_that_takes_no_parts_is_given_up() {
        let bench = Bench::with_limit(Duration::from_millis(100));
        let parts = bench.render_unheard().await;
        until(|| bench.is_idle()).await;
        let (_, receipt) = heard(parts).await;
        assert_eq!(receipt, None);
    }

    /// However long the others may take whose turn it is.
    #[tokio::test(flavor = "multi_thread")]
    async fn a_frame_whose_client_goes_waits_for_no_turn() {
        let bench = Bench::with_limit(LIMIT);
        let _theirs = bench.node.turns.turn(Client::V6(1)).await;
        // For its first turn.
        let parts = bench.start(64, 1.0).await;
        assert!(!bench.is_idle());
        drop(parts);
        until(|| bench.is_idle()).await;
        // For another one, on its way.
        let (tx, rx) = mpsc::channel(1);
        let waiting = bench.node.clone();
        let wait = tokio::task::spawn_blocking(move || {
            let desk = Desk { node: &waiting, parts: &tx, client: Client::Local, turn: RefCell::new(None) };
            desk.wait_for_the_turn()
        });
        drop(rx);
        let waited = tokio::time::timeout(LIMIT, wait).await.unwrap().unwrap();
        assert!(matches!(waited, Err(NodeError::Cancelled)), "{waited:?}");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_frame_whose_client_goes_loads_no_more() {
        let bench = Bench::with_limit(LIMIT);
        let permits = bench.raycaster.hold_uploads();
        let parts = bench.start(64, 1.0).await;
        until(|| bench.raycaster.asked.load(Ordering::SeqCst) > 0).await;
        drop((parts, permits));
        until(|| bench.is_idle()).await;
        let loaded = bench.raycaster.uploads.load(Ordering::SeqCst);
        assert!(loaded < 40, "{loaded} bricks");
    }
}

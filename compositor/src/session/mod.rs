//! A session with some nodes on one store: load, then frame after frame.

pub mod audit;
mod balanced;
mod error;
pub mod stats;

use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast_proto::{NodeDescription, StoreDescription};
use brickcast_volume::scene::{Look, Quality, Scene, Transport};
use brickcast_volume::{Epoch, FrameId};
use futures_util::future::join_all;

pub use self::balanced::BalanceStats;
pub use self::error::SessionError;
pub use self::stats::{FrameFaults, FrameStats, LoadStats};
pub use crate::cluster::StoreChoice;

use self::balanced::Balanced;
use crate::balance::{Mode, Settings};
use crate::cluster::{Cluster, ClusterError, Dial, NodeList, Outlook};
use crate::frame::blend::{blend, classified};
use crate::frame::{self, FrameError, FrameOrder};
use crate::picture::Picture;
use crate::plan::{Assignment, InView, Shown, StoreFacts};

/// Between two attempts to load on a node that is busy.
const BUSY_PAUSE: Duration = Duration::from_millis(250);
/// A node that is busy for longer does not get to load: the others take its share.
const BUSY_LIMIT: Duration = Duration::from_secs(60);

/// A frame, complete or marked as not.
#[derive(Debug)]
pub struct Frame {
    pub picture: Picture,
    pub complete: bool,
    /// What is missing and why, in words; empty for a complete frame.
    pub problems: Vec<String>,
    /// Tiles of 64 pixels for which an answer is missing.
    pub missing_tiles: Vec<[u32; 2]>,
    pub stats: FrameStats,
}

/// Nodes that all hold one store. They may come and go.
#[derive(Debug)]
pub struct Session {
    cluster: Cluster,
    dial: Dial,
    store: StoreFacts,
    next_frame: u64,
    fixed: Option<Assignment>,
    planned: Option<Planned>,
    balance: Settings,
    balanced: Option<Balanced>,
}

/// What is the same for every view of a sequence: kept until look, quality or the table changes.
#[derive(Debug, Clone)]
struct Planned {
    look: Look,
    quality: Quality,
    shown: Arc<Shown>,
    assignment: Arc<Assignment>,
    epoch: Epoch,
}

impl Planned {
    fn shows(&self, scene: &Scene) -> bool {
        self.look == scene.look && self.quality == scene.quality
    }
}

impl Session {
    /// Connects to the nodes (`host:port`, `dns:NAME:PORT`, `file:PATH`), agrees on the store, and follows them from now on.
    ///
    /// # Errors
    /// A node that was named by itself and cannot be reached, speaks another protocol, lacks the store or has another content
    /// under its name; no node that serves. Each is named.
    pub async fn open(nodes: &[String], choice: StoreChoice) -> Result<Self, SessionError> {
        Self::open_through(Dial::default(), nodes, choice).await
    }

    /// As [`Session::open`], with connections of another kind.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub async fn open_through(dial: Dial, nodes: &[String], choice: StoreChoice) -> Result<Self, SessionError> {
        let (cluster, store) =
            Cluster::open(NodeList::parse(nodes).map_err(ClusterError::Discovery)?, &dial, &choice).await?;
        let balance = Settings { mode: Mode::Off, ..Settings::default() };
        let store = facts(&store);
        Ok(Self { cluster, dial, store, next_frame: 1, fixed: None, planned: None, balance, balanced: None })
    }

    #[must_use]
    pub fn store(&self) -> &StoreFacts {
        &self.store
    }

    /// The nodes of the table: address and description.
    pub fn members(&self) -> impl Iterator<Item = (&str, &NodeDescription)> {
        self.cluster.members().map(|(_, member)| (member.client.address(), &member.description))
    }

    /// Renders by this table of chunks from now on, instead of contiguous runs.
    pub fn assign(&mut self, assignment: Assignment) {
        self.fixed = Some(assignment);
        self.cluster.advance();
    }

    /// Balances by these settings from now on; what was learnt before is forgotten. Off where nobody called this.
    pub fn balance(&mut self, settings: Settings) {
        self.balance = settings;
        self.balanced = None;
    }

    fn plan(&mut self, scene: &Scene) -> (Arc<Shown>, Arc<Assignment>) {
        let same = self.planned.as_ref().filter(|p| p.shows(scene));
        if let Some(p) = same.filter(|p| p.epoch == self.cluster.epoch()) {
            return (p.shown.clone(), p.assignment.clone());
        }
        let shown = same.map_or_else(|| Arc::new(Shown::in_scene(&self.store, scene)), |p| p.shown.clone());
        let slots = self.cluster.slots();
        let outlook = Outlook { scene: scene.clone(), shown: shown.clone(), fixed: self.fixed.clone(), slots };
        let assignment = Arc::new(outlook.table());
        self.cluster.expect(outlook);
        self.planned = Some(Planned {
            look: scene.look.clone(),
            quality: scene.quality,
            shown: shown.clone(),
            assignment: assignment.clone(),
            epoch: self.cluster.epoch(),
        });
        (shown, assignment)
    }

    /// Makes every node load the bricks that it will render of `scene`, from any view, and warm its pipelines. A node that fails
    /// leaves the table, and the others load its share.
    ///
    /// # Errors
    /// No node that could is left.
    pub async fn load(&mut self, scene: &Scene) -> Result<LoadStats, SessionError> {
        let started = Instant::now();
        let mut stats = LoadStats { load_ms: 0.0, decoded_bytes: 0, owned_bytes: 0, shown_bricks: 0, fits: true };
        loop {
            self.cluster.settle();
            let (shown, assignment) = self.plan(scene);
            stats.shown_bricks = shown.brick_count();
            let answers = join_all(self.cluster.members().map(|(position, member)| {
                let bricks = assignment.bricks_of(&shown, position);
                let request = self.cluster.loading(bricks, scene.clone());
                let mut client = member.client.clone();
                async move { (position, client.prepare(request).await) }
            }));
            let (mut again, mut pause, mut fits) = (false, Duration::ZERO, true);
            for (position, answer) in answers.await {
                match answer {
                    Ok(receipt) => {
                        stats.decoded_bytes += receipt.decoded_bytes;
                        stats.owned_bytes += receipt.owned_bytes;
                        fits &= receipt.fits;
                    }
                    Err(error) if error.is_busy() && started.elapsed() < BUSY_LIMIT => {
                        (again, pause) = (true, BUSY_PAUSE);
                    }
                    Err(error) => {
                        again = true;
                        tracing::warn!("loading: {error}; the others load its share");
                        self.cluster.lose(position, error.to_string());
                    }
                }
            }
            if self.cluster.members().next().is_none() {
                return Err(FrameError::NoNodeLeft(self.cluster.reasons()).into());
            }
            tokio::time::sleep(pause).await;
            if !again {
                stats.load_ms = started.elapsed().as_secs_f64() * 1e3;
                stats.fits = fits;
                return Ok(stats);
            }
        }
    }

    /// Renders one frame; it ends by count or by deadline, whichever comes first. What nodes that fail on the way leave open
    /// is rendered by the others.
    ///
    /// # Errors
    /// No node is left. A frame of which a part is missing at the deadline is returned, marked incomplete.
    pub async fn render(
        &mut self,
        scene: &Scene,
        transport: Transport,
        deadline: Duration,
    ) -> Result<Frame, SessionError> {
        let view = scene.view_of(&self.store.manifest.geometry)?;
        self.cluster.settle();
        let (shown, assignment) = self.plan(scene);
        let frame = FrameId(self.next_frame);
        self.next_frame += 1;

        let started = Instant::now();
        let in_view = InView::new(&shown, &view);
        let ghost = scene.ghost();
        let balanced = match self.balance.mode {
            Mode::Static | Mode::Dynamic if self.fixed.is_none() => {
                let made = self.balanced.take().filter(|b| b.is_for(&shown));
                let made =
                    made.unwrap_or_else(|| Balanced::new(self.balance.clone(), &self.store, shown.clone(), ghost));
                Some(self.balanced.insert(made))
            }
            _ => None,
        };
        let table = balanced.map(|b| b.table(&mut self.cluster, &assignment, &in_view, &view));
        let table = table.as_ref().unwrap_or(&assignment);
        let epoch = self.cluster.epoch();
        let order = FrameOrder {
            session: self.cluster.session(),
            frame,
            epoch,
            store: self.store.hash,
            scene,
            transport,
            deadline,
        };
        let workers = frame::workers(&self.cluster);
        let end = frame::run(&order, workers, (&shown, &in_view), table, &self.dial).await?;
        let complete = end.ledger.is_complete();
        let clean = complete && end.reissued == 0 && end.lost.is_empty();
        let balance = self.balanced.as_mut().map(|b| b.learn(&self.cluster, scene, &end.costs, clean));
        for (position, lost) in &end.lost {
            self.cluster.lose(*position, lost.why.clone());
        }
        let missing_tiles = end.ledger.missing_tiles();
        let (ledger, tree, from, size) = (end.ledger, self.store.tree(), view.viewpoint(), scene.view.size);
        let (mode, function, range) =
            (scene.look.style.mode, scene.look.transfer_function.clone(), self.store.manifest.range);
        let join = move || classified(blend(&ledger, &tree, from, size, mode)?, mode, &function, range);
        let picture = tokio::task::spawn_blocking(join).await.map_err(FrameError::Task)??;
        let frame_ms = started.elapsed().as_secs_f64() * 1e3;
        let lost = end.lost.into_iter().map(|(_, lost)| lost).collect();
        let faults = FrameFaults { epoch: epoch.0, reissued: end.reissued, lost };
        let stats = FrameStats::sum(frame_ms, (end.tiles, end.bytes_received), complete, faults, end.nodes);
        let stats = FrameStats { balance, ..stats };
        Ok(Frame { picture, complete, problems: end.problems, missing_tiles, stats })
    }
}

fn facts(description: &StoreDescription) -> StoreFacts {
    StoreFacts {
        hash: description.hash,
        manifest: description.manifest.clone(),
        ranges: description.ranges.clone(),
        facts: description.facts.as_ref().map(|table| table.0.clone()),
    }
}

//! Sessions on a cluster of nodes that hold one store: load, then frame after frame.
//!
//! What it awaits is type-erased: the body of an `async fn` is compiled again in every crate that awaits it.

pub mod audit;
mod balanced;
mod cluster;
mod error;
pub mod interval;
mod look;
pub mod stats;

use std::hash::{BuildHasher as _, RandomState};
use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast_proto::NodeDescription;
use brickcast_volume::pixel::Coloring;
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::{Epoch, FrameId, SessionId};
use futures_util::future::{BoxFuture, join_all};

pub use self::balanced::BalanceStats;
pub use self::cluster::Cluster;
pub use self::error::SessionError;
pub use self::stats::{FrameFaults, FrameStats, LoadStats};
pub use crate::cluster::StoreChoice;

use self::look::ShownLook;
use crate::balance::{Demand, Settings};
use crate::cluster::{Dial, Outlook, Roster};
use crate::frame::blend::{BlendError, blend};
use crate::frame::{self, Finished, FrameError, FrameOrder, FrameSink};
use crate::picture::Picture;
use crate::plan::{Assignment, InView, StoreFacts};

/// Between two attempts to load on a node that is busy.
const BUSY_PAUSE: Duration = Duration::from_millis(250);
/// A node that is busy for longer does not get to load, where others do and can take its share.
const BUSY_LIMIT: Duration = Duration::from_secs(60);

/// A frame, complete or marked as not.
#[derive(Debug)]
pub struct Frame {
    pub picture: Picture,
    pub complete: bool,
    /// What is missing and why, in words; empty for a complete frame.
    pub problems: Vec<String>,
    /// Tiles of 64 pixels of the picture for which an answer is missing, wholly or of some of its rays.
    pub missing_tiles: Vec<[u32; 2]>,
    pub stats: FrameStats,
}

/// One user's frames on a [`Cluster`]: what is his own, and a share in all that is the cluster's.
#[derive(Debug)]
pub struct Session {
    cluster: Arc<Cluster>,
    id: SessionId,
    next_frame: u64,
    fixed: Option<Assignment>,
    planned: Option<Planned>,
}

/// What is the same for every view of a sequence: kept until the look or the table changes.
#[derive(Debug, Clone)]
struct Planned {
    look: Arc<ShownLook>,
    first: Arc<Assignment>,
    epoch: Epoch,
}

impl Session {
    /// On a cluster of its own.
    ///
    /// # Errors
    /// As [`Cluster::open`].
    pub fn open(nodes: &[String], choice: StoreChoice) -> BoxFuture<'_, Result<Self, SessionError>> {
        Self::open_through(Dial::default(), nodes, choice)
    }

    /// As [`Session::open`], with connections of another kind.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub fn open_through(
        dial: Dial,
        nodes: &[String],
        choice: StoreChoice,
    ) -> BoxFuture<'_, Result<Self, SessionError>> {
        Box::pin(async move { Ok(Cluster::open(dial, nodes, choice).await?.session()) })
    }

    /// On a cluster that others use, too.
    #[must_use]
    pub fn on(cluster: Arc<Cluster>) -> Self {
        Self { cluster, id: new_id(), next_frame: 1, fixed: None, planned: None }
    }

    #[must_use]
    pub fn cluster(&self) -> &Arc<Cluster> {
        &self.cluster
    }

    #[must_use]
    pub fn store(&self) -> &StoreFacts {
        self.cluster.store()
    }

    /// The nodes of the table: address and description.
    pub fn members(&self) -> impl Iterator<Item = (String, NodeDescription)> {
        self.cluster.members().into_iter()
    }

    /// Renders by this table of chunks from now on, instead of contiguous runs.
    pub fn assign(&mut self, assignment: Assignment) {
        self.fixed = Some(assignment);
        self.cluster.advance();
    }

    /// As [`Cluster::balance`]: for all sessions.
    pub fn balance(&mut self, settings: Settings) {
        self.cluster.balance(settings);
    }

    /// What `scene` shows, and the table of these nodes.
    fn plan(&mut self, scene: &Scene, roster: &Roster) -> (Arc<ShownLook>, Arc<Assignment>) {
        let same = self.planned.take().filter(|p| p.look.is_of(scene));
        let planned = match same {
            Some(planned) if planned.epoch == roster.epoch => planned,
            same => {
                let look = same.map_or_else(|| self.cluster.look(scene), |p| p.look);
                let (fixed, slots) = (self.fixed.clone(), roster.presence());
                let outlook = Outlook { scene: scene.clone(), shown: look.shown.clone(), fixed, slots };
                let first = Arc::new(outlook.table());
                self.cluster.expect(self.id, outlook);
                Planned { look, first, epoch: roster.epoch }
            }
        };
        let plan = (planned.look.clone(), planned.first.clone());
        self.planned = Some(planned);
        plan
    }

    /// Makes every node load the bricks that it will render of `scene`, from any view, and warm its pipelines. A node
    /// that fails leaves the table, and the others load its share.
    ///
    /// # Errors
    /// No node that could is left.
    pub fn load<'a>(&'a mut self, scene: &'a Scene) -> BoxFuture<'a, Result<LoadStats, SessionError>> {
        Box::pin(self.loaded(scene))
    }

    async fn loaded(&mut self, scene: &Scene) -> Result<LoadStats, SessionError> {
        let started = Instant::now();
        let mut stats = LoadStats { load_ms: 0.0, decoded_bytes: 0, owned_bytes: 0, shown_bricks: 0, fits: true };
        loop {
            let roster = self.cluster.settled();
            let (look, first) = self.plan(scene, &roster);
            let homes = self.fixed.is_none().then(|| self.cluster.homes(&roster, &first)).flatten();
            let table = homes.as_ref().unwrap_or(&first);
            stats.shown_bricks = look.shown.brick_count();
            let answers = join_all(roster.members().map(|(position, member)| {
                let bricks = table.bricks_of(&look.shown, position);
                let request = roster.loading(self.id, bricks, scene.clone());
                let (serial, mut client) = (member.serial, member.client.clone());
                async move { (serial, client.patience(), client.load(request).await) }
            }));
            let (mut again, mut pause, mut fits) = (false, Duration::ZERO, true);
            let answers = answers.await;
            let somebody_loads = answers.iter().any(|(_, _, answer)| answer.is_ok());
            for (serial, patience, answer) in answers {
                let limit = busy_limit(somebody_loads, patience);
                match answer {
                    Ok(receipt) => {
                        stats.decoded_bytes += receipt.decoded_bytes;
                        stats.owned_bytes += receipt.owned_bytes;
                        fits &= receipt.fits;
                    }
                    Err(error) if error.is_busy() && started.elapsed() < limit => {
                        (again, pause) = (true, BUSY_PAUSE);
                    }
                    Err(error) => {
                        again = true;
                        tracing::warn!("loading: {error}; the others load its share");
                        self.cluster.lose(serial, error.to_string());
                    }
                }
            }
            let roster = self.cluster.roster();
            if roster.members().next().is_none() {
                return Err(FrameError::NoNodeLeft(roster.reasons()).into());
            }
            tokio::time::sleep(pause).await;
            if !again {
                stats.load_ms = started.elapsed().as_secs_f64() * 1e3;
                stats.fits = fits;
                return Ok(stats);
            }
        }
    }

    /// Renders one frame; it ends by count or by deadline, whichever comes first. What nodes that fail on the way leave
    /// open is rendered by the others.
    ///
    /// # Errors
    /// No node is left. A frame of which a part is missing at the deadline is returned, marked incomplete.
    pub fn render<'a>(
        &'a mut self,
        scene: &'a Scene,
        transport: Transport,
        deadline: Duration,
    ) -> BoxFuture<'a, Result<Frame, SessionError>> {
        Box::pin(async move { self.rendered(scene, transport, deadline, &mut ()).await })
    }

    /// As [`Session::render`]; `sink` hears of the tiles as they are finished. Dropping the future cancels the frame on
    /// the nodes.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub fn render_into<'a>(
        &'a mut self,
        scene: &'a Scene,
        transport: Transport,
        deadline: Duration,
        sink: &'a mut dyn FrameSink,
    ) -> BoxFuture<'a, Result<Frame, SessionError>> {
        Box::pin(self.rendered(scene, transport, deadline, sink))
    }

    async fn rendered(
        &mut self,
        scene: &Scene,
        transport: Transport,
        deadline: Duration,
        sink: &mut dyn FrameSink,
    ) -> Result<Frame, SessionError> {
        let cluster = self.cluster.clone();
        let store = cluster.store();
        // Nodes, tables and tiles are of rays; the picture is made of them at the end.
        let (seen, scene) = (scene, &scene.by_rays());
        let view = scene.view_of(&store.manifest.geometry)?;
        let roster = cluster.settled();
        let (look, first) = self.plan(scene, &roster);
        let frame = FrameId(self.next_frame);
        self.next_frame += 1;

        let started = Instant::now();
        let in_view = InView::new(&look.shown, &view);
        let divided = if self.fixed.is_none() && cluster.balances() {
            let demand = Demand { look: look.id, strips: in_view.sample_positions(&look.shown, &view) };
            cluster.divide(&look, demand, |roster| self.plan(scene, roster).1)
        } else {
            None
        };
        let (roster, table) = divided.as_ref().map_or((&roster, &*first), |d| (&d.roster, &d.table));
        let order =
            FrameOrder { session: self.id, frame, epoch: roster.epoch, store: store.hash, scene, transport, deadline };
        let finished = Finished::told_to(sink, store, seen, &view);
        let workers = frame::workers(roster);
        let end = frame::run(&order, workers, (&look.shown, &in_view), table, cluster.dial(), finished).await?;
        let complete = end.ledger.is_complete();
        let clean = complete && end.reissued == 0 && end.lost.is_empty();
        for (position, lost) in &end.lost {
            if let Some(member) = roster.member(*position) {
                cluster.lose(member.serial, lost.why.clone());
            }
        }
        let epoch = roster.epoch;
        let balance = divided.and_then(|d| cluster.learn(d, self.id, scene, &end.costs, clean));
        let (size, samples) = (seen.view.size, seen.quality.samples);
        let missing_tiles = frame::tiles_of_pixels(end.ledger.missing_tiles(), samples);
        let (ledger, tree, from, rays) = (end.ledger, store.tree(), view.viewpoint(), scene.view.size);
        let coloring = Coloring::new(scene.look.transfer_function.clone(), store.manifest.range);
        let join = move || Ok::<_, BlendError>(blend(&ledger, &tree, from, rays, &coloring)?.averaged(size, samples)?);
        let picture = tokio::task::spawn_blocking(join).await.map_err(FrameError::Task)??;
        let frame_ms = started.elapsed().as_secs_f64() * 1e3;
        let lost = end.lost.into_iter().map(|(_, lost)| lost).collect();
        let faults = FrameFaults { epoch: epoch.0, reissued: end.reissued, lost };
        let stats = FrameStats::sum(frame_ms, (end.tiles, end.bytes_received), complete, faults, end.nodes);
        let stats = FrameStats { balance, ..stats };
        Ok(Frame { picture, complete, problems: end.problems, missing_tiles, stats })
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.cluster.forget(self.id);
    }
}

/// For how long a busy node is asked again. Giving up the last ones would end the render, and only the user's
/// `patience` may do that.
fn busy_limit(somebody_loads: bool, patience: Duration) -> Duration {
    if somebody_loads { BUSY_LIMIT.min(patience) } else { patience }
}

/// A number that no other session has.
fn new_id() -> SessionId {
    SessionId(RandomState::new().hash_one(std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_busy_node_is_given_up_early_only_where_others_can_take_its_share() {
        let (short, long) = (Duration::from_secs(5), Duration::from_secs(600));
        assert_eq!((busy_limit(true, long), busy_limit(false, long)), (BUSY_LIMIT, long));
        assert_eq!((busy_limit(true, short), busy_limit(false, short)), (short, short), "the user's word is the last");
    }
}

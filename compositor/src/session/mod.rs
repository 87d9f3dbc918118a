//! Sessions on a cluster of nodes that hold one store: load, then frame after frame.
//!
//! What it awaits is type-erased: the body of an `async fn` is compiled again in every crate that awaits it.

pub mod ahead;
pub mod audit;
mod balanced;
mod cluster;
mod error;
mod hidden;
pub mod interval;
mod layered;
pub mod levels;
mod look;
pub mod stats;

use std::hash::{BuildHasher as _, RandomState};
use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast_proto::{LoadReceipt, LoadRequest, NodeDescription};
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::{Epoch, FrameId, SessionId};
use futures_util::future::{BoxFuture, join_all};

pub use self::balanced::BalanceStats;
pub use self::cluster::Cluster;
pub use self::error::SessionError;
pub use self::layered::Frame;
pub use self::stats::{FrameFaults, FrameStats, LoadStats, LodStats};
pub use crate::cluster::StoreChoice;

use self::hidden::OnLevel;
use self::layered::{Joining, Layered};
use self::look::ShownLook;
use crate::balance::{Demand, Settings};
use crate::cluster::{CallError, Dial, NodeClient, Outlook, Roster};
use crate::frame::{self, Finished, FrameError, FrameOrder, FrameSink};
use crate::plan::{Assignment, InView, Shown, StoreFacts};

/// Between two attempts to load on a node that is busy.
const BUSY_PAUSE: Duration = Duration::from_millis(250);
/// A node that is busy for longer does not get to load, where others do and can take its share.
const BUSY_LIMIT: Duration = Duration::from_secs(60);

/// One user's frames on a [`Cluster`]: what is his own, and a share in all that is the cluster's.
#[derive(Debug)]
pub struct Session {
    cluster: Arc<Cluster>,
    id: SessionId,
    next_frame: u64,
    fixed: Option<Assignment>,
    planned: Option<Planned>,
    /// What is drawn of several levels of the volume; nothing: all of it on this one.
    mixed: Option<Arc<Shown>>,
    /// All that the last scene shows, of which `planned` may be a part.
    whole: Option<Arc<ShownLook>>,
    /// Where its store is a coarser level of another.
    on_level: Option<OnLevel>,
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
        Self {
            cluster,
            id: new_id(),
            next_frame: 1,
            fixed: None,
            planned: None,
            mixed: None,
            whole: None,
            on_level: None,
        }
    }

    fn id(&self) -> SessionId {
        self.id
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

    /// Draws this of several levels from now on, or all of the volume on this one. Frames of several are not balanced:
    /// what chunks cost on one level would be taken for what they cost on another.
    fn draw_levels(&mut self, shown: Option<Arc<Shown>>) {
        let is_same = match (&self.mixed, &shown) {
            (Some(known), Some(shown)) => Arc::ptr_eq(known, shown),
            (known, shown) => known.is_none() && shown.is_none(),
        };
        if !is_same {
            (self.mixed, self.planned) = (shown, None);
        }
    }

    /// What `scene` shows of what this session draws.
    fn look(&mut self, scene: &Scene) -> Arc<ShownLook> {
        let whole = self.whole(scene);
        self.mixed.as_ref().map_or_else(|| whole.clone(), |shown| Arc::new(whole.showing(shown.clone())))
    }

    /// What `scene` shows, whether this session draws it or not.
    fn whole(&mut self, scene: &Scene) -> Arc<ShownLook> {
        let known = self.whole.take().filter(|look| look.is_of(scene));
        self.whole.insert(known.unwrap_or_else(|| self.cluster.look(scene))).clone()
    }

    /// What `scene` shows, and the table of these nodes.
    fn plan(&mut self, scene: &Scene, roster: &Roster) -> (Arc<ShownLook>, Arc<Assignment>) {
        let same = self.planned.take().filter(|p| p.look.is_of(scene));
        let planned = match same {
            Some(planned) if planned.epoch == roster.epoch => planned,
            same => {
                let look = same.map_or_else(|| self.look(scene), |p| p.look);
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
        let mut stats = LoadStats::default();
        loop {
            let roster = self.cluster.settled();
            let (look, first) = self.plan(scene, &roster);
            let homes = self.fixed.is_none().then(|| self.cluster.homes(&roster, &first)).flatten();
            let table = homes.as_ref().unwrap_or(&first);
            stats.shown_bricks = look.shown.brick_count();
            let answers = join_all(roster.members().map(|(position, member)| {
                let bricks = table.bricks_by_store(&look.shown, self.cluster.store().hash, position);
                let request = |(store, bricks)| roster.loading(self.id, (store, bricks), scene.clone());
                let requests: Vec<_> = bricks.into_iter().map(request).collect();
                let (serial, client) = (member.serial, member.client.clone());
                async move { (serial, client.patience(), load_all(client, requests).await) }
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
                    // Its frames say what becomes of that, and load the rest.
                    Err(error @ CallError::Unreadable { .. }) => tracing::debug!("loading: {error}"),
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
        let joining = Joining::new(cluster.store(), scene)?;
        let part = self.layered((scene, &scene.by_rays()), transport, deadline, sink).await?;
        let in_view = self.on_level.is_some().then(|| part.chunks_in_view());
        let mut frame = joining.join(part).await?;
        if let (Some(on_level), Some(in_view)) = (&mut self.on_level, in_view) {
            frame.hides(on_level.hidden(self.cluster.store(), scene, &in_view));
        }
        Ok(frame)
    }

    /// A frame as the nodes leave it. `seen` is what the user sees; nodes, tables and tiles are of its rays, which
    /// `scene` has as pixels.
    async fn layered(
        &mut self,
        (seen, scene): (&Scene, &Scene),
        transport: Transport,
        deadline: Duration,
        sink: &mut dyn FrameSink,
    ) -> Result<Layered, SessionError> {
        let cluster = self.cluster.clone();
        let store = cluster.store();
        let view = scene.view_of(&store.manifest.geometry)?;
        let roster = cluster.settled();
        let (look, first) = self.plan(scene, &roster);
        let frame = FrameId(self.next_frame);
        self.next_frame += 1;

        let started = Instant::now();
        let in_view = match look.shown.parts() {
            Some(parts) => {
                let views = parts.iter().map(|part| scene.view_of(&part.geometry)).collect::<Result<Vec<_>, _>>()?;
                InView::of_levels(&look.shown, &views)
            }
            None => InView::new(&look.shown, &view),
        };
        let divided = if self.fixed.is_none() && self.mixed.is_none() && cluster.balances() {
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
        let clean = end.ledger.is_complete() && end.reissued == 0 && end.lost.is_empty();
        for (position, lost) in &end.lost {
            if let Some(member) = roster.member(*position) {
                cluster.lose(member.serial, lost.why.clone());
            }
        }
        let epoch = roster.epoch;
        let balance = divided.and_then(|d| cluster.learn(d, self.id, scene, &end.costs, clean));
        let in_view = in_view.rects().collect();
        Ok(Layered { end, epoch, balance, in_view, started })
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.cluster.forget(self.id);
    }
}

/// Has a node load what it is asked for, one request after the other.
async fn load_all(mut client: NodeClient, requests: Vec<LoadRequest>) -> Result<LoadReceipt, CallError> {
    let mut all = LoadReceipt { fits: true, ..LoadReceipt::default() };
    for request in requests {
        let receipt = client.load(request).await?;
        all.load_ms += receipt.load_ms;
        all.bricks += receipt.bricks;
        all.decoded_bytes += receipt.decoded_bytes;
        all.owned_bytes += receipt.owned_bytes;
        all.bytes += receipt.bytes;
        (all.resident_bytes, all.fits) = (receipt.resident_bytes, all.fits && receipt.fits);
    }
    Ok(all)
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

//! Load balancing of a cluster: what the balancer decides becomes a table of one frame, what the frame cost becomes
//! what it knows, and what it wants loaded is loaded beside the frames (docs/adr/0005-balance.md). Frames of several
//! sessions take part, each with its look.
//!
//! A node is named to the balancer by its life in the table ([`Member::serial`]): one that comes back is another.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Weak};

use brickcast_proto::LoadRequest;
use brickcast_volume::scene::Scene;
use brickcast_volume::{BrickId, ChunkId, PerChunk, SessionId};
use serde::Serialize;
use tokio::task::JoinSet;

use super::look::ShownLook;
use crate::balance::{
    Balancer, Balancing, ChunkFacts, Demand, Load, LoadOutcome, NodeFacts, Observed, Part, Report, Seat, Settings,
};
use crate::cluster::{Member, NodeClient, Roster};
use crate::frame::NodeCost;
use crate::plan::Assignment;

/// What balancing did for one frame.
#[derive(Debug, Clone, Serialize)]
pub struct BalanceStats {
    pub mode: Balancing,
    /// In the order of the report's seats.
    pub addresses: Vec<String>,
    /// As of the end of the frame; other sessions' frames are in it.
    #[serde(flatten)]
    pub report: Report,
    /// Chunks whose primary is another than in the frame before that showed them, whosever that was.
    pub moved: Vec<ChunkId>,
    /// What nodes began to load beside their frames.
    pub loads: Vec<Load>,
}

/// The balancer of a cluster, for what its sessions show.
#[derive(Debug)]
pub(crate) struct Balanced {
    generation: u64,
    settings: Settings,
    balancer: Balancer,
    /// Those that the balancer was told of.
    looks: Vec<Weak<ShownLook>>,
    /// The nodes that it was told of, as of the last frame that began.
    roster: Option<Roster>,
    seats: BTreeSet<Seat>,
    loads: JoinSet<(Load, LoadOutcome)>,
    /// Who was a chunk's primary last.
    owners: BTreeMap<ChunkId, Seat>,
}

/// One frame's share of it, kept while the frame is under way.
#[derive(Debug)]
pub(crate) struct Divided {
    generation: u64,
    demand: Demand,
    look: Arc<ShownLook>,
    pub(crate) roster: Roster,
    pub(crate) table: Assignment,
    moved: Vec<ChunkId>,
}

impl Divided {
    /// Of the balancer that made it.
    pub(super) fn generation(&self) -> u64 {
        self.generation
    }
}

impl Balanced {
    /// `generation`: which of the balancers of the cluster it is.
    pub(crate) fn new(generation: u64, settings: Settings, look: &Arc<ShownLook>) -> Self {
        Self {
            generation,
            balancer: Balancer::new(settings.clone(), chunks(std::slice::from_ref(look))),
            settings,
            looks: vec![Arc::downgrade(look)],
            roster: None,
            seats: BTreeSet::new(),
            loads: JoinSet::new(),
            owners: BTreeMap::new(),
        }
    }

    pub(super) fn generation(&self) -> u64 {
        self.generation
    }

    /// True where a look that it knows is still shown: then nodes hold what it thinks.
    pub(super) fn is_of_use(&self) -> bool {
        self.looks.iter().any(|known| known.strong_count() > 0)
    }

    /// Tells the balancer which looks are shown: this one, and those known that still are.
    pub(super) fn enter(&mut self, look: &Arc<ShownLook>) {
        let before = self.looks.len();
        let mut shown: Vec<Arc<ShownLook>> = self.looks.iter().filter_map(Weak::upgrade).collect();
        let is_new = !shown.iter().any(|known| Arc::ptr_eq(known, look));
        if is_new {
            shown.push(look.clone());
        }
        if is_new || shown.len() != before {
            let ids: Vec<_> = shown.iter().map(|look| look.id).collect();
            self.balancer.show(&ids, chunks(&shown));
            self.looks = shown.iter().map(Arc::downgrade).collect();
        }
    }

    /// The table of a frame that begins. `first` is the table that the members of the start have loaded.
    pub(crate) fn divide(
        &mut self,
        look: &Arc<ShownLook>,
        demand: Demand,
        roster: Roster,
        first: &Assignment,
    ) -> Divided {
        self.follow(&roster, first);
        let division = self.balancer.divide(&demand);
        let positions = positions(&roster);
        let mut owner: PerChunk<usize> = look.bytes.ids().map(|c| first.owner_of(c)).collect();
        let mut shared = BTreeMap::new();
        for (chunk, parts) in &division.chunks {
            let share = |p: &Part| Some((*positions.get(&p.seat)?, p.strips));
            let shares: Vec<_> = parts.iter().filter_map(share).collect();
            if let Some((position, _)) = shares.first() {
                owner[*chunk] = *position;
            }
            if parts.len() > 1 {
                shared.insert(*chunk, shares);
            }
        }
        let now: BTreeMap<ChunkId, Seat> =
            division.chunks.iter().filter_map(|(c, parts)| Some((*c, parts.first()?.seat))).collect();
        let moved = now.iter().filter(|(c, s)| self.owners.get(c).is_some_and(|o| o != *s)).map(|(c, _)| *c).collect();
        self.owners.extend(now);
        let table = Assignment::explicit(owner, roster.slots().len()).sharing(shared);
        self.roster = Some(roster.clone());
        Divided { generation: self.generation, demand, look: look.clone(), roster, table, moved }
    }

    /// Where chunks are at home: what a session loads there is where its frames will be rendered.
    pub(super) fn homes(&self, roster: &Roster, first: &Assignment) -> Assignment {
        let positions = positions(roster);
        let home = |c: ChunkId| self.balancer.home(c).and_then(|seat| positions.get(&seat).copied());
        let owner = self.balancer.chunks().map(|c| home(c).unwrap_or_else(|| first.owner_of(c))).collect();
        Assignment::explicit(owner, roster.slots().len())
    }

    /// Tells the balancer who came and who left.
    fn follow(&mut self, roster: &Roster, first: &Assignment) {
        let members: BTreeMap<Seat, (usize, &Member)> = roster.members().map(|(p, m)| (seat(m), (p, m))).collect();
        for gone in self.seats.iter().filter(|s| !members.contains_key(s)) {
            self.balancer.leave(*gone);
        }
        self.seats.retain(|s| members.contains_key(s));
        for (seat, (position, member)) in members {
            if self.seats.insert(seat) {
                let facts =
                    NodeFacts { throttle: member.description.throttle.get(), budget: member.description.memory_budget };
                let holds = match (&member.holds, self.settings.mode) {
                    (Some(holds), _) => holds.clone(),
                    (None, Balancing::Static) => Vec::new(),
                    (None, _) => first.chunks_of(position),
                };
                self.balancer.join(seat, facts, &holds);
            }
        }
    }

    /// Tells the balancer of loads that ended; true where one did its work.
    pub(super) fn land(&mut self) -> bool {
        let mut landed = false;
        while let Some(done) = self.loads.try_join_next() {
            let Ok((load, outcome)) = done else { continue };
            tracing::debug!("background load {}: {outcome:?}", load.id);
            self.balancer.finished(&load, outcome);
            landed |= matches!(outcome, LoadOutcome::Loaded { .. });
        }
        landed
    }

    /// Learns what the frame cost, and begins to load what the balancer wants elsewhere. `clean`: nothing was rendered
    /// twice or is missing.
    pub(crate) fn learn(
        &mut self,
        frame: Divided,
        session: SessionId,
        scene: &Scene,
        costs: &[NodeCost],
        clean: bool,
    ) -> BalanceStats {
        let mut chunks: BTreeMap<ChunkId, f64> = BTreeMap::new();
        for (chunk, cost) in costs.iter().flat_map(|node| &node.chunks) {
            *chunks.entry(*chunk).or_default() += cost;
        }
        // By the nodes of the frame: the table may be another by now.
        let nodes = costs.iter().filter_map(|n| Some((seat(frame.roster.member(n.position)?), n.work_ms, n.cost())));
        if clean {
            let seen = Observed { chunks: chunks.into_iter().collect(), nodes: nodes.collect() };
            self.balancer.observe(&frame.demand, &seen);
        }
        let loads = self.balancer.background();
        let roster = self.roster.as_ref().unwrap_or(&frame.roster);
        for load in loads.iter().cloned() {
            let Some((_, member)) = roster.members().find(|(_, m)| seat(m) == load.seat) else { continue };
            let requests = self.requests(&load, &frame.look, |bricks, look| {
                let scene = if Arc::ptr_eq(look, &frame.look) { scene } else { &look.scene };
                roster.loading(session, (roster.store, bricks), scene.clone())
            });
            let client = member.client.clone();
            self.loads.spawn(async move {
                let outcome = loaded(client, requests).await;
                (load, outcome)
            });
        }
        let addresses: BTreeMap<Seat, &str> = roster.members().map(|(_, m)| (seat(m), m.client.address())).collect();
        let report = self.balancer.report();
        let address = |of: &Seat| addresses.get(of).copied().unwrap_or_default().to_owned();
        BalanceStats {
            mode: self.settings.mode,
            addresses: report.seats.iter().map(|s| address(&s.seat)).collect(),
            report,
            moved: frame.moved,
            loads,
        }
    }

    /// What a node is asked for one load: `first` look's bricks, then those of the others that are shown. What it gives
    /// up it gives up first; bricks that other sessions used, too, it keeps until it needs their room.
    fn requests(
        &self,
        load: &Load,
        first: &Arc<ShownLook>,
        request: impl Fn(Vec<BrickId>, &Arc<ShownLook>) -> LoadRequest,
    ) -> Vec<LoadRequest> {
        let others = self.looks.iter().filter_map(Weak::upgrade).filter(|look| !Arc::ptr_eq(look, first));
        let looks: Vec<Arc<ShownLook>> = std::iter::once(first.clone()).chain(others).collect();
        let release: BTreeSet<BrickId> = looks.iter().flat_map(|look| look.shown.bricks_in(&load.drops)).collect();
        let mut requests = Vec::new();
        for look in &looks {
            let bricks = look.shown.bricks_in(&load.chunks);
            if requests.is_empty() || !bricks.is_empty() {
                requests.push(LoadRequest { background: true, ..request(bricks, look) });
            }
        }
        if let Some(first) = requests.first_mut() {
            first.release = release.into_iter().collect();
        }
        requests
    }
}

/// Loads beside the frames; the first that does not end well ends it.
async fn loaded(mut client: NodeClient, requests: Vec<LoadRequest>) -> LoadOutcome {
    let mut ms = 0.0;
    for request in requests {
        match client.load(request).await {
            Ok(receipt) if receipt.fits => ms += receipt.load_ms,
            Ok(_) => return LoadOutcome::DoesNotFit,
            Err(error) => {
                tracing::debug!("background load: {error}");
                return LoadOutcome::Failed;
            }
        }
    }
    LoadOutcome::Loaded { ms }
}

/// The facts of all chunks over several looks: of each the most that one of them shows, since most bricks are the same
/// ones.
fn chunks(looks: &[Arc<ShownLook>]) -> PerChunk<ChunkFacts> {
    let most = |chunk: ChunkId| looks.iter().map(|look| look.bytes[chunk]).max().unwrap_or(0);
    let facts = |bytes| ChunkFacts { bytes, prior: if bytes == 0 { 0.0 } else { 1.0 } };
    let Some(first) = looks.first() else { return PerChunk::default() };
    first.bytes.ids().map(|chunk| facts(most(chunk))).collect()
}

fn positions(roster: &Roster) -> BTreeMap<Seat, usize> {
    roster.members().map(|(position, member)| (seat(member), position)).collect()
}

fn seat(member: &Member) -> Seat {
    Seat(member.serial)
}

#[cfg(test)]
mod tests;

//! Load balancing in a session: what the balancer decides becomes a table of one frame, what the frame cost becomes what it knows, and
//! what it wants loaded is loaded beside the frames (docs/adr/0005-balance.md).
//!
//! A node is named to the balancer by its life in the table ([`Member::serial`]): one that comes back is another.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use brickcast_proto::PrepareRequest;
use brickcast_volume::View;
use brickcast_volume::scene::Scene;
use serde::Serialize;
use tokio::task::JoinSet;

use crate::balance::{
    Balancer, ChunkFacts, Demand, Load, LoadOutcome, Mode, NodeFacts, Observed, Part, Report, Seat, Settings,
};
use crate::cluster::{Cluster, Member};
use crate::frame::NodeCost;
use crate::plan::{Assignment, InView, Shown, StoreFacts};

/// Resident bytes of a stored voxel, with what kernels keep beside it: an upper estimate, of which budgets are made.
const BYTES_PER_VOXEL: u64 = 3;

/// What balancing did for one frame.
#[derive(Debug, Clone, Serialize)]
pub struct BalanceStats {
    pub mode: Mode,
    /// In the order of the report's seats.
    pub addresses: Vec<String>,
    #[serde(flatten)]
    pub report: Report,
    /// Chunks whose primary is another than in the frame before that showed them.
    pub moved: Vec<u32>,
    /// What nodes began to load beside their frames.
    pub loads: Vec<Load>,
}

/// The balancer of one session, for what one transfer function shows.
#[derive(Debug)]
pub(crate) struct Balanced {
    settings: Settings,
    balancer: Balancer,
    shown: Arc<Shown>,
    seats: BTreeSet<Seat>,
    loads: JoinSet<(Load, LoadOutcome)>,
    /// Who was a chunk's primary last, and the chunks of the frame under way for which that changed.
    owners: BTreeMap<u32, Seat>,
    moved: Vec<u32>,
}

impl Balanced {
    /// `ghost`: layers of each brick.
    pub(crate) fn new(settings: Settings, store: &StoreFacts, shown: Arc<Shown>, ghost: u32) -> Self {
        let grid = store.manifest.grid;
        let tree = shown.tree();
        let chunks = (0..tree.chunk_count() as u32).filter_map(|chunk| tree.chunk_at(chunk)).map(|chunk| {
            let stored: u64 = shown.bricks_of(chunk).map(|b| grid.owned_box(b).stored(ghost).voxel_count()).sum();
            let prior = if stored == 0 { 0.0 } else { 1.0 };
            ChunkFacts { bytes: stored * BYTES_PER_VOXEL, prior }
        });
        let balancer = Balancer::new(settings.clone(), chunks.collect());
        Self {
            settings,
            balancer,
            shown,
            seats: BTreeSet::new(),
            loads: JoinSet::new(),
            owners: BTreeMap::new(),
            moved: Vec::new(),
        }
    }

    /// True where it was made for this.
    pub(crate) fn is_for(&self, shown: &Arc<Shown>) -> bool {
        Arc::ptr_eq(&self.shown, shown)
    }

    /// The table of the next frame. `first` is the table that the members of the session's start have loaded.
    pub(crate) fn table(
        &mut self,
        cluster: &mut Cluster,
        first: &Assignment,
        in_view: &InView,
        view: &View,
    ) -> Assignment {
        self.follow(cluster, first);
        self.land(cluster);
        let strips = in_view.sample_positions(&self.shown, view);
        let division = self.balancer.divide(&Demand { strips });
        let positions: BTreeMap<Seat, usize> = cluster.members().map(|(p, m)| (seat(m), p)).collect();
        let mut owner: Vec<usize> = (0..self.shown.per_chunk().len() as u32).map(|c| first.owner_of(c)).collect();
        let mut shared = BTreeMap::new();
        for (chunk, parts) in &division.chunks {
            let share = |p: &Part| Some((*positions.get(&p.seat)?, p.strips));
            let shares: Vec<_> = parts.iter().filter_map(share).collect();
            if let Some((position, _)) = shares.first() {
                owner[*chunk as usize] = *position;
            }
            if parts.len() > 1 {
                shared.insert(*chunk, shares);
            }
        }
        let now: BTreeMap<u32, Seat> =
            division.chunks.iter().filter_map(|(c, parts)| Some((*c, parts.first()?.seat))).collect();
        self.moved = now.iter().filter(|(c, s)| self.owners.get(c).is_some_and(|o| o != *s)).map(|(c, _)| *c).collect();
        self.owners.extend(now);
        Assignment::explicit(owner, cluster.slots().len()).sharing(shared)
    }

    /// Tells the balancer who came and who left.
    fn follow(&mut self, cluster: &Cluster, first: &Assignment) {
        let members: BTreeMap<Seat, (usize, &Member)> = cluster.members().map(|(p, m)| (seat(m), (p, m))).collect();
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
                    (None, Mode::Static) => Vec::new(),
                    (None, _) => first.chunks_of(position),
                };
                self.balancer.join(seat, facts, &holds);
            }
        }
    }

    /// Loads that ended take effect from the next frame on, which is another epoch.
    fn land(&mut self, cluster: &mut Cluster) {
        let mut landed = false;
        while let Some(done) = self.loads.try_join_next() {
            let Ok((load, outcome)) = done else { continue };
            tracing::debug!("background load {}: {outcome:?}", load.id);
            self.balancer.finished(&load, outcome);
            landed |= matches!(outcome, LoadOutcome::Loaded { .. });
        }
        if landed {
            cluster.advance();
        }
    }

    /// Learns what the frame cost, and begins to load what the balancer wants elsewhere. `clean`: nothing was rendered twice or is missing.
    pub(crate) fn learn(&mut self, cluster: &Cluster, scene: &Scene, costs: &[NodeCost], clean: bool) -> BalanceStats {
        let seats: BTreeMap<usize, Seat> = cluster.members().map(|(p, m)| (p, seat(m))).collect();
        let mut chunks: BTreeMap<u32, f64> = BTreeMap::new();
        for (chunk, cost) in costs.iter().flat_map(|node| &node.chunks) {
            *chunks.entry(*chunk).or_default() += cost;
        }
        let nodes = costs.iter().filter_map(|n| Some((*seats.get(&n.position)?, n.work_ms, n.cost())));
        if clean {
            self.balancer.observe(&Observed { chunks: chunks.into_iter().collect(), nodes: nodes.collect() });
        }
        let loads = self.balancer.background();
        for load in loads.iter().cloned() {
            let Some((_, member)) = cluster.members().find(|(_, m)| seat(m) == load.seat) else { continue };
            let request = PrepareRequest {
                background: true,
                release: self.shown.bricks_in(&load.drops),
                ..cluster.loading(self.shown.bricks_in(&load.chunks), scene.clone())
            };
            let mut client = member.client.clone();
            self.loads.spawn(async move {
                let outcome = match client.prepare(request).await {
                    Ok(receipt) if receipt.fits => LoadOutcome::Loaded { ms: receipt.load_ms },
                    Ok(_) => LoadOutcome::DoesNotFit,
                    Err(error) => {
                        tracing::debug!("background load: {error}");
                        LoadOutcome::Failed
                    }
                };
                (load, outcome)
            });
        }
        let addresses: BTreeMap<Seat, &str> = cluster.members().map(|(_, m)| (seat(m), m.client.address())).collect();
        let report = self.balancer.report();
        let address = |of: &Seat| addresses.get(of).copied().unwrap_or_default().to_owned();
        BalanceStats {
            mode: self.settings.mode,
            addresses: report.seats.iter().map(|s| address(&s.seat)).collect(),
            report,
            moved: std::mem::take(&mut self.moved),
            loads,
        }
    }
}

fn seat(member: &Member) -> Seat {
    Seat(member.serial)
}

#[cfg(test)]
mod tests;

//! Our own balancer in the modelled cluster.

use brickcast_volume::PerChunk;

use super::lattice::ViewCosts;
use super::machine::Machine;
use super::outcome::ViewRow;
use super::random::noise;
use super::rivals::{Owners, share};
use super::spec::Spec;
use super::world::World;
use crate::balance::{Balancer, ChunkFacts, Load, LoadOutcome, NodeFacts, Observed, Report, Seat, Settings};

pub(super) const NAME: &str = "adaptive";

/// Cost per ms of a node that is not throttled, and bytes per ms that it loads beside its frames.
const SPEED: f64 = 500_000.0;
const RATE: f64 = 100_000.0;
/// No viewer shows more than 60 frames a second.
const LEAST_FRAME_MS: f64 = 16.0;
/// Times deviate.
const TIME_NOISE: f64 = 0.03;

pub(super) struct Adaptive {
    balancer: Balancer,
    budget: u64,
    now_ms: f64,
    /// When they will have ended, and when they began.
    loads: Vec<(f64, f64, Load)>,
    bytes: PerChunk<u64>,
}

impl Adaptive {
    /// The nodes hold contiguous runs at first.
    pub(super) fn new(world: &World, spec: &Spec, settings: &Settings) -> Self {
        let bytes: PerChunk<u64> = world.chunks().map(|c| world.bytes(c)).collect();
        let facts =
            bytes.values().zip(world.shown.values()).map(|(&bytes, &prior)| ChunkFacts { bytes, prior }).collect();
        let balancer = Balancer::new(settings.clone(), facts);
        let mut all = Self { balancer, budget: world.budget(spec), now_ms: 0.0, loads: Vec::new(), bytes };
        let runs = world.runs(spec.nodes as usize);
        let mut holds = vec![Vec::new(); spec.nodes as usize];
        runs.iter().for_each(|(chunk, node)| holds[*node].push(chunk));
        for (node, holds) in holds.iter().enumerate() {
            let facts = NodeFacts { throttle: spec.throttle_of(node as u64), budget: all.budget };
            all.balancer.join(Seat(node as u64), facts, holds);
        }
        all
    }

    pub(super) fn join(&mut self, node: u64, throttle: f64) {
        self.balancer.join(Seat(node), NodeFacts { throttle, budget: self.budget }, &[]);
    }

    pub(super) fn leave(&mut self, node: u64) {
        self.balancer.leave(Seat(node));
    }

    pub(super) fn report(&self) -> Report {
        self.balancer.report()
    }

    pub(super) fn frame(
        &mut self,
        world: &World,
        picture: &ViewCosts,
        machines: &[Machine],
        spec: &Spec,
        view: u32,
    ) -> ViewRow {
        let now = self.now_ms;
        let before = self.balancer.report();
        let (ended, under_way): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.loads).into_iter().partition(|l| l.0 <= now);
        self.loads = under_way;
        for (end, start, load) in ended {
            self.balancer.finished(&load, LoadOutcome::Loaded { ms: end - start });
        }
        let division = self.balancer.divide(&picture.demand);
        let mut owners: Owners = PerChunk::filled(Vec::new(), world.count());
        for (&chunk, parts) in &division.chunks {
            owners[chunk] = parts.iter().map(|p| (p.seat.0 as usize, p.strips)).collect();
        }
        let mut row = share(world, picture, machines, &(owners, 0, 0));
        let mut adopted = vec![0; machines.len()];
        for (seat, chunk) in &division.adopted {
            adopted[seat.0 as usize] += self.bytes[*chunk];
        }
        let ms = |n: usize| {
            let deviates = noise(TIME_NOISE, &[spec.seed, 13, u64::from(view), n as u64]);
            row.cost[n] * machines[n].throttle / SPEED * deviates
        };
        let present: Vec<usize> = (0..machines.len()).filter(|&n| machines[n].present).collect();
        let seen = Observed {
            chunks: division.chunks.keys().map(|&c| (c, picture.cost(c))).collect(),
            nodes: present.iter().map(|&n| (Seat(n as u64), ms(n), row.cost[n])).collect(),
        };
        self.balancer.observe(&picture.demand, &seen);
        let wait = |n: &usize| ms(*n) + adopted[*n] as f64 / RATE;
        self.now_ms += present.iter().map(wait).fold(LEAST_FRAME_MS, f64::max);
        for load in self.balancer.background() {
            self.loads.push((now + load.bytes as f64 / RATE, now, load));
        }
        let after = self.balancer.report();
        row.handovers = after.handovers - before.handovers;
        row.bytes_loaded = after.bytes_loaded - before.bytes_loaded + adopted.iter().sum::<u64>();
        row.predicted = Some(after.predicted_max_over_bound);
        row
    }
}

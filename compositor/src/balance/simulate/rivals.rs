//! What others would do: blocks that never change, and partitions that know all costs of the view before.

use brickcast_volume::{ChunkId, PerChunk};
use glam::UVec3;

use super::grid::chunk_at;
use super::lattice::ViewCosts;
use super::machine::Machine;
use super::outcome::ViewRow;
use super::random::hash;
use super::spec::Spec;
use super::world::World;

/// Who renders which strips of each chunk.
pub(super) type Owners = PerChunk<Vec<(usize, [u32; 2])>>;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Contiguous runs with equal numbers of shown bricks; those of nodes that left go to the others.
    Static,
    /// A k-d tree over the chunks, cut anew in each view by its true costs.
    Kd,
    /// Heaviest chunk first to the node that is done first, by true costs, as if every node held everything.
    Lpt,
    /// The same among two fixed holders of each chunk.
    Replicas2,
}

#[derive(Debug)]
pub(super) struct Rival {
    kind: Kind,
    homes: PerChunk<[usize; 2]>,
    /// Of the view before.
    last: PerChunk<Option<usize>>,
}

impl Rival {
    pub(super) fn all(world: &World, spec: &Spec) -> Vec<Self> {
        let nodes = spec.nodes as usize;
        let first = world.runs(nodes);
        let second = |(chunk, home): (ChunkId, &usize)| {
            let other = hash(&[world.seed, 11, chunk.linear().into()]) as usize % nodes.saturating_sub(1).max(1);
            [*home, (home + 1 + other) % nodes]
        };
        let homes: PerChunk<[usize; 2]> = first.iter().map(second).collect();
        let kinds = [Kind::Static, Kind::Kd, Kind::Lpt, Kind::Replicas2];
        kinds.map(|kind| Self { kind, homes: homes.clone(), last: PerChunk::filled(None, world.count()) }).into()
    }

    pub(super) fn name(&self) -> &'static str {
        match self.kind {
            Kind::Static => "static",
            Kind::Kd => "kd",
            Kind::Lpt => "lpt",
            Kind::Replicas2 => "replicas2",
        }
    }

    /// One view: who renders what, how many chunks changed their owner, bytes that the new owners have to load for
    /// that.
    pub(super) fn divide(&mut self, world: &World, picture: &ViewCosts, machines: &[Machine]) -> (Owners, u64, u64) {
        let present: Vec<usize> = (0..machines.len()).filter(|&n| machines[n].present).collect();
        let owner = match self.kind {
            Kind::Static => {
                let runs = world.runs(present.len());
                let stays = |c: ChunkId| {
                    let home = self.homes[c][0];
                    if machines[home].present { home } else { present[runs[c]] }
                };
                world.chunks().map(stays).collect()
            }
            Kind::Kd => {
                let mut owner = PerChunk::filled(present[0], world.count());
                cut(world, picture, machines, &present, [UVec3::ZERO, world.dims], &mut owner);
                owner
            }
            Kind::Lpt => lpt(world, picture, machines, |_| present.clone()),
            Kind::Replicas2 => lpt(world, picture, machines, |c| {
                let homes: Vec<usize> = self.homes[c].iter().copied().filter(|&n| machines[n].present).collect();
                if homes.is_empty() { present.clone() } else { homes }
            }),
        };
        let (mut changed, mut bytes) = (0, 0);
        let mut owners = PerChunk::filled(Vec::new(), world.count());
        for (chunk, seen) in picture.seen.iter() {
            let Some(seen) = seen else { continue };
            owners[chunk] = vec![(owner[chunk], [0, seen.cost.len() as u32])];
            if self.last[chunk].replace(owner[chunk]).is_some_and(|last| last != owner[chunk]) {
                changed += 1;
                let held = self.kind == Kind::Replicas2 && self.homes[chunk].contains(&owner[chunk]);
                bytes += if held { 0 } else { world.bytes(chunk) };
            }
        }
        (owners, changed, bytes)
    }
}

fn lpt(
    world: &World,
    picture: &ViewCosts,
    machines: &[Machine],
    holders: impl Fn(ChunkId) -> Vec<usize>,
) -> PerChunk<usize> {
    let mut order: Vec<(f64, ChunkId)> = world.chunks().map(|c| (picture.cost(c), c)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut load = vec![0.0; machines.len()];
    let mut owner = PerChunk::filled(0, world.count());
    for (cost, chunk) in order {
        let after = |n: &usize| load[*n] + machines[*n].throttle * cost;
        let best = holders(chunk).into_iter().min_by(|a, b| after(a).total_cmp(&after(b))).unwrap_or_default();
        load[best] += machines[best].throttle * cost;
        owner[chunk] = best;
    }
    owner
}

/// Cuts a box of chunks at the plane that divides its cost most nearly as the speeds of two halves of the nodes.
fn cut(
    world: &World,
    picture: &ViewCosts,
    machines: &[Machine],
    nodes: &[usize],
    [lo, hi]: [UVec3; 2],
    owner: &mut PerChunk<usize>,
) {
    let chunk = |p: UVec3| chunk_at(world.dims, p);
    let cells = |lo: UVec3, hi: UVec3| {
        (lo.z..hi.z).flat_map(move |z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| UVec3::new(x, y, z))))
    };
    if nodes.len() < 2 || (hi - lo) == UVec3::ONE {
        // The fastest of them, where there is nothing left to cut.
        let fastest = nodes.iter().copied().min_by(|a, b| machines[*a].throttle.total_cmp(&machines[*b].throttle));
        cells(lo, hi).for_each(|p| owner[chunk(p)] = fastest.unwrap_or_default());
        return;
    }
    let (left, right) = nodes.split_at(nodes.len() / 2);
    let speed = |nodes: &[usize]| nodes.iter().map(|&n| 1.0 / machines[n].throttle).sum::<f64>();
    let wanted = speed(left) / speed(nodes);
    let mut best = (f64::INFINITY, 0, 0);
    for axis in 0..3 {
        let mut layers = vec![0.0; (hi[axis] - lo[axis]) as usize];
        cells(lo, hi).for_each(|p| layers[(p[axis] - lo[axis]) as usize] += picture.cost(chunk(p)));
        let total = layers.iter().sum::<f64>();
        let mut before = 0.0;
        for (i, layer) in layers.iter().enumerate().take(layers.len() - 1) {
            before += layer;
            let missed = if total > 0.0 { (before / total - wanted).abs() } else { 0.0 };
            if missed < best.0 {
                best = (missed, axis, lo[axis] + i as u32 + 1);
            }
        }
    }
    let (mut middle_hi, mut middle_lo) = (hi, lo);
    (middle_hi[best.1], middle_lo[best.1]) = (best.2, best.2);
    cut(world, picture, machines, left, [lo, middle_hi], owner);
    cut(world, picture, machines, right, [middle_lo, hi], owner);
}

/// What a division of a view comes to. `loaded`: chunks that changed owner, bytes loaded for that.
pub(super) fn share(
    world: &World,
    picture: &ViewCosts,
    machines: &[Machine],
    (owners, handovers, bytes_loaded): &(Owners, u64, u64),
) -> ViewRow {
    let mut cost = vec![0.0; machines.len()];
    for (seen, parts) in picture.seen.values().zip(owners.values()) {
        for &(node, [lo, hi]) in parts {
            cost[node] += seen.iter().flat_map(|s| &s.cost[lo as usize..hi as usize]).sum::<f64>();
        }
    }
    let whole = |c: ChunkId| match owners[c][..] {
        [(node, _)] => Some(node),
        _ => None,
    };
    let merged = world.tree.layers(&|c| !owners[c].is_empty(), &whole);
    let cut: Vec<ChunkId> = owners.ids().filter(|&c| owners[c].len() > 1).collect();
    let parts = cut.iter().flat_map(|&c| owners[c].iter().map(move |(_, strips)| (c, *strips)));
    let tiles = merged.iter().map(|chunks| {
        let seen = || chunks.iter().filter_map(|&c| picture.seen[c].as_ref());
        let side = |a: usize| seen().map(|s| s.hi[a]).max().unwrap_or(0) - seen().map(|s| s.lo[a]).min().unwrap_or(0);
        side(0) * side(1)
    });
    let cut_tiles = parts.clone().filter_map(|(c, strips)| Some(picture.seen[c].as_ref()?.tiles(strips)));
    let present = || (0..machines.len()).filter(|&n| machines[n].present);
    ViewRow {
        loads: present().map(|n| cost[n] * machines[n].throttle).collect(),
        layers: merged.len() as u64 + parts.count() as u64,
        tiles: (tiles.sum::<usize>() + cut_tiles.sum::<usize>()) as u64,
        handovers: *handovers,
        bytes_loaded: *bytes_loaded,
        predicted: None,
        cost,
    }
}

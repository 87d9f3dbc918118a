//! One frame's division: every chunk in view gets a primary, primaries that are overloaded hand chunks over or cut
//! them.

use brickcast_volume::ChunkId;

use super::balancer::Balancer;
use super::settings::Balancing;
use super::spread::{Own, Plan};
use super::types::{Demand, Division, Part};

/// How slowly the largest share that a chunk ever had of a frame's cost is forgotten.
const COOLING: f64 = 0.98;

impl Balancer {
    /// Who renders what of the next frame; loads that ended become effective with it.
    ///
    /// Empty while no node is present.
    pub fn divide(&mut self, demand: &Demand) -> Division {
        self.frame += 1;
        self.settle();
        self.predictor.ask(demand);
        divide(self)
    }
}

fn divide(b: &mut Balancer) -> Division {
    let present: Vec<usize> = b.table.present().collect();
    let mut division = Division::default();
    if present.is_empty() {
        b.totals.plan = Plan::default();
        return division;
    }
    let mut seen: Vec<ChunkId> = b.chunks.ids().filter(|&c| b.predictor.in_view(c)).collect();
    let total: f64 = seen.iter().map(|&c| b.predictor.cost[c]).sum();
    for chunk in b.heat.ids() {
        let now = if total > 0.0 { b.predictor.cost[chunk] / total } else { 0.0 };
        b.heat[chunk] = (b.heat[chunk] * COOLING).max(now);
    }
    // Heaviest first; ties by index.
    seen.sort_by(|&x, &y| b.predictor.cost[y].total_cmp(&b.predictor.cost[x]).then(x.cmp(&y)));

    for &node in &present {
        shed(b, node, 0, &mut division);
    }
    let mut plan = Plan::new(b.predictor.kappas(), present, total, b.chunks.count());
    appoint_all(b, &seen, &plan, &mut division);
    // What cannot change is there first: the others find their places around it.
    let (settled, free): (Vec<ChunkId>, Vec<ChunkId>) = seen.iter().partition(|c| b.is_settled(**c));
    for &chunk in settled.iter().chain(&free) {
        place(b, chunk, &mut plan);
    }
    if cuts(b) {
        plan.spread(&b.settings, &b.predictor, &b.table.holders);
    }
    for &chunk in &seen {
        division.chunks.insert(chunk, parts(b, chunk, &plan));
    }
    b.totals.splits = division.chunks.values().map(|parts| parts.len() as u64 - 1).sum();
    b.totals.adoptions += division.adopted.len() as u64;
    b.totals.plan = plan;
    division
}

fn cuts(b: &Balancer) -> bool {
    b.settings.mode == Balancing::Dynamic && b.settings.split
}

/// Gives a primary to every chunk in view that has none.
fn appoint_all(b: &mut Balancer, seen: &[ChunkId], plan: &Plan, division: &mut Division) {
    let mut load = vec![0.0; plan.kappa.len()];
    for &chunk in seen {
        if let Some(primary) = b.primary[chunk] {
            load[primary] += plan.kappa[primary] * b.predictor.cost[chunk];
        }
    }
    for &chunk in seen.iter().filter(|c| b.primary[**c].is_none()).collect::<Vec<_>>() {
        let cost = b.predictor.cost[chunk];
        let after = |node: usize| load[node] + plan.kappa[node] * cost;
        let holders = &b.table.holders[chunk];
        let index = if b.settings.mode == Balancing::Static {
            // By cost alone: whoever held it before drops it.
            let index = home(b, chunk, &plan.present, after);
            for other in b.table.holders[chunk].clone().into_iter().filter(|h| *h != index) {
                b.table.drop(other, chunk);
            }
            adopt(b, index, chunk, division);
            index
        } else if holders.is_empty() {
            let index = home(b, chunk, &plan.present, after);
            adopt(b, index, chunk, division);
            index
        } else {
            least(holders, after)
        };
        load[index] += plan.kappa[index] * cost;
        b.appoint(index, chunk);
    }
}

/// The first with the least `after`; not of an empty list.
fn least(nodes: &[usize], after: impl Fn(usize) -> f64) -> usize {
    let best = nodes.iter().copied().min_by(|&x, &y| after(x).total_cmp(&after(y)).then(x.cmp(&y)));
    best.unwrap_or_default()
}

/// Where a chunk that nobody shall have held goes: where there is room, else where copies can make room, else anywhere.
fn home(b: &Balancer, chunk: ChunkId, present: &[usize], after: impl Fn(usize) -> f64) -> usize {
    let fits = |room: &dyn Fn(usize) -> u64| -> Vec<usize> {
        let bytes = |n: usize| if b.table.nodes[n].held[chunk] { 0 } else { b.table.bytes[chunk] };
        present.iter().copied().filter(|&n| bytes(n) <= room(n)).collect()
    };
    let plain = fits(&|n| b.table.nodes[n].room());
    if !plain.is_empty() {
        return least(&plain, after);
    }
    let made = fits(&|n| {
        let node = &b.table.nodes[n];
        let spare: u64 = spares(b, n).map(|c| b.table.bytes[c]).sum();
        node.facts.budget.saturating_sub(node.bytes - spare)
    });
    least(if made.is_empty() { present } else { &made }, after)
}

/// Chunks that a node may drop: another present node holds each, and they are not this node's own.
pub(super) fn spares(b: &Balancer, index: usize) -> impl Iterator<Item = ChunkId> + '_ {
    let held = &b.table.nodes[index].held;
    held.ids().filter(move |&c| held[c] && b.table.holders[c].len() > 1 && b.primary[c] != Some(index))
}

/// The node holds the chunk from now on and loads it on its way, in place of copies if need be.
fn adopt(b: &mut Balancer, index: usize, chunk: ChunkId, division: &mut Division) {
    if b.table.nodes[index].held[chunk] {
        return;
    }
    let seat = b.table.nodes[index].seat;
    let bytes = b.table.bytes[chunk];
    shed(b, index, bytes, division);
    b.table.hold(index, chunk);
    division.adopted.push((seat, chunk));
}

/// Drops what a node can do without, coldest first, until it has room for `bytes` within its budget.
fn shed(b: &mut Balancer, index: usize, bytes: u64, division: &mut Division) {
    let lacks = |b: &Balancer| {
        let node = &b.table.nodes[index];
        node.bytes + node.reserved + bytes > node.facts.budget
    };
    if !lacks(b) {
        return;
    }
    // What is on its way is not needed so much.
    (b.table.nodes[index].outstanding, b.table.nodes[index].reserved) = (None, 0);
    let mut cold: Vec<ChunkId> = spares(b, index).filter(|&c| b.table.bytes[c] > 0).collect();
    cold.sort_by(|&x, &y| b.heat[x].total_cmp(&b.heat[y]).then(x.cmp(&y)));
    for spare in cold {
        if !lacks(b) {
            return;
        }
        b.table.drop(index, spare);
        division.dropped.push((b.table.nodes[index].seat, spare));
    }
}

/// Puts a chunk on its primary, or on another holder that becomes it.
fn place(b: &mut Balancer, chunk: ChunkId, plan: &mut Plan) {
    let Some(primary) = b.primary[chunk] else { return };
    let cost = b.predictor.cost[chunk];
    let strips = b.predictor.strips[chunk].len() as u32;
    let after = |plan: &Plan, node: usize| plan.load[node] + plan.kappa[node] * cost;
    let holders = &b.table.holders[chunk];
    let heavy =
        cuts(b) && strips > 1 && holders.len() > 1 && plan.kappa[primary] * cost > b.settings.heavy * plan.bound;
    let room = b.settings.keep * plan.bound;
    let keeps = b.settings.mode != Balancing::Dynamic
        || b.is_settled(chunk)
        || after(plan, primary) <= room
        || (heavy && plan.load[primary] < (1.0 - b.settings.heavy) * plan.bound);
    let mut owner = primary;
    if !keeps {
        let best = least(holders, |n| after(plan, n));
        if after(plan, best) < after(plan, primary) - b.settings.least_gain * plan.bound {
            owner = best;
            b.appoint(owner, chunk);
        }
    }
    plan.give(chunk, Own { node: owner, strips: [0, strips], cost });
    if heavy {
        while plan.load[owner] > room && plan.cut(&b.settings, &b.predictor, &b.table.holders, owner, &[chunk]) {}
    }
}

/// The parts of a chunk, the primary's first.
fn parts(b: &Balancer, chunk: ChunkId, plan: &Plan) -> Vec<Part> {
    let part = |own: &Own| Part { seat: b.table.nodes[own.node].seat, strips: own.strips };
    let (mine, others): (Vec<&Own>, Vec<&Own>) =
        plan.owners[chunk].iter().partition(|own| b.primary[chunk] == Some(own.node));
    mine.into_iter().chain(others).map(part).collect()
}

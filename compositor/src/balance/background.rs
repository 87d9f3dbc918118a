//! What nodes load beside the frames: copies of hot chunks, and moves where memory forbids copies.

use brickcast_volume::{ChunkId, PerChunk};

use super::balancer::Balancer;
use super::basket::{Basket, may_load, send};
use super::copies::copies;
use super::settings::Balancing;
use super::types::{Load, Reason};

impl Balancer {
    /// What to load beside the frames, to be started now. Each is outstanding until [`Balancer::finished`] hears of it,
    /// or its node leaves.
    pub fn background(&mut self) -> Vec<Load> {
        background(self)
    }
}

fn background(b: &mut Balancer) -> Vec<Load> {
    if b.settings.mode != Balancing::Dynamic || b.totals.plan.present.is_empty() {
        return Vec::new();
    }
    let largest = b.totals.plan.present.iter().map(|&n| b.totals.plan.load[n]).fold(0.0, f64::max);
    b.strained = if largest > b.settings.move_above * b.totals.plan.bound { b.strained + 1 } else { 0 };
    let nodes = &b.table.nodes;
    let mut free: Vec<usize> = b.table.present().filter(|&n| nodes[n].outstanding.is_none()).collect();
    let load = |n: usize| b.totals.plan.load.get(n).copied().unwrap_or(0.0);
    free.sort_by(|&x, &y| load(x).total_cmp(&load(y)).then(x.cmp(&y)));
    // Where a node holds more than it can, it has the only copies of that: they need another home before anything else
    // is copied.
    let fits = nodes.iter().filter(|n| n.present).all(|n| n.bytes <= n.facts.budget);
    let mut loads = Vec::new();
    if !fits {
        return relief(b, &free);
    }
    if b.settings.replicas > 1 {
        loads = copies(b, &free);
    }
    let waits = !b.arrived.is_empty() || b.table.nodes.iter().any(|n| n.outstanding.is_some());
    if loads.is_empty() && !waits && b.strained >= b.settings.hold_frames {
        loads = moves(b, &free);
    }
    loads
}

/// Nodes that hold more than they can give their coldest chunks to nodes with room.
fn relief(b: &mut Balancer, free: &[usize]) -> Vec<Load> {
    let mut baskets: Vec<Basket> = free.iter().map(|&index| Basket::new(index)).collect();
    let leaving: Vec<ChunkId> = b
        .table
        .nodes
        .iter()
        .filter_map(|n| n.outstanding.as_ref())
        .chain(&b.arrived)
        .flat_map(|l| l.chunks.clone())
        .collect();
    for from in b.table.present().collect::<Vec<_>>() {
        let node = &b.table.nodes[from];
        let mut mine: Vec<ChunkId> = b.chunks.ids().filter(|&c| node.held[c] && b.table.bytes[c] > 0).collect();
        let gone: u64 = mine.iter().filter(|c| leaving.contains(c)).map(|&c| b.table.bytes[c]).sum();
        let mut over = node.bytes.saturating_sub(node.facts.budget + gone);
        mine.retain(|c| !leaving.contains(c) && !b.is_settled(*c));
        mine.sort_by(|&x, &y| b.heat[x].total_cmp(&b.heat[y]).then(x.cmp(&y)));
        for chunk in mine {
            let bytes = b.table.bytes[chunk];
            let fits = |k: &Basket| {
                k.index != from
                    && k.has_place(b, bytes)
                    && b.table.nodes[k.index].room() >= bytes
                    && may_load(b, k.index, chunk)
            };
            let Some(place) = baskets.iter().position(fits).filter(|_| over > 0) else { continue };
            baskets[place].take(b, chunk);
            over = over.saturating_sub(bytes);
        }
    }
    send(b, baskets, Reason::Move)
}

/// Chunks go from the most loaded node to the least loaded ones, where that is worth the loading.
fn moves(b: &mut Balancer, free: &[usize]) -> Vec<Load> {
    let mut load = b.totals.plan.load.clone();
    load.resize(b.table.nodes.len(), 0.0);
    let kappa = b.predictor.kappas();
    let bound = b.totals.plan.bound;
    let present: Vec<usize> = b.table.present().collect();
    let mut moving = PerChunk::filled(false, b.chunks.count());
    let mut baskets = Vec::new();
    for &to in free {
        let most = present.iter().copied().reduce(|x, y| if load[y] > load[x] { y } else { x });
        let Some(from) = most.filter(|&n| n != to && load[n] > b.settings.even * bound) else { break };
        let mut basket = Basket::new(to);
        let mut mine: Vec<ChunkId> = b
            .chunks
            .ids()
            .filter(|&c| b.primary[c] == Some(from) && b.predictor.cost[c] > 0.0 && b.table.bytes[c] > 0)
            .filter(|&c| !b.is_settled(c) && may_load(b, to, c) && !moving[c])
            .collect();
        mine.sort_by(|&x, &y| b.predictor.cost[y].total_cmp(&b.predictor.cost[x]).then(x.cmp(&y)));
        for chunk in mine {
            let bytes = b.table.bytes[chunk];
            let cost = b.predictor.cost[chunk];
            let (giver, taker) = (load[from] - kappa[from] * cost, load[to] + kappa[to] * cost);
            let gain = b.predictor.in_ms(load[from] - giver.max(taker)) * b.settings.move_frames;
            let pays = gain > bytes as f64 / b.predictor.rate;
            if pays && basket.has_place(b, bytes) && b.table.nodes[to].room() >= bytes {
                (load[from], load[to]) = (giver, taker);
                moving[chunk] = true;
                basket.take(b, chunk);
            }
        }
        baskets.push(basket);
    }
    send(b, baskets, Reason::Move)
}

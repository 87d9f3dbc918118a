//! Which chunks get another holder, so that their work can be shared.

use brickcast_volume::{ChunkId, PerChunk};

use super::balancer::Balancer;
use super::basket::{Basket, may_load, send};
use super::divide::spares;
use super::types::{Load, Reason};

/// A copy may replace another that is so much colder.
const COLDER: f64 = 0.5;
/// A node with a load of less than so many T has too little to do with what it holds.
const HUNGRY: f64 = 0.9;

/// A chunk that could have another holder.
#[derive(Debug, Clone, Copy)]
struct Wish {
    chunk: ChunkId,
    /// What it is good for, per holder; in one list the same is meant by it.
    worth: f64,
}

/// Wishes by worth; ties by chunk.
fn sorted(wishes: impl Iterator<Item = Wish>) -> Vec<Wish> {
    let mut all: Vec<Wish> = wishes.collect();
    all.sort_by(|x, y| y.worth.total_cmp(&x.worth).then(x.chunk.cmp(&y.chunk)));
    all
}

/// Copies for the `free` nodes: first what a chunk needs by its share of the cost, then what nodes with too little to
/// do can help with, then, where nothing else is to be loaded, what an eye beside it would make hot.
pub(super) fn copies(b: &mut Balancer, free: &[usize]) -> Vec<Load> {
    let nodes = b.table.present().count();
    let mut copies: PerChunk<usize> = b.table.holders.values().map(Vec::len).collect();
    for load in b.table.nodes.iter().filter_map(|n| n.outstanding.as_ref()).chain(&b.arrived) {
        load.chunks.iter().for_each(|&c| copies[c] += 1);
    }
    let open = |c: &ChunkId| b.table.bytes[*c] > 0 && (1..nodes).contains(&copies[*c]);
    let (needy, sated): (Vec<ChunkId>, Vec<ChunkId>) =
        copies.ids().filter(open).partition(|&c| copies[c] < needed(b, c, nodes));
    let hot = |c: ChunkId| Wish { chunk: c, worth: hot(b, c) / copies[c] as f64 };
    let dense = |c: ChunkId| Wish { chunk: c, worth: b.predictor.rho(c) / copies[c] as f64 };
    let mut needed_ones = sorted(needy.into_iter().map(hot));
    let mut hot_ones = sorted(sated.iter().map(|&c| hot(c)).filter(|w| w.worth > 0.0));
    let mut dense_ones = sorted(sated.iter().map(|&c| dense(c)).filter(|w| w.worth > 0.0));
    let idle = needed_ones.is_empty();
    let mut load = b.totals.plan.load.clone();
    load.resize(b.table.nodes.len(), 0.0);
    let kappa = b.predictor.kappas();
    let mut baskets: Vec<Basket> = free.iter().map(|&index| Basket::new(index)).collect();
    // In turns, so that what is hot together does not meet on one node.
    for _ in 0..b.settings.request_chunks {
        for basket in &mut baskets {
            let index = basket.index;
            let hungry = load[index] < HUNGRY * b.totals.plan.bound;
            let wanted = pack(b, basket, &needed_ones, &mut copies, true);
            let chunk = if let Some(place) = wanted {
                let chunk = needed_ones[place].chunk;
                if copies[chunk] >= needed(b, chunk, nodes) {
                    needed_ones.remove(place);
                }
                chunk
            } else if hungry && let Some(place) = pack(b, basket, &hot_ones, &mut copies, true) {
                hot_ones.remove(place).chunk
            } else if idle
                && basket.chunks.is_empty()
                && let Some(place) = pack(b, basket, &dense_ones, &mut copies, false)
            {
                dense_ones.remove(place).chunk
            } else {
                continue;
            };
            load[index] += kappa[index] * b.predictor.cost[chunk] / copies[chunk] as f64;
        }
    }
    send(b, baskets, Reason::Copy)
}

/// Holders that a chunk needs: two for each node that it would keep busy alone.
fn needed(b: &Balancer, chunk: ChunkId, nodes: usize) -> usize {
    let busy = (2.0 * b.heat[chunk] * nodes as f64).ceil() as usize;
    busy.max(b.settings.replicas as usize).min(nodes)
}

/// Heat; twice as much where the primary's load is twice what it should be.
fn hot(b: &Balancer, chunk: ChunkId) -> f64 {
    let plan = &b.totals.plan;
    let strain = b.primary[chunk].and_then(|p| plan.load.get(p)).map_or(1.0, |load| load / plan.bound.max(1e-300));
    b.heat[chunk] * strain.max(1.0)
}

/// Puts the first of the wishes that it can into the basket, where `drop` allows in place of colder copies: its place
/// in the list.
fn pack(
    b: &mut Balancer,
    basket: &mut Basket,
    wishes: &[Wish],
    copies: &mut PerChunk<usize>,
    drop: bool,
) -> Option<usize> {
    let index = basket.index;
    let most = wishes.first().filter(|_| drop).map_or(0.0, |wish| wish.worth);
    let cold = cold(b, index, most, copies);
    let takes = |wish: &Wish| {
        let bytes = b.table.bytes[wish.chunk];
        let room = b.table.nodes[index].room();
        let freed =
            || cold.iter().take_while(|c| c.worth < COLDER * wish.worth).map(|c| b.table.bytes[c.chunk]).sum::<u64>();
        basket.has_place(b, bytes) && may_load(b, index, wish.chunk) && (room >= bytes || room + freed() >= bytes)
    };
    let found = wishes.iter().position(takes)?;
    let chunk = wishes[found].chunk;
    for spare in cold {
        if b.table.nodes[index].room() >= b.table.bytes[chunk] {
            break;
        }
        b.table.drop(index, spare.chunk);
        copies[spare.chunk] -= 1;
        basket.drops.push(spare.chunk);
    }
    basket.take(b, chunk);
    copies[chunk] += 1;
    Some(found)
}

/// Copies that a node may give up for one of this worth, coldest first, each with what it is worth to the others.
fn cold(b: &Balancer, index: usize, worth: f64, copies: &PerChunk<usize>) -> Vec<Wish> {
    let left = |c: ChunkId| b.heat[c] / (copies[c].max(2) - 1) as f64;
    let long_here =
        |c: ChunkId| b.table.nodes[index].asked.get(&c).is_none_or(|at| b.frame - at >= b.settings.hold_frames);
    let mut cold: Vec<Wish> = spares(b, index)
        .filter(|&c| b.table.bytes[c] > 0 && left(c) < COLDER * worth && long_here(c))
        .map(|c| Wish { chunk: c, worth: left(c) })
        .collect();
    cold.sort_by(|x, y| x.worth.total_cmp(&y.worth).then(x.chunk.cmp(&y.chunk)));
    cold
}

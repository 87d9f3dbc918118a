//! What a chunk will cost and how fast a node is, from what was seen (docs/algorithms.md, Balance).

use std::collections::BTreeMap;

use brickcast_volume::{ChunkId, PerChunk};

use super::settings::{LoadBy, Settings};
use super::types::{ChunkFacts, Demand, LookId};

/// Weight of a new observation of a chunk, of a node.
const CHUNK_WEIGHT: f64 = 0.3;
const NODE_WEIGHT: f64 = 0.2;
/// No more than four samples per position: a read, a probe and what a kernel may add.
const MOST_DENSE: f64 = 4.0;
/// A node with less than this share of the mean cost says more of its fixed costs than of its speed.
const TELLING: f64 = 0.1;
/// How fast the speed of a node that has next to nothing to do is forgotten, so that it is tried again.
const FORGET: f64 = 0.02;

/// What frames of one look showed.
#[derive(Debug, Clone)]
struct Seen {
    /// Samples per position.
    rho: PerChunk<Option<f64>>,
    /// Seen over expected, of all chunks seen so far: corrects the priors of the others.
    scale: Option<f64>,
}

#[derive(Debug, Clone)]
pub(super) struct Predictor {
    load_by: LoadBy,
    nominal_speed: f64,
    /// Bytes per ms.
    pub(super) rate: f64,
    /// Samples per position that are expected before anything was seen.
    prior: PerChunk<f64>,
    seen: BTreeMap<LookId, Seen>,
    /// Of the last view.
    look: LookId,
    /// Per node: declared throttle, and ms per unit of cost.
    throttle: Vec<f64>,
    kappa: Vec<Option<f64>>,
    /// Of the last view: positions in each strip; empty: not in view.
    pub(super) strips: PerChunk<Vec<f64>>,
    /// Positions, and predicted cost.
    geometric: PerChunk<f64>,
    pub(super) cost: PerChunk<f64>,
}

fn priors(chunks: &PerChunk<ChunkFacts>) -> PerChunk<f64> {
    chunks.values().map(|c| sane(c.prior).min(MOST_DENSE)).collect()
}

/// Not negative, not infinite, not NaN: anything else a caller may say counts as 0.
fn sane(value: f64) -> f64 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

impl Predictor {
    pub(super) fn new(settings: &Settings, chunks: &PerChunk<ChunkFacts>) -> Self {
        Self {
            load_by: settings.load_by,
            nominal_speed: settings.nominal_speed,
            rate: settings.load_rate,
            prior: priors(chunks),
            seen: BTreeMap::new(),
            look: LookId::default(),
            throttle: Vec::new(),
            kappa: Vec::new(),
            strips: PerChunk::filled(Vec::new(), chunks.count()),
            geometric: PerChunk::filled(0.0, chunks.count()),
            cost: PerChunk::filled(0.0, chunks.count()),
        }
    }

    /// A node at `index`, new or returned: its speed is unknown again if it declares another.
    pub(super) fn node(&mut self, index: usize, throttle: f64) {
        let throttle = if throttle.is_finite() { throttle.max(1e-3) } else { 1.0 };
        if index == self.throttle.len() {
            self.throttle.push(throttle);
            self.kappa.push(None);
        } else if self.throttle[index] != throttle {
            (self.throttle[index], self.kappa[index]) = (throttle, None);
        }
    }

    /// Other looks, and what is expected of their chunks.
    pub(super) fn show(&mut self, looks: &[LookId], chunks: &PerChunk<ChunkFacts>) {
        self.prior = priors(chunks);
        self.seen.retain(|look, _| looks.contains(look));
    }

    /// Samples per position that are expected of a chunk.
    pub(super) fn rho(&self, chunk: ChunkId) -> f64 {
        let seen = self.seen.get(&self.look);
        let scale = seen.and_then(|seen| seen.scale).unwrap_or(1.0);
        seen.and_then(|seen| seen.rho[chunk]).unwrap_or((self.prior[chunk] * scale).min(MOST_DENSE))
    }

    /// Takes a view's demand: predicts the cost of every chunk.
    pub(super) fn ask(&mut self, demand: &Demand) {
        self.look = demand.look;
        for chunk in self.cost.ids() {
            let strips = demand.strips.get(chunk).map_or(&[][..], |s| s);
            self.strips[chunk].clear();
            self.strips[chunk].extend(strips.iter().map(|s| sane(*s)));
            self.geometric[chunk] = self.strips[chunk].iter().sum();
            self.cost[chunk] = self.geometric[chunk] * self.rho(chunk);
        }
    }

    pub(super) fn in_view(&self, chunk: ChunkId) -> bool {
        !self.strips[chunk].is_empty()
    }

    /// Predicted cost of some strips of a chunk. Equal parts where the geometry says nothing.
    pub(super) fn cost_of(&self, chunk: ChunkId, [lo, hi]: [u32; 2]) -> f64 {
        self.strips[chunk][lo as usize..hi as usize].iter().sum::<f64>() * self.rho(chunk)
    }

    /// What chunks cost that were asked for by `demand`.
    pub(super) fn learn_chunks(&mut self, demand: &Demand, costs: &[(ChunkId, f64)]) {
        let unseen = || Seen { rho: PerChunk::filled(None, self.prior.count()), scale: None };
        let seen = self.seen.entry(demand.look).or_insert_with(unseen);
        let (mut measured, mut expected) = (0.0, 0.0);
        for &(chunk, cost) in costs {
            let (Some(strips), Some(prior)) = (demand.strips.get(chunk), self.prior.get(chunk)) else { continue };
            let geometric: f64 = strips.iter().map(|s| sane(*s)).sum();
            if geometric <= 0.0 {
                continue;
            }
            let ratio = (sane(cost) / geometric).min(MOST_DENSE);
            measured += ratio * geometric;
            expected += prior * geometric;
            seen.rho[chunk] = Some(match seen.rho[chunk] {
                Some(rho) => rho + CHUNK_WEIGHT * (ratio - rho),
                None => ratio,
            });
        }
        if expected > 0.0 {
            let now = measured / expected;
            seen.scale = Some(seen.scale.map_or(now, |scale| scale + CHUNK_WEIGHT * (now - scale)));
        }
    }

    pub(super) fn learn_nodes(&mut self, seen: &[(usize, f64, f64)]) {
        if self.load_by == LoadBy::Samples || seen.is_empty() {
            return;
        }
        let mean = seen.iter().map(|(.., cost)| sane(*cost)).sum::<f64>() / seen.len() as f64;
        for &(index, ms, cost) in seen {
            let (ms, cost) = (sane(ms), sane(cost));
            if cost > TELLING * mean && ms > 0.0 {
                let now = ms / cost;
                self.kappa[index] = Some(self.kappa[index].map_or(now, |kappa| kappa + NODE_WEIGHT * (now - kappa)));
            } else if let Some(kappa) = self.kappa[index] {
                self.kappa[index] = Some(kappa + FORGET * (self.throttle[index] * self.usual() - kappa));
            }
        }
    }

    /// Bytes that took `ms` to load in the background.
    pub(super) fn learn_rate(&mut self, bytes: u64, ms: f64) {
        if self.load_by == LoadBy::Time && ms > 0.0 && ms.is_finite() && bytes > 0 {
            self.rate += NODE_WEIGHT * (bytes as f64 / ms - self.rate);
        }
    }

    /// Mean time per unit of the known nodes, as if none were throttled.
    fn usual(&self) -> f64 {
        let known = self.kappa.iter().zip(&self.throttle).filter_map(|(k, t)| k.map(|k| k / t));
        let (sum, count) = known.fold((0.0, 0.0), |(sum, count), k| (sum + k, count + 1.0));
        if count > 0.0 { sum / count } else { 1.0 }
    }

    /// Load per unit of cost, of every node: ms where times are measured, else multiples of what an unthrottled node
    /// needs.
    pub(super) fn kappas(&self) -> Vec<f64> {
        if self.load_by == LoadBy::Samples {
            return self.throttle.clone();
        }
        let usual = self.usual();
        self.kappa.iter().zip(&self.throttle).map(|(k, t)| k.unwrap_or(t * usual).max(f64::MIN_POSITIVE)).collect()
    }

    /// The load that a node had.
    pub(super) fn load_of(&self, index: usize, ms: f64, cost: f64) -> f64 {
        match self.load_by {
            LoadBy::Samples => sane(cost) * self.throttle[index],
            LoadBy::Time => sane(ms),
        }
    }

    /// A load in ms.
    pub(super) fn in_ms(&self, load: f64) -> f64 {
        match self.load_by {
            LoadBy::Samples => load / self.nominal_speed,
            LoadBy::Time => load,
        }
    }
}

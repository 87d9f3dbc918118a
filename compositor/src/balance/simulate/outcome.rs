//! What the strategies came to.

use std::collections::BTreeMap;

use serde::Serialize;

use super::spec::Spec;
use super::world::World;
use crate::balance::{Report, max_over_mean};

/// Views that are left out of the figures without warm-up: a third, at most so many.
const WARM_UP: u32 = 20;
/// Balanced, where what cannot be foreseen does not keep a strategy above it anyway.
const EVEN: f64 = 1.10;
/// Bytes of a tile's pixels as they travel: RGBA in f16, not compressed.
const TILE_BYTES: u64 = 64 * 64 * 8;

/// One strategy's division of one view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewRow {
    /// Cost times throttle, of the present nodes.
    pub loads: Vec<f64>,
    /// Cost of every node.
    pub cost: Vec<f64>,
    pub layers: u64,
    pub tiles: u64,
    pub handovers: u64,
    pub bytes_loaded: u64,
    /// Largest load over the lower bound, as predicted.
    pub predicted: Option<f64>,
}

/// After a node left or came.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recovery {
    pub event: String,
    pub view: u32,
    /// Largest load over mean until then; nothing where it was even at once.
    pub peak: Option<f64>,
    /// Views until it was at most 1.10, or the strategy's mean; nothing: never.
    pub views: Option<u32>,
}

/// One strategy over all views. Ratios are the largest load over the mean of the present nodes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    pub strategy: &'static str,
    pub mean: f64,
    pub worst: f64,
    /// Time of all frames over what it would be if all nodes were even: views that cost little count little.
    pub overall: f64,
    /// With the first views, while speeds, costs and copies are learnt.
    pub mean_with_warm_up: f64,
    pub worst_with_warm_up: f64,
    /// Per view.
    pub layers: f64,
    pub bytes: f64,
    /// In all views: chunks that changed their (main) owner, bytes that had to be loaded.
    pub handovers: u64,
    pub bytes_loaded: u64,
    pub recoveries: Vec<Recovery>,
    /// Of our own predictions: the mean of the largest load over the lower bound; what is above it in `mean` was not
    /// foreseen.
    pub predicted: Option<f64>,
    /// Per view.
    pub ratios: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    pub spec: Spec,
    /// Chunks per axis, and how many of them show something.
    pub dims: [u32; 3],
    pub shown: usize,
    pub budget: u64,
    /// Views left out of `mean` and `worst`.
    pub warm_up: u32,
    pub rows: Vec<Row>,
    /// What our balancer says of itself at the end.
    pub report: Report,
}

pub(super) struct Record<'a> {
    spec: &'a Spec,
    world: &'a World,
    /// In the order in which they came.
    names: Vec<&'static str>,
    views: BTreeMap<&'static str, Vec<ViewRow>>,
}

impl<'a> Record<'a> {
    pub(super) fn new(spec: &'a Spec, world: &'a World) -> Self {
        Self { spec, world, names: Vec::new(), views: BTreeMap::new() }
    }

    pub(super) fn add(&mut self, name: &'static str, row: ViewRow) {
        if !self.names.contains(&name) {
            self.names.push(name);
        }
        self.views.entry(name).or_default().push(row);
    }

    pub(super) fn outcome(self, report: Report) -> Outcome {
        let warm_up = WARM_UP.min(self.spec.views / 3);
        Outcome {
            spec: self.spec.clone(),
            dims: self.world.dims.into(),
            shown: self.world.shown.values().filter(|s| **s > 0.0).count(),
            budget: self.world.budget(self.spec),
            warm_up,
            rows: self.names.iter().map(|name| self.row(name, &self.views[name], warm_up)).collect(),
            report,
        }
    }

    fn row(&self, strategy: &'static str, views: &[ViewRow], warm_up: u32) -> Row {
        let ratios: Vec<f64> = views.iter().map(|v| max_over_mean(&v.loads)).collect();
        let steady = &ratios[warm_up as usize..];
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len().max(1) as f64;
        let worst = |all: &[f64]| all.iter().copied().fold(0.0, f64::max);
        let per_view = |of: fn(&ViewRow) -> u64| views.iter().map(of).sum::<u64>() as f64 / views.len().max(1) as f64;
        let largest = |v: &ViewRow| v.loads.iter().copied().fold(0.0, f64::max);
        let middle = |v: &ViewRow| v.loads.iter().sum::<f64>() / v.loads.len().max(1) as f64;
        let sum = |of: fn(&ViewRow) -> f64| views[warm_up as usize..].iter().map(of).sum::<f64>();
        let kills = self.spec.kills.iter().map(|k| (format!("node {} leaves", k.node), k.view));
        let joins = self.spec.joins.iter().map(|&view| ("a node joins".to_owned(), view));
        let recovery = |(event, view): (String, u32)| {
            let after = &ratios[view as usize..];
            let views = after.iter().position(|r| *r <= EVEN.max(mean(steady)));
            let until = &after[..views.unwrap_or(after.len())];
            let peak = (!until.is_empty()).then(|| worst(until));
            Recovery { event, view, peak, views: views.map(|v| v as u32) }
        };
        Row {
            strategy,
            mean: mean(steady),
            worst: worst(steady),
            overall: sum(largest) / sum(middle).max(f64::MIN_POSITIVE),
            mean_with_warm_up: mean(&ratios),
            worst_with_warm_up: worst(&ratios),
            layers: per_view(|v| v.layers),
            bytes: per_view(|v| v.tiles * TILE_BYTES),
            handovers: views.iter().map(|v| v.handovers).sum(),
            bytes_loaded: views.iter().map(|v| v.bytes_loaded).sum(),
            predicted: views[warm_up as usize..]
                .iter()
                .map(|v| v.predicted)
                .sum::<Option<f64>>()
                .map(|sum| sum / steady.len().max(1) as f64),
            recoveries: kills.chain(joins).map(recovery).collect(),
            ratios,
        }
    }
}

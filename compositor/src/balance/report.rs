//! What was decided and what it came to, for statistics and people.

use serde::Serialize;

use super::balancer::Balancer;
use super::types::Seat;

/// Loads count in ms, or with [`super::LoadBy::Samples`] in samples times throttle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SeatLoad {
    pub seat: Seat,
    pub predicted: f64,
    /// Of the last frame observed, if it answered.
    pub measured: Option<f64>,
    /// Chunks and bytes that it holds.
    pub chunks: u64,
    pub bytes: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Frames divided.
    pub frame: u64,
    /// Present nodes.
    pub seats: Vec<SeatLoad>,
    /// Largest load over the mean of all present nodes; 1 where there is nothing to do.
    pub predicted_max_over_mean: f64,
    pub measured_max_over_mean: f64,
    /// Largest predicted load over what no division could go below.
    pub predicted_max_over_bound: f64,
    /// Of the last frame: parts beyond one per chunk.
    pub splits: u64,
    /// Since the start: primaries that changed though the old one was there; chunks taken over since nobody held them.
    pub handovers: u64,
    pub adoptions: u64,
    /// Since the start: chunks loaded in the background, by reason, and their bytes.
    pub copies: u64,
    pub moves: u64,
    pub bytes_loaded: u64,
}

/// Largest over mean; 1 for nothing.
#[must_use]
pub fn max_over_mean(loads: &[f64]) -> f64 {
    let mean = loads.iter().sum::<f64>() / loads.len().max(1) as f64;
    if mean > 0.0 { loads.iter().copied().fold(0.0, f64::max) / mean } else { 1.0 }
}

impl Balancer {
    /// What was decided and measured so far.
    #[must_use]
    pub fn report(&self) -> Report {
        report(self)
    }
}

fn report(b: &Balancer) -> Report {
    let t = &b.totals;
    let measured = |n: usize| t.measured.iter().find(|(index, _)| *index == n).map(|(_, load)| *load);
    let seat = |n: usize| SeatLoad {
        seat: b.table.nodes[n].seat,
        predicted: t.plan.load.get(n).copied().unwrap_or(0.0),
        measured: measured(n),
        chunks: b.table.nodes[n].held.values().filter(|held| **held).count() as u64,
        bytes: b.table.nodes[n].bytes,
    };
    let seats: Vec<SeatLoad> = b.table.present().map(seat).collect();
    let predicted: Vec<f64> = seats.iter().map(|s| s.predicted).collect();
    let seen: Vec<f64> = seats.iter().map(|s| s.measured.unwrap_or(0.0)).collect();
    let largest = predicted.iter().copied().fold(0.0, f64::max);
    Report {
        frame: b.frame,
        predicted_max_over_mean: max_over_mean(&predicted),
        measured_max_over_mean: max_over_mean(&seen),
        predicted_max_over_bound: if t.plan.bound > 0.0 { largest / t.plan.bound } else { 1.0 },
        seats,
        splits: t.splits,
        handovers: t.handovers,
        adoptions: t.adoptions,
        copies: t.copies,
        moves: t.moves,
        bytes_loaded: t.bytes_loaded,
    }
}

//! What frames took for what they cost, and so what the next one may cost.

use std::collections::VecDeque;
use std::time::Duration;

use brickcast_volume::lod::Selection;

/// Frames that are remembered; older ones were of another view, or of a machine that others used.
const KEPT: usize = 8;
/// What a frame counts beside the one after it.
const FADES: f64 = 0.7;
/// The share of the limit that is aimed at.
const AIM: f64 = 0.95;
/// Costs that lie closer together than this share of their mean say nothing of how time grows with them.
const SPREAD: f64 = 0.1;

/// The time that frames may take, and what is known of what they take.
#[derive(Debug, Clone)]
pub struct FramePace {
    limit_ms: f64,
    /// The last ones, the newest last.
    seen: VecDeque<Seen>,
    before: Option<Selection>,
}

#[derive(Debug, Clone, Copy)]
struct Seen {
    /// As [`Selection::cost`] counts.
    cost: f64,
    ms: f64,
}

/// Milliseconds by cost: something for every frame, and something for each sample.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Line {
    ms: f64,
    ms_per_cost: f64,
}

impl FramePace {
    #[must_use]
    pub fn new(limit: Duration) -> Self {
        Self { limit_ms: limit.as_secs_f64() * 1e3, seen: VecDeque::new(), before: None }
    }

    #[must_use]
    pub fn limit_ms(&self) -> f64 {
        self.limit_ms
    }

    /// What the last frame that was learnt from was drawn with.
    #[must_use]
    pub fn before(&self) -> Option<&Selection> {
        self.before.as_ref()
    }

    /// What a frame may cost: nothing while nothing is known, so that the first one is the coarsest.
    #[must_use]
    pub fn affordable(&self) -> f64 {
        let left = |line: Line| (self.limit_ms * AIM - line.ms) / line.ms_per_cost;
        self.line().map_or(0.0, left).max(0.0)
    }

    /// Milliseconds that a frame of `cost` should take.
    #[must_use]
    pub fn expected_ms(&self, cost: f64) -> Option<f64> {
        self.line().map(|line| line.ms + line.ms_per_cost * cost)
    }

    /// A frame of `cost` took `ms`, drawn with `selection`.
    pub fn learn(&mut self, selection: Selection, cost: f64, ms: f64) {
        self.before = Some(selection);
        self.remember(cost, ms);
    }

    fn remember(&mut self, cost: f64, ms: f64) {
        if cost > 0.0 && ms > 0.0 {
            self.seen.push_back(Seen { cost, ms });
        }
        if self.seen.len() > KEPT {
            self.seen.pop_front();
        }
    }

    /// The line of least squares that rises and begins above nothing.
    fn line(&self) -> Option<Line> {
        let weighed = || self.seen.iter().rev().zip(std::iter::successors(Some(1.0), |weight| Some(weight * FADES)));
        let sum = |of: &dyn Fn(&Seen) -> f64| -> f64 { weighed().map(|(seen, weight)| weight * of(seen)).sum() };
        let weights = sum(&|_| 1.0);
        let mean = |of: &dyn Fn(&Seen) -> f64| sum(of) / weights;
        let (cost, ms) = (mean(&|seen| seen.cost), mean(&|seen| seen.ms));
        if self.seen.is_empty() {
            return None;
        }
        let through_nothing = Line { ms: 0.0, ms_per_cost: ms / cost };
        let spread = mean(&|seen| (seen.cost - cost).powi(2));
        if spread.sqrt() < SPREAD * cost {
            return Some(through_nothing);
        }
        let ms_per_cost = mean(&|seen| (seen.cost - cost) * (seen.ms - ms)) / spread;
        let line = Line { ms: ms - ms_per_cost * cost, ms_per_cost };
        let is_sound = line.ms >= 0.0 && line.ms_per_cost > 0.0;
        Some(if is_sound { line } else { through_nothing })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pace(seen: &[(f64, f64)]) -> FramePace {
        let seen = seen.iter().map(|&(cost, ms)| Seen { cost, ms }).collect();
        FramePace { limit_ms: 100.0, seen, before: None }
    }

    #[test]
    fn what_is_known_says_what_the_next_frame_may_cost() {
        assert_eq!((pace(&[]).affordable(), pace(&[]).expected_ms(5.0)), (0.0, None), "the coarsest, to learn from");
        // One frame: all of its time is for its samples.
        assert!((pace(&[(10.0, 20.0)]).affordable() - 47.5).abs() < 1e-9);
        // Two: 10 ms and 1 ms for each.
        let two = pace(&[(10.0, 20.0), (40.0, 50.0)]);
        assert!((two.affordable() - 85.0).abs() < 1e-9 && (two.expected_ms(85.0).unwrap() - 95.0).abs() < 1e-9);
        // Of much the same cost, or where more took less, or nothing less than nothing.
        for odd in [&[(50.0, 20.0), (51.0, 40.0)][..], &[(10.0, 50.0), (40.0, 20.0)], &[(10.0, 1.0), (40.0, 50.0)]] {
            let pace = pace(odd);
            let line = pace.line().unwrap();
            assert!(line.ms.abs() < 1e-9 && line.ms_per_cost > 0.0 && pace.affordable().is_finite(), "{line:?}");
        }
        assert_eq!(pace(&[(10.0, 300.0), (40.0, 500.0)]).affordable(), 0.0, "no time for anything");
    }

    #[test]
    fn what_was_long_ago_is_forgotten() {
        let mut pace = pace(&[]);
        for ms in [1000.0; 10].into_iter().chain([10.0; KEPT]) {
            pace.remember(10.0, ms);
        }
        assert!((pace.affordable() - 95.0).abs() < 1e-9, "{}", pace.affordable());
        pace.remember(10.0, 0.0);
        assert_eq!(pace.seen.len(), KEPT, "what took no time was none");
    }
}

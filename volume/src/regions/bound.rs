//! How far the picture of V' can be from that of the volume: a bound per brick.
//!
//! Let every sample's value change by at most the brick's deviation. Replace the samples of a ray one after the other,
//! front to back. Replacing sample j changes what is seen by `T_j |d(alpha c) - d(alpha) B|`, where `T_j` is the
//! transparency before it and B, the colour behind, lies in 0..=1 like c. That is at most `T_j w` with
//! `w = d(alpha) + alpha d(c)`, and `T_j <= (1 - a)^j` with a the least opacity that a sample of the brick can have.
//! Summed: `w (1 - (1 - a)^n) / a` for n samples. (docs/algorithms.md, The bound.)
//!
//! And whatever its samples are, n of them are one whose opacity lies in `[1 - (1 - a_lo)^n, 1 - (1 - a_hi)^n]` and
//! whose colour lies within those of the brick's range. Before a colour B that is the same in both, two such differ by
//! no more than the box of them is wide at B = 0 or B = 1: in between, the largest is convex in B, the smallest
//! concave. The lesser of the two bounds counts, at every number of samples up to n. What is in front of the brick only
//! makes it less, so a pixel's bound is the sum over the bricks on its ray.

use std::collections::VecDeque;

use crate::transfer_function::TransferTable;
use crate::transfer_function::extremes::{NOTHING, Span, around};

/// What one sample can change, and how much of that the samples before it leave visible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChangeRate {
    /// The most that one sample alone can change: w above.
    sample: f64,
    /// Opacities of a sample: a above is the least.
    opacity: [f64; 2],
    /// Of every channel, the colours of a sample with opacity.
    colors: [Span; 3],
}

impl ChangeRate {
    pub(super) const NONE: Self = Self { sample: 0.0, opacity: [0.0; 2], colors: [NOTHING; 3] };

    /// Of samples whose opacity and colours lie anywhere between these.
    #[must_use]
    pub(crate) fn between(opacity: Span, colors: [Span; 3]) -> Self {
        let [least, most] = opacity.map(f64::from);
        let width = |[least, most]: Span| (f64::from(most) - f64::from(least)).max(0.0);
        let color = colors.into_iter().map(width).fold(0.0, f64::max);
        Self { sample: most - least + most * color, opacity: [least, most], colors }
    }

    /// Of two rates, one that bounds both.
    #[must_use]
    pub(super) fn or(self, other: Self) -> Self {
        Self {
            sample: self.sample.max(other.sample),
            opacity: [self.opacity[0].min(other.opacity[0]), self.opacity[1].max(other.opacity[1])],
            colors: std::array::from_fn(|c| around(self.colors[c], other.colors[c])),
        }
    }

    /// The most by which any channel of a premultiplied pixel can change over at most `samples` samples; in 0..=1.
    #[must_use]
    pub(crate) fn over(self, samples: u32) -> f32 {
        if self.sample == 0.0 {
            return 0.0;
        }
        // Asked for every brick of a plan: powers only where a box says more than what is known.
        let summed = self.summed(samples);
        let mut left = [1.0; 2];
        let mut most = 0.0_f64;
        for n in 1..=samples {
            left = [left[0] * (1.0 - self.opacity[0]), left[1] * (1.0 - self.opacity[1])];
            let boxed = self.boxed(left.map(|left| 1.0 - left));
            if boxed > most {
                most = boxed.min(self.summed(n)).max(most);
            }
            // Sums only grow, and nothing is more than the last, or than all.
            if most >= summed.min(1.0) {
                break;
            }
        }
        most.min(1.0) as f32
    }

    /// One sample after the other.
    fn summed(&self, samples: u32) -> f64 {
        let (n, least) = (f64::from(samples), self.opacity[0]);
        let reach = if least > 0.0 { (1.0 - libm::pow(1.0 - least, n)) / least } else { n };
        self.sample * reach
    }

    /// All of them as one of an opacity between these.
    fn boxed(&self, [lo, hi]: [f64; 2]) -> f64 {
        let colors = self.colors.iter().filter(|span| span[0] <= span[1]).map(|span| span.map(f64::from));
        let channel = |[least, most]: [f64; 2]| {
            let before_black = hi * most - lo * least;
            let before_white = hi * (1.0 - least) - lo * (1.0 - most);
            before_black.max(before_white)
        };
        // Opacity itself is a colour of 1 everywhere.
        colors.map(channel).fold(hi - lo, f64::max)
    }
}

/// For samples that move within the codes `range` by at most `deviation` codes each.
#[must_use]
pub(super) fn change_rate(table: &TransferTable, range: [u16; 2], deviation: u16) -> ChangeRate {
    if deviation == 0 {
        return ChangeRate::NONE;
    }
    let last = table.entries.len().saturating_sub(1);
    let per_code = last as f64 / (65535.0 * f64::from(table.c_last - table.c_first));
    let first_code = f64::from(table.c_first) * 65535.0;
    let place = |code: u16| ((f64::from(code) - first_code) * per_code).clamp(0.0, last as f64);
    let from = (place(range[0].min(range[1])).floor() as usize).saturating_sub(1);
    let to = (place(range[1].max(range[0])).ceil() as usize + 1).min(last);
    // Two places this far apart, each between two entries.
    let window = (f64::from(deviation) * per_code).ceil() as usize + 2;
    let entries = &table.entries[from..=to];
    let least = entries.iter().map(|e| f64::from(e[3])).fold(f64::MAX, f64::min);
    let most = entries.iter().map(|e| f64::from(e[3])).fold(0.0, f64::max);
    let colors = std::array::from_fn(|c| entries.iter().map(|e| [e[c]; 2]).fold(NOTHING, around));
    let spans: [Vec<[f32; 2]>; 4] = std::array::from_fn(|c| windows_of(entries, c, window));
    let worst = (0..spans[3].len())
        .map(|i| {
            let width = |c: usize| f64::from(spans[c][i][1]) - f64::from(spans[c][i][0]);
            let color = width(0).max(width(1)).max(width(2));
            width(3) + f64::from(spans[3][i][1]) * color
        })
        .fold(0.0, f64::max);
    ChangeRate { sample: worst, opacity: [least, most], colors }
}

/// Minimum and maximum of a channel over every run of `window + 1` entries, in one pass (two queues of candidates);
/// over all of them where they are fewer.
fn windows_of(entries: &[[f32; 4]], channel: usize, window: usize) -> Vec<[f32; 2]> {
    let (mut low, mut high) = (VecDeque::<usize>::new(), VecDeque::<usize>::new());
    let value = |i: usize| entries[i][channel];
    let mut spans = Vec::with_capacity(entries.len());
    for i in 0..entries.len() {
        while low.back().is_some_and(|&b| value(b) >= value(i)) {
            low.pop_back();
        }
        while high.back().is_some_and(|&b| value(b) <= value(i)) {
            high.pop_back();
        }
        low.push_back(i);
        high.push_back(i);
        for queue in [&mut low, &mut high] {
            if queue.front().is_some_and(|&f| f + window < i) {
                queue.pop_front();
            }
        }
        if i >= window || i + 1 == entries.len() {
            spans.push([value(low[0]), value(high[0])]);
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};

    fn change_bound(table: &TransferTable, range: [u16; 2], deviation: u16, samples: u32) -> f32 {
        change_rate(table, range, deviation).over(samples)
    }

    fn table(points: &[(f64, f64, f64)]) -> TransferTable {
        let colors = points.iter().map(|&(x, c, _)| ColorPoint { x, rgb: [c, 1.0 - c, 0.5] }).collect();
        let opacities = points.iter().map(|&(x, _, opacity)| OpacityPoint { x, opacity }).collect();
        TransferTable::build(&TransferFunction::new(colors, opacities).unwrap(), (0.0, 65535.0), 0.5)
    }

    /// Premultiplied colour and opacity of a run of samples, f64.
    fn composite(table: &TransferTable, codes: &[f64]) -> [f64; 4] {
        let last = (table.entries.len() - 1) as f64;
        let mut sum = [0.0; 4];
        for code in codes {
            let at = (code / 65535.0 - f64::from(table.c_first)) / f64::from(table.c_last - table.c_first) * last;
            let at = at.clamp(0.0, last);
            let i = (at as usize).min(table.entries.len() - 2);
            let e: [f64; 4] = std::array::from_fn(|c| {
                let (a, b) = (f64::from(table.entries[i][c]), f64::from(table.entries[i + 1][c]));
                a + (b - a) * (at - i as f64)
            });
            let weight = (1.0 - sum[3]) * e[3];
            (0..3).for_each(|c| sum[c] += weight * e[c]);
            sum[3] += weight;
        }
        sum
    }

    #[test]
    fn windows_hold_what_brute_force_finds() {
        let entries: Vec<[f32; 4]> = (0..50_u32).map(|i| [(i * 7919 % 31) as f32; 4]).collect();
        for window in [0, 1, 5, 49, 80] {
            let runs = entries.len().saturating_sub(window).max(1);
            let spans = windows_of(&entries, 0, window);
            assert_eq!(spans.len(), runs);
            for (i, span) in spans.iter().enumerate() {
                let run = entries[i..(i + window + 1).min(50)].iter().map(|e| e[0]);
                assert_eq!(*span, [run.clone().fold(f32::MAX, f32::min), run.fold(f32::MIN, f32::max)]);
            }
        }
    }

    #[test]
    fn no_deviation_and_no_opacity_cost_nothing() {
        let clear = table(&[(0.0, 0.2, 0.0), (65535.0, 0.8, 0.0)]);
        assert_eq!(change_bound(&clear, [0, 65535], 3000, 1000), 0.0);
        let ramp = table(&[(0.0, 0.2, 0.1), (65535.0, 0.8, 0.9)]);
        assert_eq!(change_bound(&ramp, [0, 65535], 0, 1000), 0.0);
        assert!(change_bound(&ramp, [0, 65535], 30, 100) < change_bound(&ramp, [0, 65535], 300, 100));
    }

    /// Nearly opaque material of one colour: however its values move, it stays what it is.
    #[test]
    fn what_hides_all_behind_it_changes_by_its_colours_alone() {
        let table = table(&[(0.0, 0.5, 0.3), (30_000.0, 0.5, 0.9), (65_535.0, 0.5, 0.9)]);
        let rate = change_rate(&table, [0, 65_535], 4000);
        assert!(rate.over(1) > 0.02 && rate.summed(200) > 0.05, "{rate:?}");
        let boxed = rate.boxed(rate.opacity.map(|a| 1.0 - libm::pow(1.0 - a, 200.0)));
        assert!(boxed < 1e-6 && f64::from(rate.over(200)) < rate.summed(200), "{}", rate.over(200));
        // No more samples, no smaller bound: a ray may take fewer.
        assert!((1..200).all(|n| rate.over(n) <= rate.over(n + 1)));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]
        /// Any two rays whose samples differ by no more than the deviation, inside the range.
        #[test]
        fn the_bound_holds(
            points in proptest::collection::vec((0.0..65535.0_f64, 0.0..1.0_f64, 0.0..1.0_f64), 2..7),
            values in proptest::collection::vec((0.0..1.0_f64, -1.0..1.0_f64), 1..60),
            lo in 0_u16..60000, span in 1_u16..20000, deviation in 1_u16..4000,
        ) {
            let mut points = points;
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            points.dedup_by(|a, b| b.0 - a.0 < 1.0 && a.0 - b.0 < 1.0);
            let table = table(&points);
            let hi = lo.saturating_add(span);
            let (low, high) = (f64::from(lo), f64::from(hi));
            let first: Vec<f64> = values.iter().map(|(t, _)| low + (high - low) * t).collect();
            let second: Vec<f64> = first.iter().zip(&values)
                .map(|(v, (_, d))| (v + d * f64::from(deviation)).clamp(low, high)).collect();
            let bound = f64::from(change_bound(&table, [lo, hi], deviation, values.len() as u32));
            let (a, b) = (composite(&table, &first), composite(&table, &second));
            for c in 0..4 {
                prop_assert!((a[c] - b[c]).abs() <= bound + 1e-6, "channel {c}: {} and {}, bound {bound}", a[c], b[c]);
            }
        }
    }
}

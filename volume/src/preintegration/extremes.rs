//! The smallest and the largest of what slabs can be whose ends are only known to lie between two codes each.
//!
//! Between nodes the table is bilinear, so over a box of ends its extremes lie at the box's corners, where its edges
//! cross lines of nodes, and at the nodes inside. Few of these are looked at one by one. Where they are many and
//! opacity only rises (or only falls) over all values of the box, so does that of slabs with either end, since it goes
//! by the mean: its extremes lie at two corners. Else square blocks of nodes that cover the box are looked at, which
//! may only be too wide.

use std::sync::Arc;

use super::Preintegrated;
use super::nodes::PARTS;
use crate::transfer_function::TransferFunction;
use crate::transfer_function::codes::{Codes, points};
use crate::transfer_function::extremes::{NOTHING, Runs, Shown, Span, around};

/// Places that are looked at one by one, at most; and those along one side.
const MOST_PLACES: usize = 24;
const LONGEST_SIDE: usize = 12;
/// Blocks along a side that cover a larger box, at most.
const MOST_BLOCKS: usize = 5;

/// By how much a table may rise where its function falls: rounding.
const STEADY: f32 = 5e-6;

/// Premultiplied r, g, b and opacity, or what a table of light has in their place.
pub type Channels = [Span; 4];

/// What a slab may add.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlabShown {
    /// Straight colours of all that lies between its ends, and its opacity.
    pub shown: Shown,
    /// Premultiplied.
    pub premul: [Span; 3],
}

/// The extremes of the slabs of a [`Preintegrated`].
#[derive(Debug, Clone)]
pub struct SlabExtremes {
    slabs: Arc<Preintegrated>,
    /// Straight colours between two nodes, where there is opacity.
    colors: Runs<[Span; 3]>,
    /// Before each node, how many of the elements have opacity that falls somewhere, and that rises.
    falls: Vec<[u32; 2]>,
    /// By level from 1 on: blocks of `2^level` nodes each way.
    blocks: Vec<Blocks>,
}

#[derive(Debug, Clone)]
struct Blocks {
    side: usize,
    all: Vec<Channels>,
}

impl SlabExtremes {
    /// `slabs` must be those of `function` over `range` (data units of codes 0 and 65535).
    #[must_use]
    pub fn new(slabs: Arc<Preintegrated>, function: &TransferFunction, range: (f64, f64)) -> Self {
        let elements = elements_of(&slabs, function, range);
        let mut falls = vec![[0, 0]];
        for element in &elements {
            let [falling, rising] = falls.last().copied().unwrap_or_default();
            falls.push([falling + u32::from(element.falls), rising + u32::from(element.rises)]);
        }
        let colors = Runs::new(elements.into_iter().map(|element| element.colors).collect(), around3);
        let mut blocks: Vec<Blocks> = Vec::new();
        let mut side = slabs.size;
        while side > MOST_BLOCKS {
            let next = side.div_ceil(2);
            let of = |i: usize, j: usize| match blocks.last() {
                Some(below) => below.all[i * side + j],
                None => slabs.total[i * side + j].map(|v| [v, v]),
            };
            let joined = |at: usize| {
                let (i, j) = (at / next * 2, at % next * 2);
                let far = |i: usize| (i + 1).min(side - 1);
                around4(around4(of(i, j), of(i, far(j))), around4(of(far(i), j), of(far(i), far(j))))
            };
            let all = (0..next * next).map(joined).collect();
            blocks.push(Blocks { side: next, all });
            side = next;
        }
        Self { slabs, colors, falls, blocks }
    }

    /// The tables.
    #[must_use]
    pub fn slabs(&self) -> &Preintegrated {
        &self.slabs
    }

    /// Where a code (0..=1) stands among the nodes, as kernels find it.
    #[must_use]
    pub fn place(&self, code: f32) -> f32 {
        let warp = &self.slabs.warp;
        let blocks = warp.len() as f32;
        let at = (code * (blocks * (65535.0 / 65536.0))).clamp(0.0, blocks);
        let i = (at as usize).min(warp.len().saturating_sub(1));
        let [start, growth] = warp.get(i).copied().unwrap_or_default();
        (start + (at - i as f32) * growth).clamp(0.0, self.slabs.size.saturating_sub(1) as f32)
    }

    /// Of slabs with a front and a back at these places among the nodes.
    #[must_use]
    pub fn over(&self, front: Span, back: Span) -> SlabShown {
        let slabs = &self.slabs;
        let [lo, hi] = around(front, back);
        // Elements that a slab may run through; of one value, those on both sides of it.
        let elements = slabs.size.saturating_sub(2);
        let last = (hi.ceil() as usize).saturating_sub(1).clamp(lo.floor() as usize, elements.max(lo.floor() as usize));
        let color = self.colors.of((lo.floor() as usize).min(elements), last.min(elements), around3);
        let color = color.unwrap_or([NOTHING; 3]);
        // Where no element has opacity there is no colour either.
        if color[0][0] > color[0][1] || self.is_clear([lo.floor() as usize, hi.floor() as usize]) {
            let shown = Shown { color: [NOTHING; 3], alpha: [0.0; 2] };
            return SlabShown { shown, premul: [[0.0; 2]; 3] };
        }
        let found = few(&slabs.total, slabs.size, front, back);
        let found = found.or_else(|| self.steady(front, back));
        let [r, g, b, alpha] = found.unwrap_or_else(|| self.covered(front, back));
        SlabShown { shown: Shown { color, alpha }, premul: [r, g, b] }
    }

    /// Does nothing show of slabs between values from one node to the next behind another?
    fn is_clear(&self, [first, last]: [usize; 2]) -> bool {
        let shown = &self.slabs.shown_before;
        let end = (last + 2).min(shown.len().saturating_sub(1));
        shown.get(first).is_some_and(|before| shown.get(end) == Some(before))
    }

    /// Where opacity goes one way over all of a box: its extremes; of colours nothing is said.
    fn steady(&self, front: Span, back: Span) -> Option<Channels> {
        let [lo, hi] = around(front, back);
        let (before, after) = (self.falls.get(lo.floor() as usize)?, self.falls.get(hi.ceil() as usize)?);
        let at = |end: usize| bilinear(&self.slabs.total, self.slabs.size, front[end], back[end])[3];
        let (least, most) = match (before[0] == after[0], before[1] == after[1]) {
            (true, _) => (at(0), at(1)),
            (_, true) => (at(1), at(0)),
            _ => return None,
        };
        // Sums of elements round.
        let alpha = [(least - STEADY).max(0.0), (most + STEADY).min(1.0)];
        Some([[0.0, alpha[1]], [0.0, alpha[1]], [0.0, alpha[1]], alpha])
    }

    /// Of the nodes around a box, and of some more.
    fn covered(&self, front: Span, back: Span) -> Channels {
        let size = self.slabs.size;
        let nodes = |[lo, hi]: Span| [lo.floor() as usize, (hi.ceil() as usize).min(size.saturating_sub(1))];
        let (rows, columns) = (nodes(front), nodes(back));
        let fits = |level: usize| [rows, columns].iter().all(|n| (n[1] >> level) - (n[0] >> level) < MOST_BLOCKS);
        let level = (1..self.blocks.len()).find(|&level| fits(level)).unwrap_or(self.blocks.len());
        let Some(blocks) = level.checked_sub(1).and_then(|at| self.blocks.get(at)) else {
            // Hardly any nodes: all of them.
            return self.slabs.total.iter().fold([NOTHING; 4], |all, slab| around4(all, slab.map(|v| [v, v])));
        };
        let mut all = [NOTHING; 4];
        for i in rows[0] >> level..=rows[1] >> level {
            for j in columns[0] >> level..=columns[1] >> level {
                all = around4(all, blocks.all[i * blocks.side + j]);
            }
        }
        all
    }
}

/// The extremes of a table of `size` nodes each way over a box of places, where they lie at few of them.
#[must_use]
pub fn few(table: &[[f32; 4]], size: usize, front: Span, back: Span) -> Option<Channels> {
    let count = |[lo, hi]: Span| if hi > lo { hi.ceil() as usize - lo.floor() as usize + 1 } else { 1 };
    let (rows, columns) = (count(front), count(back));
    if rows.saturating_mul(columns) > MOST_PLACES || rows.max(columns) > LONGEST_SIDE || size < 2 {
        return None;
    }
    let mut all = [NOTHING; 4];
    for i in 0..rows {
        let x = place_in(front, i, rows);
        for j in 0..columns {
            let slab = bilinear(table, size, x, place_in(back, j, columns));
            all = around4(all, slab.map(|v| [v, v]));
        }
    }
    Some(all)
}

/// The ends of a span, and the nodes between them.
fn place_in([lo, hi]: Span, i: usize, count: usize) -> f32 {
    if i == 0 {
        lo
    } else if i + 1 == count {
        hi
    } else {
        (lo.floor() + i as f32).min(hi)
    }
}

fn bilinear(table: &[[f32; 4]], size: usize, x: f32, y: f32) -> [f32; 4] {
    let (i, j) = ((x as usize).min(size - 2), (y as usize).min(size - 2));
    let (u, v) = (x - i as f32, y - j as f32);
    let at = i * size + j;
    let Some(near) = table.get(at..at + size + 2) else { return [0.0; 4] };
    std::array::from_fn(|c| {
        let (a, b) = (near[0][c] + (near[1][c] - near[0][c]) * v, near[size][c]);
        a + (b + (near[size + 1][c] - b) * v - a) * u
    })
}

/// What lies between two nodes.
struct Element {
    /// That the function has where it has opacity.
    colors: [Span; 3],
    /// Its opacity, towards larger values.
    rises: bool,
    falls: bool,
}

fn elements_of(slabs: &Preintegrated, function: &TransferFunction, range: (f64, f64)) -> Vec<Element> {
    let codes = Codes::new(range);
    let mut kinks: Vec<f64> = points(function).collect();
    kinks.sort_by(f64::total_cmp);
    let x = |place: u32| codes.x(f64::from(place) / f64::from(PARTS));
    let element = |ends: &[u32]| {
        let (from, to) = (x(ends[0]), x(ends[1]));
        let inside = kinks.partition_point(|&k| k <= from)..kinks.partition_point(|&k| k < to);
        let inside = kinks.get(inside).unwrap_or_default();
        let mut left = from;
        let (mut colors, mut rises, mut falls) = ([NOTHING; 3], false, false);
        for &right in inside.iter().chain([&to]) {
            let ends = [function.opacity(left), function.opacity(right)];
            rises |= ends[0] < ends[1];
            falls |= ends[0] > ends[1];
            if ends[0].max(ends[1]) > 0.0 {
                for at in [left, right] {
                    let color = function.color(at);
                    colors = around3(colors, color.map(|c| [c as f32, c as f32]));
                }
            }
            left = right;
        }
        Element { colors, rises, falls }
    };
    slabs.nodes.windows(2).map(element).collect()
}

fn around3(a: [Span; 3], b: [Span; 3]) -> [Span; 3] {
    std::array::from_fn(|c| around(a[c], b[c]))
}

fn around4(a: Channels, b: Channels) -> Channels {
    std::array::from_fn(|c| around(a[c], b[c]))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::transfer_function::{ColorPoint, OpacityPoint};

    fn opacity() -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), 0.0..1.0_f64]
    }

    fn function(points: &[(f64, f64, f64)]) -> TransferFunction {
        let mut points = points.to_vec();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| (b.0 - a.0).abs() < 1.0);
        let colors = points.iter().map(|&(x, c, _)| ColorPoint { x, rgb: [c, 1.0 - c, 0.5 * c] }).collect();
        let opacities = points.iter().map(|&(x, _, opacity)| OpacityPoint { x, opacity }).collect();
        TransferFunction::new(colors, opacities).unwrap()
    }

    #[test]
    fn a_slab_with_known_ends_is_the_tables_value() {
        let f = function(&[(10_000.0, 0.1, 0.0), (20_000.0, 0.9, 0.6), (40_000.0, 0.2, 0.05)]);
        let slabs = Arc::new(Preintegrated::with_entries(&f, (0.0, 65535.0), 0.5, 256, false));
        let extremes = SlabExtremes::new(slabs.clone(), &f, (0.0, 65535.0));
        for (front, back) in [(0.21, 0.57), (0.6, 0.1), (0.3, 0.3), (0.0, 1.0)] {
            let [x, y] = [front, back].map(|code| extremes.place(code));
            let got = extremes.over([x, x], [y, y]);
            let want = bilinear(&slabs.total, slabs.size, x, y);
            assert_eq!(got.shown.alpha, [want[3]; 2]);
            for c in 0..3 {
                assert_eq!(got.premul[c], [want[c]; 2]);
                let (straight, [lo, hi]) = (want[c] / want[3], got.shown.color[c]);
                assert!(lo - 1e-5 <= straight && straight <= hi + 1e-5, "{straight} in {lo}..{hi}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn extremes_hold_every_slab(
            points in proptest::collection::vec((0.0..65535.0_f64, 0.0..1.0_f64, opacity()), 2..7),
            lo in proptest::array::uniform2(0.0..1.0_f32),
            width in proptest::array::uniform2(prop_oneof![Just(0.0_f32), 0.0..0.003_f32, 0.0..0.4_f32]),
        ) {
            let f = function(&points);
            let slabs = Arc::new(Preintegrated::with_entries(&f, (0.0, 65535.0), 0.5, 256, false));
            let extremes = SlabExtremes::new(slabs.clone(), &f, (0.0, 65535.0));
            let hi: [f32; 2] = std::array::from_fn(|i| (lo[i] + width[i]).min(1.0));
            let span = |i: usize| [extremes.place(lo[i]), extremes.place(hi[i])];
            let got = extremes.over(span(0), span(1));
            let is_finite = got.shown.color.iter().flatten().all(|c| c.is_finite());
            prop_assert!(got.shown.is_clear() || is_finite, "opacity without a colour: {got:?}");
            for i in 0..=40 {
                for j in 0..=40 {
                    let at = |n: usize, part: i32| extremes.place(lo[n] + (hi[n] - lo[n]) * (part as f32 / 40.0));
                    let slab = bilinear(&slabs.total, slabs.size, at(0, i), at(1, j));
                    let alpha = slab[3];
                    prop_assert!(got.shown.alpha[0] - 1e-5 <= alpha && alpha <= got.shown.alpha[1] + 1e-5);
                    for ((seen, premul), color) in slab.into_iter().zip(got.premul).zip(got.shown.color) {
                        let [low, high] = premul;
                        prop_assert!(low - 1e-5 <= seen && seen <= high + 1e-5);
                        if alpha > 1e-3 {
                            let (color, [low, high]) = (seen / alpha, color);
                            prop_assert!(low - 1e-3 <= color && color <= high + 1e-3, "{color} in {low}..{high}");
                        }
                    }
                }
            }
        }
    }
}

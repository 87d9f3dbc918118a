//! A transfer function, cut into pieces of which each is taken as homogeneous.

use super::nodes::{PARTS, place};
use crate::transfer_function::TransferFunction;
use crate::transfer_function::codes::{Codes, points};

/// Opacity per unit is cut off here: beyond, a slab's opacity would not depend on its length.
pub const MAX_OPACITY: f64 = 1.0 - 1e-6;

/// What a path of one opacity unit through one value does.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Element {
    /// Straight r, g, b.
    pub color: [f64; 3],
    /// `ln(1 - opacity)`, at most 0.
    pub log_transparency: f64,
}

impl Element {
    fn of(color: [f64; 3], opacity: f64) -> Self {
        Self { color, log_transparency: log_transparency(opacity) }
    }

    /// Opacity of a path of `length` opacity units: `1 - (1 - opacity)^length`.
    #[must_use]
    pub fn opacity(&self, length: f64) -> f64 {
        -libm::expm1(self.log_transparency * length)
    }
}

/// n nodes and the elements between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Elements {
    /// Places of the nodes in parts of a code ([`PARTS`]), ascending, n at least 2.
    pub nodes: Vec<u32>,
    /// The function at the nodes.
    pub entries: Vec<Element>,
    /// Ascending and without gaps: place where it starts, width (both in parts), and the function's mean over it.
    pub pieces: Vec<(u32, u32, Element)>,
    /// By node: the piece that starts there.
    pub first: Vec<usize>,
}

/// The widest piece: colours and opacities change little over it.
const WIDEST: u32 = 64 * PARTS;

impl Elements {
    /// `function` over the store's `range` (lo, hi in data units) with up to `entries` nodes, at least 2, where slabs
    /// of `length` opacity units need them.
    #[must_use]
    pub fn of(function: &TransferFunction, range: (f64, f64), length: f64, entries: usize) -> Self {
        let codes = Codes::new(range);
        Self::at(function, codes, place(function, codes, length, entries.max(2)).nodes)
    }

    /// With these nodes. The mean of an element is that of the function itself, not of its two ends: a spike between
    /// them counts with its area. Optical depth is averaged, and colour weighted by it: what finer and finer elements
    /// tend to.
    pub(super) fn at(function: &TransferFunction, codes: Codes, nodes: Vec<u32>) -> Self {
        let x = |place: u32| codes.x(f64::from(place) / f64::from(PARTS));
        let mut kinks: Vec<f64> = points(function).collect();
        kinks.sort_by(f64::total_cmp);
        let (mut pieces, mut first) = (Vec::with_capacity(2 * nodes.len()), Vec::with_capacity(nodes.len()));
        for ends in nodes.windows(2) {
            first.push(pieces.len());
            let width = ends[1] - ends[0];
            let (from, to) = (x(ends[0]), x(ends[1]));
            let inside = kinks.partition_point(|&k| k <= from)..kinks.partition_point(|&k| k < to);
            let one = |x: f64| (function.color(x), function.opacity(x));
            let is_even = inside.is_empty() && (one(from) == one(to) || one(from).1.max(one(to).1) == 0.0);
            let part = if is_even { width } else { (width / 2).clamp(1, WIDEST) };
            for place in (ends[0]..ends[1]).step_by(part as usize) {
                let (from, to) = (x(place), x(place + part));
                let inside = kinks.partition_point(|&k| k <= from)..kinks.partition_point(|&k| k < to);
                let inside = kinks.get(inside).unwrap_or_default();
                pieces.push((place, part, mean(function, from, inside, to)));
            }
        }
        first.push(pieces.len());
        let at = |&place: &u32| Element::of(function.color(x(place)), function.opacity(x(place)));
        Self { entries: nodes.iter().map(at).collect(), nodes, pieces, first }
    }

    /// Optical depth of a path of one opacity unit per part of a code, up to each node.
    pub(super) fn depths(&self) -> Vec<f64> {
        let mut sum = 0.0;
        let cells = self.first.windows(2).map(|w| {
            for (_, width, element) in &self.pieces[w[0]..w[1]] {
                sum -= element.log_transparency * f64::from(*width);
            }
            sum
        });
        std::iter::once(0.0).chain(cells).collect()
    }
}

fn log_transparency(opacity: f64) -> f64 {
    libm::log1p(-opacity.min(MAX_OPACITY))
}

/// The function from `from` to `to`; `kinks` are its points in between, sorted.
fn mean(function: &TransferFunction, from: f64, kinks: &[f64], to: f64) -> Element {
    let at = |x: f64| (x, function.color(x), function.opacity(x));
    let mut left = at(from);
    // A volume of one value, whose codes all stand for it.
    if to - from <= 0.0 {
        return Element::of(left.1, left.2);
    }
    let (mut depth, mut colored, mut plain) = (0.0, [0.0; 3], [0.0; 3]);
    for &x in kinks.iter().chain(std::iter::once(&to)) {
        let right = at(x);
        let share = (right.0 - left.0) / (to - from);
        let piece = mean_of_piece((left.1, left.2), (right.1, right.2));
        depth += share * piece.log_transparency;
        for c in 0..3 {
            colored[c] += share * piece.log_transparency * piece.color[c];
            plain[c] += share * piece.color[c];
        }
        left = right;
    }
    let color = if depth < 0.0 { colored.map(|c| (c / depth).clamp(0.0, 1.0)) } else { plain };
    Element { color, log_transparency: depth }
}

/// Gauss-Legendre, five points over 0..=1: place, weight.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_45),
    (0.769_234_655_052_841_6, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

/// Colour and opacity both linear from one end to the other.
pub(super) fn mean_of_piece((c0, a0): ([f64; 3], f64), (c1, a1): ([f64; 3], f64)) -> Element {
    let (u0, u1) = (1.0 - a0.min(MAX_OPACITY), 1.0 - a1.min(MAX_OPACITY));
    if a0 == a1 {
        return Element::of(std::array::from_fn(|c| 0.5 * (c0[c] + c1[c])), a0);
    }
    let (mut depth, mut toward) = (0.0, 0.0);
    for (t, weight) in GAUSS {
        let l = weight * log_transparency(a0 + (a1 - a0) * t);
        depth += l;
        toward += l * t;
    }
    let t = if depth < 0.0 { toward / depth } else { 0.5 };
    // Far apart, the logarithm is no polynomial, and its integral u ln u - u does not cancel.
    if (u1 - u0).abs() > 0.1 * u0.max(u1) {
        depth = (u1 * libm::log(u1) - u0 * libm::log(u0)) / (u1 - u0) - 1.0;
    }
    Element { color: std::array::from_fn(|c| c0[c] + (c1[c] - c0[c]) * t), log_transparency: depth }
}

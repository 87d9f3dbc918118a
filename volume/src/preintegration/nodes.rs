//! Where the nodes of a table of slabs stand: where the function needs them (docs/adr/0007-tables.md).
//!
//! Nodes cut the codes into cells, each a power of two wide and at a multiple of its width. The cell in which the table
//! would be furthest from the integral is halved, again and again, until all are close enough or the nodes are used up.

use std::collections::{BTreeSet, BinaryHeap};

use super::elements::mean_of_piece;
use crate::transfer_function::TransferFunction;
use crate::transfer_function::codes::{ALL_CODES, Codes, points};
use crate::transfer_function::empty::Empty;

/// Parts of a code: nodes stand at multiples of one.
pub const PARTS: u32 = 4;
/// All of a table, in parts.
pub(super) const ALL: u32 = ALL_CODES * PARTS;
/// Below this error of opacity or premultiplied colour a cell is left as it is: 1/200 of what a picture of 8 bits tells
/// apart.
const CLOSE: f64 = 2e-5;
/// Points of the function of which a cell is measured at, at most.
const MOST_POINTS: usize = 32;

/// The nodes of a table of slabs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Placed {
    /// In parts of a code, ascending, from 0 to [`ALL`].
    pub(super) nodes: Vec<u32>,
    /// The cell that more nodes would have halved next: its error, and its codes.
    pub(crate) worst: Option<(f64, [u32; 2])>,
}

/// A cell with its error, by which they are ordered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Cell {
    /// Bits of a number that is not negative: in its order.
    error: u64,
    from: u32,
    to: u32,
}

/// At most `most` nodes, at least 2, for slabs of `length` opacity units.
pub(crate) fn place(function: &TransferFunction, codes: Codes, length: f64, most: usize) -> Placed {
    let mut profile = Profile::new(function, codes, length);
    let first = Empty::new(function, codes, most, 1).nodes;
    let mut nodes: BTreeSet<u32> = first.iter().map(|code| code * PARTS).collect();
    let ends: Vec<u32> = first.into_iter().collect();
    let mut cells: BinaryHeap<Cell> = ends.windows(2).map(|w| profile.cell(w[0], w[1])).collect();
    let mut worst = None;
    while let Some(cell) = cells.pop() {
        let error = f64::from_bits(cell.error);
        if error <= CLOSE {
            break;
        }
        let (is_code, new) = if cell.to - cell.from == 1 { (true, PARTS as usize - 1) } else { (false, 1) };
        if nodes.len() + new > most {
            worst = Some((error, [cell.from, cell.to]));
            break;
        }
        if is_code {
            nodes.extend((1..PARTS).map(|part| cell.from * PARTS + part));
        } else {
            let middle = cell.from.midpoint(cell.to);
            nodes.insert(middle * PARTS);
            cells.push(profile.cell(cell.from, middle));
            cells.push(profile.cell(middle, cell.to));
        }
    }
    Placed { nodes: nodes.into_iter().collect(), worst }
}

/// By block of codes: the node coordinate at its start, and what it grows by to its end. Linear between: every node
/// lies on the end of a block, or on one of the equal parts of a block of one code.
pub(super) fn warp(nodes: &[u32]) -> Vec<[f32; 2]> {
    let block = nodes.windows(2).map(|w| w[1] - w[0]).min().unwrap_or(ALL).max(PARTS);
    let mut i = 0;
    let mut coordinate = |at: u32| {
        while i + 2 < nodes.len() && nodes[i + 1] <= at {
            i += 1;
        }
        i as f32 + (at - nodes[i]) as f32 / (nodes[i + 1] - nodes[i]) as f32
    };
    let starts: Vec<f32> = (0..=ALL / block).map(|b| coordinate(b * block)).collect();
    starts.windows(2).map(|w| [w[0], w[1] - w[0]]).collect()
}

/// Colour times extinction, and extinction, summed from code 0 on.
type Sums = [f64; 4];

struct Profile<'a> {
    function: &'a TransferFunction,
    codes: Codes,
    length: f64,
    /// Codes of the function's points, 0 and the end of all codes; data values; sums up to there.
    knots: Vec<(f64, f64, Sums)>,
    /// At whole codes, NaN where not yet asked for.
    known: Vec<Sums>,
}

impl<'a> Profile<'a> {
    fn new(function: &'a TransferFunction, codes: Codes, length: f64) -> Self {
        let all = f64::from(ALL_CODES);
        let mut knots: Vec<(f64, f64, Sums)> = vec![(0.0, codes.x(0.0), [0.0; 4]), (all, codes.x(all), [0.0; 4])];
        if !codes.is_one_value() {
            let inside = points(function).map(|x| (codes.code(x), x, [0.0; 4])).filter(|(c, ..)| *c > 0.0 && *c < all);
            knots.extend(inside);
        }
        knots.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        knots.dedup_by(|a, b| a.1 == b.1 && a.0 == b.0);
        let mut profile = Self { function, codes, length, knots, known: vec![[f64::NAN; 4]; ALL_CODES as usize + 1] };
        for i in 1..profile.knots.len() {
            let (code, x, _) = profile.knots[i];
            profile.knots[i].2 = profile.beyond(i - 1, code, x);
        }
        profile
    }

    /// Sums at a place beyond knot `i`, and no further than the next.
    fn beyond(&self, i: usize, code: f64, x: f64) -> Sums {
        let (from, start, sums) = self.knots[i];
        let width = code - from;
        if width <= 0.0 {
            return sums;
        }
        let at = |x: f64| (self.function.color(x), self.function.opacity(x));
        let mean = mean_of_piece(at(start), at(x));
        let depth = -mean.log_transparency * width;
        let [r, g, b] = mean.color.map(|c| c * depth);
        [sums[0] + r, sums[1] + g, sums[2] + b, sums[3] + depth]
    }

    fn sums(&mut self, code: f64) -> Sums {
        let whole = code as usize;
        let is_whole = whole as f64 == code;
        if is_whole && !self.known[whole][3].is_nan() {
            return self.known[whole];
        }
        let after = self.knots.partition_point(|k| k.0 <= code);
        let sums = self.beyond(after.max(1) - 1, code, self.codes.x(code));
        if is_whole {
            self.known[whole] = sums;
        }
        sums
    }

    /// The slab between two codes, its colour not dimmed by itself; premultiplied.
    fn slab(&mut self, front: f64, back: f64) -> [f64; 4] {
        if front == back {
            return self.at(self.codes.x(front));
        }
        let (a, b) = (self.sums(front), self.sums(back));
        let depth = (b[3] - a[3]) / (back - front);
        if depth <= 0.0 {
            return [0.0; 4];
        }
        let opacity = -libm::expm1(-depth * self.length);
        let scale = opacity / (b[3] - a[3]);
        [(b[0] - a[0]) * scale, (b[1] - a[1]) * scale, (b[2] - a[2]) * scale, opacity]
    }

    /// A slab of one value.
    fn at(&self, x: f64) -> [f64; 4] {
        let element = mean_of_piece(
            (self.function.color(x), self.function.opacity(x)),
            (self.function.color(x), self.function.opacity(x)),
        );
        let opacity = element.opacity(self.length);
        let [r, g, b] = element.color;
        [r * opacity, g * opacity, b * opacity, opacity]
    }

    fn cell(&mut self, from: u32, to: u32) -> Cell {
        Cell { error: self.error(f64::from(from), f64::from(to)).to_bits(), from, to }
    }

    /// How far from the integral the table may be for slabs with an end or both in a cell.
    fn error(&mut self, a: f64, b: f64) -> f64 {
        let (middle, width) = (0.5 * (a + b), b - a);
        let corners = [self.slab(a, a), self.slab(a, b), self.slab(b, b)];
        let mut worst: f64 = 0.0;
        // Slabs of one value.
        let (from, to) = (self.knots.partition_point(|k| k.0 < a), self.knots.partition_point(|k| k.0 <= b));
        let stride = (to - from).div_ceil(MOST_POINTS).max(1);
        let inside = (from..to).step_by(stride).map(|i| (self.knots[i].0, self.knots[i].1));
        let flat: Vec<(f64, f64)> = inside.chain([(middle, self.codes.x(middle))]).collect();
        for (code, x) in flat {
            let (t, want) = ((code - a) / width, self.at(x));
            for (c, want) in want.into_iter().enumerate() {
                let got =
                    corners[0][c] * (1.0 - t) * (1.0 - t) + corners[1][c] * 2.0 * t * (1.0 - t) + corners[2][c] * t * t;
                worst = worst.max((got - want).abs());
            }
        }
        // From the ends of the cell, and from further and further away on either side.
        let mut reach = 0.0;
        while reach < f64::from(ALL_CODES) {
            for end in [a - reach, b + reach] {
                let end = end.round().clamp(0.0, f64::from(ALL_CODES));
                let (low, mid, high) = (self.slab(end, a), self.slab(end, middle), self.slab(end, b));
                for c in 0..4 {
                    worst = worst.max((mid[c] - 0.5 * (low[c] + high[c])).abs());
                }
            }
            reach = if reach == 0.0 { 0.5 * width } else { reach * std::f64::consts::SQRT_2 };
        }
        worst
    }
}

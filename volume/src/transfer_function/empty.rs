//! Which codes show nothing, of single samples and of slabs between them.
//!
//! A table is linear between entries, so what lies beside an entry with opacity shows something of it. Tables of slabs
//! place their entries (nodes) freely: those at the ends of what is empty are placed here, whatever else they need. So
//! compositor and nodes tell emptiness from the function alone, in exact arithmetic.

use std::collections::BTreeSet;

use super::codes::{ALL_CODES, Codes};
use super::function::TransferFunction;

/// Positions computed in f32 err by less than this many codes.
const MARGIN: u32 = 1;
/// Ends of what is empty lie on multiples of up to this many codes: nodes there are cheap.
const COARSEST: u32 = 16;
/// Cells that a table of slabs starts with: in wider ones a code would be less than what f32 tells apart.
const FIRST_CELLS: usize = 32;

/// What is empty, and the nodes that this takes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Empty {
    /// Codes of the nodes of a table of slabs, 0 and 65536 among them; every cell between two of them is a power of two
    /// wide and lies on a multiple of its width.
    pub(crate) nodes: BTreeSet<u32>,
    /// Codes, ends included, ascending and apart: what lies in one of them is empty.
    pub(crate) codes: Vec<[u16; 2]>,
}

impl Empty {
    /// For tables of slabs with `most` nodes (at least 2), and one of samples with an entry at every multiple of
    /// `stride` codes. Half of the nodes at most are spent: where there are more empty ranges, the shortest count as
    /// not empty.
    pub(crate) fn new(function: &TransferFunction, codes: Codes, most: usize, stride: u32) -> Self {
        let cells = (most / 4).clamp(1, FIRST_CELLS).next_power_of_two().min(FIRST_CELLS);
        let width = ALL_CODES / cells as u32;
        let mut nodes: BTreeSet<u32> = (0..=cells as u32).map(|i| i * width).collect();
        let mut zeros = zeros(function, codes);
        zeros.sort_by_key(|[lo, hi]| (std::cmp::Reverse(hi - lo), *lo));
        let mut empty = Vec::new();
        for [lo, hi] in zeros {
            let new: BTreeSet<u32> = [lo, hi].into_iter().flat_map(|end| halvings(&nodes, end)).collect();
            if nodes.len() + new.len() > (most / 2).max(cells + 1) {
                continue;
            }
            nodes.extend(new);
            let first = if lo == 0 { 0 } else { lo.next_multiple_of(stride) + MARGIN };
            let end = if hi == ALL_CODES { hi } else { (hi / stride * stride).saturating_sub(MARGIN - 1) };
            if first < end {
                empty.push([first as u16, (end - 1) as u16]);
            }
        }
        empty.sort_unstable();
        Self { nodes, codes: empty }
    }
}

/// The nodes that make `end` one of them, by halving the cell that it lies in.
pub(crate) fn halvings(nodes: &BTreeSet<u32>, end: u32) -> Vec<u32> {
    let mut new = Vec::new();
    if nodes.contains(&end) {
        return new;
    }
    let (Some(&low), Some(&high)) = (nodes.range(..end).next_back(), nodes.range(end..).next()) else { return new };
    let (mut low, mut high) = (low, high);
    while low != end {
        let middle = low.midpoint(high);
        if middle <= end {
            low = middle;
        } else {
            high = middle;
        }
        new.push(middle);
    }
    new
}

/// Where the function's opacity is 0, in whole codes inside of that, ends included.
fn zeros(function: &TransferFunction, codes: Codes) -> Vec<[u32; 2]> {
    let points = function.opacities();
    if codes.is_one_value() {
        return if function.opacity(codes.x(0.0)) == 0.0 { vec![[0, ALL_CODES]] } else { Vec::new() };
    }
    let runs = points.chunk_by(|a, b| (a.opacity == 0.0) == (b.opacity == 0.0)).filter(|run| run[0].opacity == 0.0);
    let mut zeros = Vec::new();
    for run in runs {
        let [first, last] = [run[0].x, run[run.len() - 1].x];
        let lo = if first == points[0].x { 0.0 } else { codes.code(first) };
        let hi = if last == points[points.len() - 1].x { f64::from(ALL_CODES) } else { codes.code(last) };
        let (lo, hi) = (lo.clamp(0.0, f64::from(ALL_CODES)), hi.clamp(0.0, f64::from(ALL_CODES)));
        let mut unit = COARSEST;
        while unit > 1 && hi - lo < f64::from(64 * unit) {
            unit /= 2;
        }
        let (mut low, mut high) = ((lo.ceil() as u32).next_multiple_of(unit), hi.floor() as u32 / unit * unit);
        // Codes of data values are rounded.
        let is_zero = |code: u32| function.opacity(codes.x(f64::from(code))) == 0.0;
        if low <= ALL_CODES && !is_zero(low) {
            low += unit;
        }
        if high >= unit && !is_zero(high) {
            high -= unit;
        }
        if low < high {
            zeros.push([low, high]);
        }
    }
    zeros
}

/// By code: numbers of which the second at the largest code of a range equals the first at the smallest where the range
/// is empty, and is greater where it is not.
pub(crate) fn counts(empty: &[[u16; 2]]) -> Vec<[u32; 2]> {
    let mut rest = empty.iter().copied().enumerate().peekable();
    (0..=u16::MAX)
        .map(|code| {
            while rest.next_if(|(_, [_, last])| *last < code).is_some() {}
            match rest.peek() {
                Some(&(k, [first, _])) if first <= code => [2 * k as u32 + 1; 2],
                Some(&(k, _)) => [2 * k as u32, 2 * k as u32 + 1],
                None => [2 * empty.len() as u32, 2 * empty.len() as u32 + 1],
            }
        })
        .collect()
}

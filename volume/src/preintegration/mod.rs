//! Pre-integration: the volume rendering integral over a slab, for each pair of values at its front and back, so that
//! features of the transfer function which lie between two samples are seen (Lum, Wilson and Ma 2004, "High-Quality
//! Lighting Efficiently for Pre-Integrated Volume Rendering").
//!
//! Within a slab the value is taken as linear from front to back, through the whole function, its constant ends
//! included. Entries stand at *nodes*, which are dense where the function needs them and reach over all codes. The
//! function is cut into *elements* between nodes; each takes a share of the slab's length D (in opacity units) that
//! goes by its width. All n^2 integrals are made in O(n^2). docs/adr/0007-tables.md says why.

pub mod brute_force;
mod elements;
pub mod extremes;
mod nodes;
mod subranges;
#[cfg(test)]
mod tests;

pub use elements::{Element, Elements, MAX_OPACITY};
pub use nodes::PARTS;

use crate::transfer_function::TransferFunction;
use crate::transfer_function::codes::Codes;

/// How many entries each side of a table has, at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum TableSize {
    /// For a transfer function that is being dragged.
    N256,
    /// For pictures that stay.
    #[default]
    N1024,
}

impl TableSize {
    pub const ALL: [Self; 2] = [Self::N256, Self::N1024];

    /// The size with so many entries of each side, if there is one.
    #[must_use]
    pub fn of_entries(entries: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|size| size.entries() as u32 == entries)
    }

    /// Entries of each side.
    #[must_use]
    pub const fn entries(self) -> usize {
        match self {
            Self::N256 => 256,
            Self::N1024 => 1024,
        }
    }
}

/// Integrals of slabs of one length. The slab with node `f` at its front and node `b` at its back stands at index
/// `f * size + b`; bilinear between nodes, whose coordinates go by `warp`.
#[derive(Debug, Clone, PartialEq)]
pub struct Preintegrated {
    /// Nodes, entries of each side: at least 2.
    pub size: usize,
    /// Where the nodes stand, in parts of a code ([`PARTS`]), ascending.
    pub nodes: Vec<u32>,
    /// By block of `65536 / warp.len()` codes (a power of two): the node coordinate at its start, and what it grows by
    /// to its end; linear between.
    pub warp: Vec<[f32; 2]>,
    /// Premultiplied r, g, b and opacity of the slab.
    pub total: Vec<[f32; 4]>,
    /// The tables of interpolated lighting, where asked for.
    pub lit: Option<Lit>,
    /// At x, how many of the nodes before node x and of the elements behind them show anything; `size + 1` counts.
    /// Where those at `min(f, b)` and `max(f, b) + 2` are equal, slabs of values from node f to f + 1 in front and from
    /// b to b + 1 at the back show nothing.
    pub shown_before: Vec<u32>,
}

/// The two tables of interpolated pre-integrated lighting, as the paper packs them (section "Implementation"): the
/// light at a slab's front sample falls on `front`, that at its back sample on `back`.
///
/// Weights run linearly through the slab, 1 at one end and 0 at the other; only colour is weighted, what lies behind is
/// hidden by all of the slab. `front.rgb + back.rgb` is `total.rgb` (to f32's rounding).
#[derive(Debug, Clone, PartialEq)]
pub struct Lit {
    /// Front-weighted diffuse r, g, b; the slab's whole opacity.
    pub front: Vec<[f32; 4]>,
    /// Back-weighted diffuse r, g, b; back-weighted opacity, which is the back-weighted integral of white: the weight
    /// of the specular light at the back sample. That of the front sample is `front.a - back.a`, since the integral of
    /// white is the opacity.
    pub back: Vec<[f32; 4]>,
}

impl Preintegrated {
    /// The integrals of `function` over the store's `range` (lo, hi in data units) for slabs of `delta_over_unit`
    /// opacity units (positive).
    #[must_use]
    pub fn build(
        function: &TransferFunction,
        range: (f64, f64),
        delta_over_unit: f64,
        size: TableSize,
        lit: bool,
    ) -> Self {
        Self::with_entries(function, range, delta_over_unit, size.entries(), lit)
    }

    /// The same with up to `entries` nodes, at least 2.
    #[must_use]
    pub fn with_entries(
        function: &TransferFunction,
        range: (f64, f64),
        delta_over_unit: f64,
        entries: usize,
        lit: bool,
    ) -> Self {
        let elements = Elements::of(function, range, delta_over_unit, entries);
        let (size, warp) = (elements.nodes.len(), nodes::warp(&elements.nodes));
        let shown_before = shown_before(&elements);
        if lit {
            let [total, front, back] = subranges::integrate::<8, 3, _>(&elements, delta_over_unit);
            Self { size, nodes: elements.nodes, warp, total, lit: Some(Lit { front, back }), shown_before }
        } else {
            let [total] = subranges::integrate::<4, 1, _>(&elements, delta_over_unit);
            Self { size, nodes: elements.nodes, warp, total, lit: None, shown_before }
        }
    }
}

/// What a table of slabs cannot carry of a function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coarse {
    /// By how much opacity or premultiplied colour of a slab may be off where it is worst.
    pub error: f64,
    /// Data values of slabs' ends where that is.
    pub values: [f64; 2],
}

/// The worst of a table of `size`, where its nodes do not suffice to be as close as a picture shows; for slabs of
/// `delta_over_unit` opacity units. What happens within a code is not looked at: no volume tells it apart.
#[must_use]
pub fn coarse(function: &TransferFunction, range: (f64, f64), delta_over_unit: f64, size: TableSize) -> Option<Coarse> {
    let codes = Codes::new(range);
    let (error, ends) = nodes::place(function, codes, delta_over_unit, size.entries()).worst?;
    Some(Coarse { error, values: ends.map(|code| codes.x(f64::from(code))) }).filter(|c| c.error > SHOWS)
}

/// Errors that show, in the worst slab.
const SHOWS: f64 = 2.0 / 255.0;

fn shown_before(elements: &Elements) -> Vec<u32> {
    let shows = |element: &Element| u32::from(element.log_transparency != 0.0);
    let cells = elements.first.windows(2).map(|w| &elements.pieces[w[0]..w[1]]);
    let between = cells.map(|cell| u32::from(cell.iter().any(|(.., element)| shows(element) > 0))).chain([0]);
    let mut sum = 0;
    let sums = elements.entries.iter().map(shows).zip(between).map(|(entry, element)| {
        sum += entry + element;
        sum
    });
    [0].into_iter().chain(sums).collect()
}

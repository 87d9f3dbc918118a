//! Pre-integration: the volume rendering integral over a slab, for each pair of values at its front and back, so that
//! features of the transfer function which lie between two samples are seen (Lum, Wilson and Ma 2004, "High-Quality Lighting
//! Efficiently for Pre-Integrated Volume Rendering").
//!
//! Within a slab the value is taken as linear from front to back. The function is cut into *elements*, one between every two
//! neighbouring entries; the slab from entry i to entry j runs through `L = |i - j|` of them, each of which takes the share
//! D / L of the slab's length D (in opacity units). All n^2 integrals are made in O(n^2).

pub mod brute_force;
mod elements;
mod subranges;
#[cfg(test)]
mod tests;

pub use elements::{Element, Elements, MAX_OPACITY};

use crate::transfer_function::TransferFunction;

/// How many entries each side of a table has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum TableSize {
    /// For a transfer function that is being dragged.
    N256,
    /// For pictures that stay.
    #[default]
    N1024,
}

impl TableSize {
    /// Entries of each side.
    #[must_use]
    pub const fn entries(self) -> usize {
        match self {
            Self::N256 => 256,
            Self::N1024 => 1024,
        }
    }
}

/// Integrals of slabs of one length. The slab with value entry `f` at its front and `b` at its back stands at index
/// `f * size + b`; bilinear between entries.
///
/// Entry i stands at code `c_first + (c_last - c_first) i / (size - 1)`, as in a
/// [`TransferTable`](crate::transfer_function::TransferTable) of as many entries; codes outside are clamped.
#[derive(Debug, Clone, PartialEq)]
pub struct Preintegrated {
    /// Entries of each side, at least 2.
    pub size: usize,
    /// Code of the first entry.
    pub c_first: f32,
    /// Code of the last entry; greater than `c_first`.
    pub c_last: f32,
    /// Premultiplied r, g, b and opacity of the slab.
    pub total: Vec<[f32; 4]>,
    /// The tables of interpolated lighting, where asked for.
    pub lit: Option<Lit>,
    /// At x, how many of the entries before entry x and of the elements behind them show anything; `size + 1` counts.
    /// Where those at `min(f, b)` and `max(f, b) + 2` are equal, slabs of values from entry f to f + 1 in front and from b
    /// to b + 1 at the back show nothing.
    pub shown_before: Vec<u32>,
}

/// The two tables of interpolated pre-integrated lighting, as the paper packs them (section "Implementation"): the
/// light at a slab's front sample falls on `front`, that at its back sample on `back`.
///
/// Weights run linearly through the slab, 1 at one end and 0 at the other; only colour is weighted, what lies behind is hidden
/// by all of the slab. `front.rgb + back.rgb` is `total.rgb` (to f32's rounding).
#[derive(Debug, Clone, PartialEq)]
pub struct Lit {
    /// Front-weighted diffuse r, g, b; the slab's whole opacity.
    pub front: Vec<[f32; 4]>,
    /// Back-weighted diffuse r, g, b; back-weighted opacity, which is the back-weighted integral of white: the weight of the
    /// specular light at the back sample. That of the front sample is `front.a - back.a`, since the integral of white is the
    /// opacity.
    pub back: Vec<[f32; 4]>,
}

impl Preintegrated {
    /// The integrals of `function` over the store's `range` (lo, hi in data units) for slabs of `delta_over_unit` opacity
    /// units (positive).
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

    /// The same with `entries` on each side, at least 2.
    #[must_use]
    pub fn with_entries(
        function: &TransferFunction,
        range: (f64, f64),
        delta_over_unit: f64,
        entries: usize,
        lit: bool,
    ) -> Self {
        let elements = Elements::of(function, range, entries);
        let (c_first, c_last, size) = (elements.c_first, elements.c_last, elements.entries.len());
        let shown_before = shown_before(&elements);
        if lit {
            let [total, front, back] = subranges::integrate::<8, 3, _>(&elements, delta_over_unit);
            Self { size, c_first, c_last, total, lit: Some(Lit { front, back }), shown_before }
        } else {
            let [total] = subranges::integrate::<4, 1, _>(&elements, delta_over_unit);
            Self { size, c_first, c_last, total, lit: None, shown_before }
        }
    }
}

fn shown_before(elements: &Elements) -> Vec<u32> {
    let shows = |element: &Element| u32::from(element.log_transparency != 0.0);
    let between = elements.between.iter().map(shows).chain([0]);
    let mut sum = 0;
    let sums = elements.entries.iter().map(shows).zip(between).map(|(entry, element)| {
        sum += entry + element;
        sum
    });
    [0].into_iter().chain(sums).collect()
}

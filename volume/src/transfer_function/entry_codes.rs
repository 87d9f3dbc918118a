//! Where the entries of a table stand.

use super::TransferFunction;

/// The narrowest `[c_first, c_last]`: a step within it still spans several 16-bit codes' worth of entries, and positions
/// computed in f32 err by few entries.
const MIN_WIDTH: f32 = 2e-4;

/// Entry i of n stands at code `c_first + (c_last - c_first) i / (n - 1)`; codes 0..=1 span the store's range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EntryCodes {
    pub(crate) c_first: f32,
    pub(crate) c_last: f32,
    /// Data units of codes 0 and 1.
    range: (f64, f64),
    /// At least 2.
    pub(crate) count: usize,
}

impl EntryCodes {
    /// `count` entries (at least 2) over the codes between which `function` changes.
    pub(crate) fn new(function: &TransferFunction, range: (f64, f64), count: usize) -> Self {
        let (c_first, c_last) = changing_codes(function, range.0, range.1);
        Self { c_first, c_last, range, count: count.max(2) }
    }

    /// Entry `i` in data units; not decreasing in i.
    pub(crate) fn x(&self, i: usize) -> f64 {
        let (lo, hi) = self.range;
        let t = i as f64 / (self.count - 1) as f64;
        let code = f64::from(self.c_first) + (f64::from(self.c_last) - f64::from(self.c_first)) * t;
        if code >= 1.0 { hi } else { lo + (hi - lo) * code }
    }

    /// All entries in data units.
    pub(crate) fn xs(&self) -> Vec<f64> {
        (0..self.count).map(|i| self.x(i)).collect()
    }
}

/// The codes `[first, last]` between which `function` changes, at least [`MIN_WIDTH`] apart. Rounded outwards: a first entry
/// just above the point where opacity starts would give opacity to all values below.
fn changing_codes(function: &TransferFunction, lo: f64, hi: f64) -> (f32, f32) {
    if !(hi - lo).is_normal() || hi < lo {
        return (0.0, 1.0);
    }
    let xs = function.colors().iter().map(|p| p.x).chain(function.opacities().iter().map(|p| p.x));
    let (first, last) = xs.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    let to_code = |x: f64| ((x - lo) / (hi - lo)).clamp(0.0, 1.0) as f32;
    let (first, last) = (to_code(first).next_down().max(0.0), to_code(last).next_up().min(1.0));
    if last - first >= MIN_WIDTH {
        return (first, last);
    }
    let first = (first - MIN_WIDTH / 2.0).clamp(0.0, 1.0 - MIN_WIDTH);
    (first, last.max(first + MIN_WIDTH))
}

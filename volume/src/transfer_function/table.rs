//! The table that the kernels read: straight colour and the opacity of one step, and which value ranges are empty.

use super::TransferFunction;

/// Entries of a table: linear between them.
pub const ENTRIES: usize = 4096;

/// A transfer function sampled for one step length.
///
/// Kernels read value codes `c` in 0..=1 (the stretched 16-bit code / 65535, i.e. `(v - lo) / (hi - lo)` over the store's
/// range). Entry i stands at code `c_first + (c_last - c_first) i / (ENTRIES - 1)`; between entries the table is linear,
/// outside clamped. `[c_first, c_last]` covers where the function changes, so a narrow window keeps its full resolution.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferTable {
    /// Straight r, g, b and `1 - (1 - opacity)^(Delta / unit)`.
    pub entries: Vec<[f32; 4]>,
    /// Code of the first entry.
    pub c_first: f32,
    /// Code of the last entry; greater than `c_first`.
    pub c_last: f32,
    /// `opaque_before[i]`: how many of the entries before i have opacity.
    opaque_before: Vec<u32>,
}

impl TransferTable {
    /// Samples `function` over the store's `range` (lo, hi in data units, lo < hi) for steps of `delta_over_unit` opacity
    /// units: `a' = 1 - (1 - a)^(Delta / unit)` (Engel et al. 2006, 1.4.2).
    #[must_use]
    pub fn build(function: &TransferFunction, range: (f64, f64), delta_over_unit: f64) -> Self {
        let (lo, hi) = range;
        let xs = function.colors().iter().map(|p| p.x).chain(function.opacities().iter().map(|p| p.x));
        let (first, last) = xs.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        let to_code = |x: f64| ((x - lo) / (hi - lo)).clamp(0.0, 1.0) as f32;
        let (mut c_first, mut c_last) = (to_code(first), to_code(last));
        if c_last - c_first < 1e-4 {
            (c_first, c_last) = ((c_first - 1e-4).max(0.0), (c_last + 1e-4).min(1.0));
        }
        let entries: Vec<[f32; 4]> = (0..ENTRIES)
            .map(|i| {
                let t = i as f64 / (ENTRIES - 1) as f64;
                let code = f64::from(c_first) + (f64::from(c_last) - f64::from(c_first)) * t;
                let x = lo + (hi - lo) * code;
                let [r, g, b] = function.color(x);
                let alpha = -((delta_over_unit * (-function.opacity(x)).ln_1p()).exp_m1());
                [r as f32, g as f32, b as f32, alpha as f32]
            })
            .collect();
        let mut opaque_before = vec![0];
        for e in &entries {
            opaque_before.push(opaque_before[opaque_before.len() - 1] + u32::from(e[3] > 0.0));
        }
        Self { entries, c_first, c_last, opaque_before }
    }

    /// True where every stretched code in `min..=max` (0..=65535) has opacity 0, widened by one entry on each side.
    #[must_use]
    pub fn is_empty_over(&self, min: u16, max: u16) -> bool {
        let last = (ENTRIES - 1) as f32;
        let position = |code: u16| {
            ((f32::from(code) / 65535.0 - self.c_first) / (self.c_last - self.c_first)).clamp(0.0, 1.0) * last
        };
        let from = (position(min).floor() as usize).saturating_sub(1);
        let to = (position(max).ceil() as usize + 1).min(ENTRIES - 1);
        self.opaque_before[to + 1] == self.opaque_before[from]
    }
}

//! The table that the kernels read for single samples: straight colour and the opacity of one step, and which value
//! ranges are empty.

use super::codes::{Codes, EntryGrid, LAST_CODE};
use super::empty::{Empty, counts};
use super::function::TransferFunction;

/// Entries of the kernels' table, at least: linear between them.
pub const ENTRIES: usize = 4096;

/// A transfer function sampled for one step length.
///
/// Kernels read value codes `c` in 0..=1 (the stretched 16-bit code / 65535, i.e. `(v - lo) / (hi - lo)` over the
/// store's range). Entry i of n stands at code `c_first + (c_last - c_first) i / (n - 1)`; between entries the table is
/// linear, outside clamped. `[c_first, c_last]` covers where the function changes. Where 4,096 entries over that do not
/// carry the function there are more, up to one for every code: it may be defined code by code.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferTable {
    /// Straight r, g, b and `1 - (1 - opacity)^(Delta / unit)`.
    pub entries: Vec<[f32; 4]>,
    /// Code of the first entry.
    pub c_first: f32,
    /// Code of the last entry; greater than `c_first`, and up to one code beyond 1.
    pub c_last: f32,
    /// Codes that show nothing, ends included: of samples, and of slabs of the same function.
    empty: Vec<[u16; 2]>,
}

impl TransferTable {
    /// Samples `function` over the store's `range` (lo, hi in data units, lo < hi) for steps of `delta_over_unit`
    /// opacity units, positive: `a' = 1 - (1 - a)^(Delta / unit)` (Engel et al. 2006, 1.4.2). A range without width (a
    /// constant volume) reads the function at `lo` for every code.
    #[must_use]
    pub fn build(function: &TransferFunction, range: (f64, f64), delta_over_unit: f64) -> Self {
        Self::with_entries(function, range, delta_over_unit, ENTRIES)
    }

    /// The same beside a [`Preintegrated`](crate::preintegration::Preintegrated) of up to `entries` on each side (at
    /// least 2): what is empty here is empty there, too. Slabs whose ends both lie in an empty range of codes read
    /// exactly 0, in either direction.
    #[must_use]
    pub fn with_entries(function: &TransferFunction, range: (f64, f64), delta_over_unit: f64, entries: usize) -> Self {
        let codes = Codes::new(range);
        let grid = EntryGrid::new(function, codes, |opacity| opacity_of_step(opacity, delta_over_unit));
        let entry = |i: usize| {
            let x = codes.x(grid.code(i));
            let [r, g, b] = function.color(x);
            let alpha = opacity_of_step(function.opacity(x), delta_over_unit);
            [r as f32, g as f32, b as f32, alpha as f32]
        };
        let code = |i: usize| (grid.code(i) / LAST_CODE) as f32;
        Self {
            entries: (0..grid.count).map(entry).collect(),
            c_first: code(0),
            c_last: code(grid.count - 1),
            empty: Empty::new(function, codes, entries.max(2), grid.stride.max(1.0) as u32).codes,
        }
    }

    /// Entries per code (0..=1).
    #[must_use]
    pub fn scale(&self) -> f32 {
        self.entries.len().saturating_sub(1) as f32 / (self.c_last - self.c_first)
    }

    /// True where every stretched code in `min..=max` (0..=65535), and every value between, has opacity 0, as far as
    /// f32 kernels may err.
    #[must_use]
    pub fn is_empty_over(&self, min: u16, max: u16) -> bool {
        let (min, max) = (min.min(max), min.max(max));
        let next = self.empty.partition_point(|[_, last]| *last < max);
        self.empty.get(next).is_some_and(|[first, _]| *first <= min)
    }

    /// The same for tables of ranges: codes `min..=max` are empty iff `counts[max][1] == counts[min][0]`. Sums of the
    /// counts of several tables say whether a range is empty under all of them.
    #[must_use]
    pub fn opaque_counts(&self) -> Vec<[u32; 2]> {
        counts(&self.empty)
    }
}

/// `1 - (1 - a)^exponent`, also for an opacity of exactly 1 (which stays 1) and for very small ones.
fn opacity_of_step(opacity: f64, exponent: f64) -> f64 {
    if opacity >= 1.0 {
        return 1.0;
    }
    -libm::expm1(exponent * libm::log1p(-opacity))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::transfer_function::{ColorPoint, Colormap, OpacityPoint};

    fn function(points: &[(f64, f64)]) -> TransferFunction {
        let opacities = points.iter().map(|&(x, opacity)| OpacityPoint { x, opacity }).collect();
        TransferFunction::new(vec![ColorPoint { x: points[0].0, rgb: [0.5; 3] }], opacities).unwrap()
    }

    /// The table at a position in entries, as a kernel reads it.
    fn alpha_at(table: &TransferTable, position: f64) -> f64 {
        let last = (table.entries.len() - 1) as f64;
        let p = position.clamp(0.0, last);
        let i = (p.floor() as usize).min(table.entries.len() - 2);
        let (a, b) = (f64::from(table.entries[i][3]), f64::from(table.entries[i + 1][3]));
        a + (b - a) * (p - i as f64)
    }

    /// Where a kernel finds a code.
    fn position(table: &TransferTable, code: f64) -> f64 {
        f64::from((code as f32 * (1.0 / 65535.0) - table.c_first) * table.scale())
    }

    /// Every code of `min..=max` and three values between neighbours, each also where an f32 kernel may find it.
    fn brute_force_is_empty(table: &TransferTable, min: u16, max: u16) -> bool {
        let width = f64::from(table.c_last) - f64::from(table.c_first);
        let last = (table.entries.len() - 1) as f64;
        let slack = 2.0 * f64::from(f32::EPSILON) / width * last;
        (u32::from(min) * 4..=u32::from(max) * 4).all(|quarter| {
            let code = f64::from(quarter) / (4.0 * 65535.0);
            let exact = (code - f64::from(table.c_first)) / width * last;
            [exact - slack, exact, exact + slack, position(table, code * 65535.0)]
                .into_iter()
                .all(|p| alpha_at(table, p) == 0.0)
        })
    }

    #[test]
    fn full_opacity_stays_full_and_tiny_opacity_is_kept() {
        for exponent in [1e-9, 0.01, 1.0, 16.0, 1e9] {
            assert_eq!(opacity_of_step(1.0, exponent), 1.0);
            assert_eq!(opacity_of_step(0.0, exponent), 0.0);
        }
        assert!((opacity_of_step(1e-12, 0.5) / 0.5e-12 - 1.0).abs() < 1e-9);
        let table = TransferTable::build(&function(&[(0.0, 0.0), (1.0, 1.0)]), (0.0, 1.0), 0.5);
        assert_eq!((table.entries[0][3], alpha_at(&table, position(&table, 65535.0))), (0.0, 1.0));
        assert!(table.entries.iter().flatten().all(|v| (0.0..=1.0).contains(v)));
    }

    /// Sampling and reading back must give the function, at any place and width of what changes.
    #[test]
    fn narrow_and_off_range_windows_read_back() {
        for (lo, hi) in
            [(0.0, 1.0), (100.0, 101.0), (-3000.0, 70000.0), (1234.5, 1234.6), (65535.0, 65536.0), (-9.0, -3.0)]
        {
            let f = TransferFunction::window(lo, hi, 0.8, Colormap::Turbo).unwrap();
            let table = TransferTable::build(&f, (0.0, 65535.0), 1.0);
            assert!(table.c_last > table.c_first && table.c_first >= 0.0 && table.c_last <= 65536.0 / 65535.0);
            assert!(table.entries.len() > ENTRIES);
            for code in (0..=65535).step_by(7).chain([1, 99, 100, 101, 1234, 1235, 65534, 65535]) {
                let at = position(&table, f64::from(code));
                let (got, want) = (alpha_at(&table, at), f.opacity(f64::from(code)));
                assert!((got - want).abs() < 1e-3, "window {lo},{hi}, code {code}: {got} {want}");
            }
        }
    }

    /// A first entry rounded up would lend its opacity to all values below, and nothing would ever be culled.
    #[test]
    fn everything_below_a_window_is_empty() {
        for i in 1..400_u16 {
            let (lo, hi) = (f64::from(i) * 157.7, f64::from(i) * 157.7 + 2000.0);
            let f = TransferFunction::window(lo, hi, 1.0, Colormap::Viridis).unwrap();
            let table = TransferTable::build(&f, (0.0, 65535.0), 0.5);
            assert_eq!(table.entries[0][3], 0.0);
            // Ends of what is empty lie on multiples of up to 16 codes.
            let below = (lo - 18.0).floor() as u16;
            assert!(table.is_empty_over(0, below), "{lo}");
            assert!(!table.is_empty_over(0, (lo + 2.0).ceil() as u16), "{lo}");
        }
    }

    #[test]
    fn constant_functions_and_constant_volumes() {
        for range in [(0.0, 1.0), (5.0, 5.0), (7.0, 9.0), (-4.0, -3.0)] {
            let opaque = TransferTable::build(&function(&[(5.0, 0.25)]), range, 1.0);
            assert!(opaque.entries.iter().all(|e| (e[3] - 0.25).abs() < 1e-7));
            assert!(!opaque.is_empty_over(0, 0) && !opaque.is_empty_over(65535, 65535));
            let clear = TransferTable::build(&function(&[(5.0, 0.0)]), range, 1.0);
            assert!(clear.is_empty_over(0, 65535));
        }
    }

    #[test]
    fn steps_leave_both_sides_to_themselves() {
        let at = 30_000.0_f64;
        let f = function(&[(at, 0.0), (at.next_up(), 1.0), (at + 50.0, 1.0), ((at + 50.0).next_up(), 0.0)]);
        let table = TransferTable::build(&f, (0.0, 65535.0), 1.0);
        assert!(table.is_empty_over(0, 29_999) && table.is_empty_over(30_066, 65_535));
        assert!(!table.is_empty_over(0, 30_001) && !table.is_empty_over(30_025, 30_025));
    }

    /// Between the first two entries or the last two: what lies beyond is as empty as ever.
    #[test]
    fn a_spike_between_entries_leaves_what_is_outside_empty() {
        let spike = |at: f64| [(at, 0.0), (at + 0.01, 1.0), (at + 0.02, 0.0)];
        for at in [20_001.0, 30_000.0, 39_999.0] {
            let f = function(&[&[(20_000.0, 0.0)][..], &spike(at), &[(40_001.0, 0.0)]].concat());
            let table = TransferTable::with_entries(&f, (0.0, 65535.0), 1.0, 256);
            assert!(table.is_empty_over(0, 19_000) && table.is_empty_over(41_000, 65_535), "{at}");
            let code = at as u16;
            assert!(!table.is_empty_over(code, code) && !table.is_empty_over(code, code + 1), "{at}");
        }
    }

    /// A table is the function at every whole code, wherever and however narrow its features are.
    fn assert_carried(f: &TransferFunction, codes: impl Iterator<Item = u32>) {
        let table = TransferTable::build(f, (0.0, 65535.0), 0.5);
        let last = table.entries.len() - 1;
        for code in codes {
            let at = position(&table, f64::from(code)).clamp(0.0, last as f64);
            let i = (at as usize).min(last - 1);
            let (x, t) = (f64::from(code), at - i as f64);
            let [r, g, b] = f.color(x);
            for (c, want) in [r, g, b, opacity_of_step(f.opacity(x), 0.5)].into_iter().enumerate() {
                let (low, high) = (f64::from(table.entries[i][c]), f64::from(table.entries[i + 1][c]));
                // Codes in f32 err by less than a hundredth of a code.
                assert!((low + (high - low) * t - want).abs() < 1e-2, "code {code}, channel {c}: {low} {high} {want}");
            }
        }
    }

    #[test]
    fn narrow_peaks_are_carried_whatever_else_is_written_out() {
        let peak = [(29_995.0, 0.0), (30_000.0, 1.0), (30_005.0, 0.0)];
        let far = [(50_000.0, 0.0), (50_001.0, 1.0), (50_002.0, 0.0)];
        let with_ends = [&[(0.0, 0.0)][..], &peak, &[(65_535.0, 0.0)]].concat();
        for points in [&peak[..], &with_ends, &[&peak[..], &far].concat()] {
            assert_carried(&function(points), (29_980..30_020).chain(49_990..50_010).chain((0..65_536).step_by(991)));
        }
    }

    #[test]
    fn functions_may_be_defined_code_by_code() {
        let value =
            |code: u32, salt: u32| f64::from((code ^ salt).wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
        let opacities = (0..65_536).map(|i| OpacityPoint { x: f64::from(i), opacity: value(i, 1) }).collect();
        let color = |i: u32| ColorPoint { x: f64::from(i), rgb: [value(i, 2), value(i, 3), value(i, 4)] };
        let f = TransferFunction::new((0..65_536).map(color).collect(), opacities).unwrap();
        assert_carried(&f, (0..65_536).step_by(7).chain([65_534, 65_535]));
    }

    #[test]
    fn smooth_functions_take_no_more_than_they_need() {
        let f = TransferFunction::window(20_000.0, 45_000.0, 0.8, Colormap::Viridis).unwrap();
        let table = TransferTable::build(&f, (0.0, 65535.0), 0.5);
        assert!((4097..8194).contains(&table.entries.len()), "{}", table.entries.len());
    }

    fn piecewise() -> impl Strategy<Value = TransferFunction> {
        let x = prop_oneof![-100.0..1100.0_f64, 400.0..401.0, Just(0.0), Just(1000.0)];
        let opacity = prop_oneof![3 => Just(0.0), 1 => Just(1.0), 1 => 0.0..1.0_f64];
        proptest::collection::vec((x, opacity), 1..8).prop_map(|mut points| {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            points.dedup_by(|a, b| a.0 == b.0);
            function(&points)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        /// Wrong in the other direction, a brick that is seen would be missing.
        #[test]
        fn empty_ranges_are_empty(f in piecewise(), delta in 0.01..4.0_f64, start: u16, length in 0..3000_u16) {
            let table = TransferTable::build(&f, (0.0, 1000.0), delta);
            let end = start.saturating_add(length);
            prop_assert!(!table.is_empty_over(start, end) || brute_force_is_empty(&table, start, end));
        }

        /// The answer must also be of use: what is empty three entries and a code further is found.
        #[test]
        fn clearly_empty_ranges_are_found(f in piecewise(), start: u16, length in 0..3000_u16) {
            let table = TransferTable::build(&f, (0.0, 1000.0), 1.0);
            let end = start.saturating_add(length);
            // Beyond the codes, too: a function that rises from the last code on has no end of a stride there.
            let wider = 16.0 + 16.0 + 2.0;
            let (from, to) = (f64::from(start) - wider, f64::from(end) + wider);
            // A spike between two entries is not empty, though this table does not show it.
            let shows = |p: &OpacityPoint| p.opacity > 0.0 && (from..=to).contains(&(p.x * 65.535));
            if [from, to].iter().all(|code| f.opacity(code / 65.535) == 0.0) && !f.opacities().iter().any(shows) {
                prop_assert!(table.is_empty_over(start, end));
            }
        }
    }
}

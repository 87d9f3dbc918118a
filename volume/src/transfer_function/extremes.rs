//! The smallest and the largest of what samples can be whose codes are only known to lie between two: in O(1).

use super::table::TransferTable;

/// Smallest and largest of a number; none where the first is above the second.
pub type Span = [f32; 2];

/// What no number lies in.
pub const NOTHING: Span = [f32::INFINITY, f32::NEG_INFINITY];

/// The smallest span around both.
#[must_use]
#[inline]
pub fn around(a: Span, b: Span) -> Span {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// What a sample, or a slab, of uncertain values may add.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    /// Straight r, g and b of those of the values that have opacity; [`NOTHING`] where none has.
    pub color: [Span; 3],
    /// Opacity of one step.
    pub alpha: Span,
}

impl Shown {
    const NOTHING: Self = Self { color: [NOTHING; 3], alpha: NOTHING };

    #[must_use]
    fn or(self, other: Self) -> Self {
        let color = std::array::from_fn(|c| around(self.color[c], other.color[c]));
        Self { color, alpha: around(self.alpha, other.alpha) }
    }

    /// Is there no opacity for any of the values?
    #[must_use]
    pub fn is_clear(&self) -> bool {
        self.alpha[1] <= 0.0
    }
}

/// Spans of every power of two of neighbours ("sparse table", Bender & Farach-Colton 2000): that of any run of them is
/// that of two which overlap.
#[derive(Debug, Clone, PartialEq)]
pub struct Runs<T> {
    /// By binary logarithm of the length, then by the first.
    levels: Vec<Vec<T>>,
}

impl<T: Copy> Runs<T> {
    #[must_use]
    pub fn new(single: Vec<T>, or: impl Fn(T, T) -> T) -> Self {
        let mut levels = vec![single];
        let mut reach = 1;
        while let Some(last) = levels.last().filter(|last| last.len() > reach) {
            let next = last.iter().zip(&last[reach..]).map(|(a, b)| or(*a, *b)).collect();
            levels.push(next);
            reach *= 2;
        }
        Self { levels }
    }

    /// Of those from `first` to `last`, both included; `None` where there are none.
    #[must_use]
    #[inline]
    pub fn of(&self, first: usize, last: usize, or: impl Fn(T, T) -> T) -> Option<T> {
        let length = (last + 1).checked_sub(first).filter(|&length| length > 0)?;
        let level = self.levels.get(length.ilog2() as usize)?;
        Some(or(*level.get(first)?, *level.get(last + 1 - (1 << length.ilog2()))?))
    }
}

/// The extremes of a [`TransferTable`] over any range of codes.
///
/// A kernel reads the table linearly between entries, so the extremes over a range lie at its ends and at the entries
/// between. Colours count where there is opacity: of a piece between two entries without any, no colour is ever seen.
#[derive(Debug, Clone, PartialEq)]
pub struct TableExtremes {
    entries: Vec<[f32; 4]>,
    runs: Runs<Shown>,
    first: f32,
    scale: f32,
}

impl TableExtremes {
    /// Of a table of at least two entries.
    #[must_use]
    pub fn new(table: &TransferTable) -> Self {
        let entries = table.entries.clone();
        let single = |i: usize| {
            let near = &entries[i.saturating_sub(1)..(i + 2).min(entries.len())];
            shown(entries[i], near.iter().any(|entry| entry[3] > 0.0))
        };
        let runs = Runs::new((0..entries.len()).map(single).collect(), Shown::or);
        Self { runs, first: table.c_first, scale: table.scale(), entries }
    }

    /// Of samples whose codes (0..=1, beyond them clamped) lie between `lo` and `hi`, both included.
    #[must_use]
    #[inline]
    pub fn over(&self, span: Span) -> Shown {
        self.joined(span, Shown::or)
    }

    /// The opacity alone, which takes less time.
    #[must_use]
    pub fn alpha(&self, span: Span) -> Span {
        let opacity = |a: Shown, b: Shown| Shown { alpha: around(a.alpha, b.alpha), ..Shown::NOTHING };
        self.joined(span, opacity).alpha
    }

    #[inline(always)]
    fn joined(&self, [lo, hi]: Span, or: impl Fn(Shown, Shown) -> Shown + Copy) -> Shown {
        let last = self.entries.len().saturating_sub(1);
        let at = |code: f32| ((code - self.first) * self.scale).clamp(0.0, last as f32);
        let (from, to) = (at(lo), at(hi));
        let ends = or(self.at(from), if to > from { self.at(to) } else { Shown::NOTHING });
        let inner = (from.ceil() as usize, to.floor() as usize);
        let inside = if inner.0 <= inner.1 { self.runs.of(inner.0, inner.1, or) } else { None };
        inside.map_or(ends, |inside| or(ends, inside))
    }

    /// At a place among the entries.
    #[inline(always)]
    fn at(&self, place: f32) -> Shown {
        let i = (place as usize).min(self.entries.len().saturating_sub(2));
        let (Some(a), Some(b)) = (self.entries.get(i), self.entries.get(i + 1)) else { return Shown::NOTHING };
        let t = place - i as f32;
        shown(std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t), a[3] > 0.0 || b[3] > 0.0)
    }
}

fn shown([r, g, b, alpha]: [f32; 4], is_seen: bool) -> Shown {
    let color = if is_seen { [r, g, b].map(|c| [c, c]) } else { [NOTHING; 3] };
    Shown { color, alpha: [alpha, alpha] }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};

    fn opacity() -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), 0.0..1.0_f64]
    }

    fn table(points: &[(f64, f64, f64)]) -> TransferTable {
        let colors = points.iter().map(|&(x, c, _)| ColorPoint { x, rgb: [c, 1.0 - c, c * c] }).collect();
        let opacities = points.iter().map(|&(x, _, opacity)| OpacityPoint { x, opacity }).collect();
        TransferTable::build(&TransferFunction::new(colors, opacities).unwrap(), (0.0, 65535.0), 0.5)
    }

    fn read(table: &TransferTable, code: f32) -> [f32; 4] {
        let last = table.entries.len() - 1;
        let at = ((code - table.c_first) * table.scale()).clamp(0.0, last as f32);
        let i = (at as usize).min(last - 1);
        std::array::from_fn(|c| table.entries[i][c] + (table.entries[i + 1][c] - table.entries[i][c]) * (at - i as f32))
    }

    #[test]
    fn runs_hold_what_brute_force_finds() {
        let values: Vec<Span> = (0..77_u32).map(|i| [(i * 7919 % 101) as f32; 2]).collect();
        let runs = Runs::new(values.clone(), around);
        for first in 0..77 {
            for last in first..77 {
                let want = values[first..=last].iter().copied().fold(NOTHING, around);
                assert_eq!(runs.of(first, last, around), Some(want), "{first}..={last}");
            }
        }
        assert_eq!((runs.of(5, 4, around), runs.of(70, 77, around)), (None, None));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        /// Every code within is inside, and the extremes are reached: nothing wider would do.
        #[test]
        fn extremes_hold_every_sample_and_are_reached(
            points in proptest::collection::vec((0.0..65535.0_f64, 0.0..1.0_f64, opacity()), 2..7),
            lo in 0.0..1.0_f32, width in prop_oneof![Just(0.0_f32), 0.0..0.001_f32, 0.0..0.4_f32],
        ) {
            let mut points = points;
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            points.dedup_by(|a, b| (b.0 - a.0).abs() < 1.0);
            let table = table(&points);
            let (extremes, hi) = (TableExtremes::new(&table), (lo + width).min(1.0));
            prop_assert_eq!(extremes.alpha([lo, hi]), extremes.over([lo, hi]).alpha);
            let shown = extremes.over([lo, hi]);
            let mut met = NOTHING;
            // Peaks are narrower than any step: at the table's own entries, too.
            let entries = (0..table.entries.len()).map(|i| table.c_first + i as f32 / table.scale());
            let within = entries.filter(|code| (lo..=hi).contains(code));
            for code in (0..=3000).map(|i| lo + (hi - lo) * (i as f32 / 3000.0)).chain(within) {
                let [r, g, b, alpha] = read(&table, code);
                met = around(met, [alpha; 2]);
                prop_assert!(shown.alpha[0] <= alpha + 1e-6 && alpha <= shown.alpha[1] + 1e-6);
                for (c, color) in [r, g, b].into_iter().enumerate().filter(|_| alpha > 0.0) {
                    let [low, high] = shown.color[c];
                    prop_assert!(low <= color + 1e-6 && color <= high + 1e-6, "{color} in {low}..{high}");
                }
            }
            prop_assert!(met[0] - shown.alpha[0] < 1e-2 && shown.alpha[1] - met[1] < 1e-2, "{met:?} {shown:?}");
        }
    }

    #[test]
    fn colours_of_what_is_clear_are_of_no_account() {
        // Red below, and clear; white above.
        let table = table(&[(0.0, 0.0, 0.0), (30_000.0, 0.0, 0.0), (31_000.0, 1.0, 0.5), (65_535.0, 1.0, 0.5)]);
        let extremes = TableExtremes::new(&table);
        assert!(extremes.over([0.1, 0.3]).is_clear());
        let both = extremes.over([0.1, 0.9]);
        assert!(both.alpha[0] == 0.0 && both.color[0][0] < 0.01 && both.color[0][1] > 0.99, "{both:?}");
        let above = extremes.over([0.6, 0.9]);
        assert!(above.alpha[0] > 0.29 && above.color[0] == [1.0, 1.0], "{above:?}");
    }
}

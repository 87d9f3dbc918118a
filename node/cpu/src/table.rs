//! The transfer function for single samples: the twin's `classify.rs`, a lane each.

use super::lanes::{Floats, Ints, Lanes};
use super::ray::clamped;

/// A table, and what of it does not change along rays.
pub(crate) struct Table<'a, L: Lanes> {
    entries: &'a [[f32; 4]],
    /// The code of the first entry, and entries per code.
    first: L::F,
    scale: L::F,
    last: L::F,
    before_last: L::I,
    /// Entries that may show something ([`super::ShownEntries`]).
    shown: [L::I; 2],
}

/// Where codes lie in a table.
pub(crate) struct Entry<L: Lanes> {
    i: L::I,
    /// How far on to the next entry.
    w: L::F,
    /// Else they show nothing.
    pub(crate) may_show: L::M,
}

impl<'a, L: Lanes> Table<'a, L> {
    /// Of two entries or more, up to 2^24 (`Reader::new`).
    #[inline(always)]
    pub(crate) fn new(l: L, entries: &'a [[f32; 4]], (first, scale): (f32, f32), shown: [i32; 2]) -> Self {
        let last = entries.len() as i32 - 1;
        Self {
            entries,
            first: l.splat(first),
            scale: l.splat(scale),
            last: l.splat(last as f32),
            before_last: l.splat_int(last - 1),
            shown: [l.splat_int(shown[0]), l.splat_int(shown[1])],
        }
    }

    #[inline(always)]
    pub(crate) fn entry(&self, l: L, code: L::F) -> Entry<L> {
        let entry = clamped(l, (code - self.first) * self.scale, self.last);
        let i = entry.cut_off().smaller(self.before_last);
        Entry { i, w: entry - i.floats(), may_show: !(self.shown[0].gt(i) | i.gt(self.shown[1])) }
    }

    /// Straight colour and opacity of one step.
    #[inline(always)]
    pub(crate) fn between(&self, l: L, entry: &Entry<L>) -> [L::F; 4] {
        // SAFETY: entries were clamped to those of the table but the last.
        unsafe { l.between_rows(self.entries.as_ptr(), entry.i, entry.w) }
    }
}

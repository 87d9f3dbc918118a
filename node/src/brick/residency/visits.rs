//! In which order a frame needs its bricks.
//!
//! Frame after frame shows nearly the same bricks in nearly the same order. Of bricks that do not fit at once the least
//! recently used is the very one that is needed next, so that none would ever be found again. So those go first that
//! are needed last, counted from where the frame is now through its end to the begin of the next (Belady 1966): what
//! has just been drawn, and never what comes next.

use std::collections::HashMap;

use super::wanted::{BrickKey, Wanted};

/// A frame's bricks as it comes to them, each where it comes first.
#[derive(Debug, Default)]
pub struct Visits {
    order: Vec<Wanted>,
    places: HashMap<BrickKey, usize>,
}

impl Visits {
    #[must_use]
    pub fn new(wanted: impl IntoIterator<Item = Wanted>) -> Self {
        let mut visits = Self::default();
        for wanted in wanted {
            let next = visits.order.len();
            visits.places.entry(wanted.key).or_insert_with(|| {
                visits.order.push(wanted);
                next
            });
        }
        visits
    }

    /// Where a frame is that draws `wanted`: at the first of them.
    #[must_use]
    pub fn at(&self, wanted: &[Wanted]) -> Place<'_> {
        let places = wanted.iter().filter_map(|w| self.places.get(&w.key));
        Place { visits: self, now: places.copied().min().unwrap_or(0) }
    }

    /// What comes after the last of `wanted`, up to `bytes`.
    #[must_use]
    pub fn after(&self, wanted: &[Wanted], bytes: u64) -> &[Wanted] {
        let last = wanted.iter().filter_map(|w| self.places.get(&w.key)).max();
        let rest = &self.order[last.map_or(0, |last| last + 1)..];
        let mut sum = 0_u64;
        let fits = |w: &&Wanted| {
            sum = sum.saturating_add(w.bytes);
            sum <= bytes
        };
        &rest[..rest.iter().take_while(fits).count()]
    }
}

/// A place in a frame's order.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    visits: &'a Visits,
    now: usize,
}

impl Place<'_> {
    /// How many of the frame's bricks are needed before this one is; nothing where it is not one of them.
    pub(super) fn until(&self, key: &BrickKey) -> Option<usize> {
        let count = self.visits.order.len();
        self.visits.places.get(key).map(|place| (place + count - self.now) % count)
    }
}

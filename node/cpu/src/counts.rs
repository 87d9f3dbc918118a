//! What rays side by side have counted: the twin's `RayCounts`, a lane each.

use brickcast_shaders::twin::bindings::RayCounts;

use super::lanes::Lanes;

/// See [`RayCounts`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Counts<L: Lanes> {
    pub(crate) samples: L::I,
    pub(crate) positions: L::I,
    pub(crate) leapt: L::I,
    pub(crate) skips: L::I,
}

impl<L: Lanes> Counts<L> {
    #[inline(always)]
    pub(crate) fn none(l: L) -> Self {
        let zero = l.splat_int(0);
        Self { samples: zero, positions: zero, leapt: zero, skips: zero }
    }

    /// Of all rays.
    #[inline(always)]
    pub(crate) fn total(&self, l: L) -> RayCounts {
        RayCounts {
            samples: sum(l, self.samples),
            positions: sum(l, self.positions),
            leapt: sum(l, self.leapt),
            skips: sum(l, self.skips),
        }
    }
}

#[inline(always)]
fn sum<L: Lanes>(l: L, n: L::I) -> u32 {
    let n = l.store_int(n);
    let mut sum = 0_u32;
    for lane in 0..L::N {
        sum = sum.saturating_add(n[lane] as u32);
    }
    sum
}

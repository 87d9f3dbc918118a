//! How a node's memory budget is shared out: pure.
//!
//! Invariant: decoded chunks that are kept, resident bricks, and all that loading bricks holds meanwhile are never more
//! than the budget together. Where bricks lie on a GPU, they and what is uploaded are there, and the rest is the
//! host's: then neither has more than the budget.

/// One such part of the budget is for decoded chunks, at most ...
const CACHE: u64 = 8;
/// ... so many bytes: bricks that have halos share none.
const MOST_CACHE: u64 = 256 << 20;
/// One such part of that is for decoded chunks of arrays that views are of.
const VIEWS: u64 = 4;
/// One such part of what bricks have is for loading them, unless a single one needs more.
const LOADING: u64 = 4;
/// Where a frame's bricks do not fit at once, a pass takes one such part of them: another is fetched for the next pass
/// meanwhile, and what is left stays from frame to frame.
const PASSES: u64 = 4;

/// A node's budget, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryShares {
    /// Decoded chunks that are kept.
    pub cache: u64,
    /// Those of somebody else's array, of a view of it; a chunk may be larger.
    pub views: u64,
    /// Resident bricks, and what loading them holds.
    pub residency: u64,
}

impl MemoryShares {
    /// Of a budget in bytes.
    #[must_use]
    pub fn of(budget: u64) -> Self {
        let cache = (budget / CACHE).min(MOST_CACHE);
        let views = cache / VIEWS;
        Self { cache: cache - views, views, residency: budget - cache }
    }

    /// The smallest budget that has `bytes` for bricks.
    #[must_use]
    pub fn least_for(bytes: u64) -> u64 {
        bytes.saturating_add((bytes.saturating_sub(1) / (CACHE - 1)).min(MOST_CACHE))
    }
}

/// What bricks need, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Need {
    /// Resident.
    pub bytes: u64,
    /// While one is loaded, beside itself.
    pub loading: u64,
}

impl Need {
    /// What is enough for each of two.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self { bytes: self.bytes.max(other.bytes), loading: self.loading.max(other.loading) }
    }
}

/// What bricks of a frame have of [`MemoryShares::residency`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BrickShares {
    /// Bricks that are loaded at a time.
    pub at_once: usize,
    /// Bytes that they hold meanwhile.
    pub loading: u64,
    /// Bytes of resident bricks.
    pub resident: u64,
}

impl BrickShares {
    /// Of `budget` bytes. `largest`: of all bricks of the frame; `threads` load them. Nothing where not even one brick
    /// fits.
    #[must_use]
    pub fn of(budget: u64, largest: Need, threads: usize) -> Option<Self> {
        let beside = budget.checked_sub(largest.bytes)?;
        if largest.loading > beside {
            return None;
        }
        let most = (budget / LOADING).min(beside).checked_div(largest.loading).unwrap_or(u64::MAX);
        let at_once = usize::try_from(most).unwrap_or(usize::MAX).clamp(1, threads.max(1));
        let loading = largest.loading * at_once as u64;
        Some(Self { at_once, loading, resident: budget - loading })
    }

    /// Bytes of bricks that are drawn at a time where all that are drawn take `all`; a single brick may be more.
    #[must_use]
    pub fn of_a_pass(&self, all: u64) -> u64 {
        if all <= self.resident { self.resident } else { self.resident / PASSES }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIB: u64 = 1 << 10;
    const MIB: u64 = 1 << 20;

    #[test]
    fn shares_are_the_budget_together() {
        for budget in [0, 1, 7, 8, 9, 2 * MIB, 300 * MIB, 4 << 30, u64::MAX] {
            let MemoryShares { cache, views, residency } = MemoryShares::of(budget);
            assert_eq!(cache + views + residency, budget);
            for largest in [(0, 0), (80 * KIB, 200 * KIB), (5, 0), (MIB, 3 * MIB), (1 << 40, 1 << 40)] {
                let largest = Need { bytes: largest.0, loading: largest.1 };
                for threads in [0, 1, 2, 64] {
                    let Some(shares) = BrickShares::of(residency, largest, threads) else {
                        assert!(largest.bytes + largest.loading > residency, "{largest:?} fit {residency}");
                        continue;
                    };
                    assert_eq!(shares.loading + shares.resident, residency);
                    assert!(shares.resident >= largest.bytes && shares.loading >= largest.loading);
                    assert!((1..=threads.max(1)).contains(&shares.at_once));
                    assert!(shares.at_once == 1 || shares.loading <= residency / LOADING);
                }
            }
        }
    }

    #[test]
    fn the_least_budget_is_enough_and_one_byte_less_is_not() {
        for bytes in [1, 6, 7, 8, 100, 12_345_678, 1 << 40] {
            let least = MemoryShares::least_for(bytes);
            assert!(MemoryShares::of(least).residency >= bytes, "{bytes}");
            assert!(MemoryShares::of(least - 1).residency < bytes, "{bytes}");
        }
    }

    /// 2 MiB, of which bricks of 32 with regions can be loaded, too.
    #[test]
    fn a_few_bricks_are_enough() {
        let budget = MemoryShares::of(2 * MIB).residency;
        let plain = BrickShares::of(budget, Need { bytes: 84 * KIB, loading: 192 * KIB }, 2).unwrap();
        assert_eq!(plain.at_once, 2);
        assert!(plain.resident > 15 * 84 * KIB);
        let regions = BrickShares::of(budget, Need { bytes: 84 * KIB, loading: 600 * KIB }, 2).unwrap();
        assert_eq!(regions.at_once, 1);
        assert!(regions.resident > 13 * 84 * KIB);
    }
}

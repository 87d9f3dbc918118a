//! Value windows: the label of a voxel before components are told apart.

use super::code::{Density, MAX_DENSITY};

const DENSITIES: usize = MAX_DENSITY as usize + 1;

/// Which window each density belongs to. No window is wider than the segmentation range, so no region is either.
///
/// The window with the most voxels is taken first, then the one with the most of what is left, and so on; ties go to
/// the lower values. What is left is always made of gaps further apart than a window is wide, so a window takes from
/// one gap only.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Windows {
    of_density: Vec<u16>,
    count: u16,
}

/// Densities that a segmentation range of `share` (of the store's range, 0 to 1) spans: the largest difference that two
/// voxels of a region may have, rounded down.
#[must_use]
pub fn window_width(share: f64) -> Density {
    // `as` saturates, and takes NaN to 0.
    (share.clamp(0.0, 1.0) * f64::from(MAX_DENSITY)).floor() as Density
}

impl Windows {
    /// `histogram` counts the voxels of each density; `width` is the largest difference within a window.
    #[must_use]
    pub fn new(histogram: &[u64], width: Density) -> Self {
        const NONE: u16 = u16::MAX;
        let mut left: Vec<u64> = histogram.to_vec();
        left.resize(DENSITIES, 0);
        let values = usize::from(width) + 1;
        let mut windows = Self { of_density: vec![NONE; DENSITIES], count: 0 };
        loop {
            let mut sum: u64 = left[..values.min(DENSITIES)].iter().sum();
            let (mut best, mut most) = (0, sum);
            for start in 1..=DENSITIES - values {
                sum = sum - left[start - 1] + left[start + values - 1];
                if sum > most {
                    (best, most) = (start, sum);
                }
            }
            if most == 0 {
                break;
            }
            let taken = best..best + values;
            left[taken.clone()].fill(0);
            windows.of_density[taken].iter_mut().filter(|w| **w == NONE).for_each(|w| *w = windows.count);
            windows.count += 1;
        }
        // Densities that no voxel has: any labels will do, as long as they are not too wide.
        let mut start = None;
        for density in 0..DENSITIES {
            if windows.of_density[density] != NONE {
                start = None;
                continue;
            }
            match start {
                Some(s) if density - s < values => {}
                _ => {
                    start = Some(density);
                    windows.count += 1;
                }
            }
            windows.of_density[density] = windows.count - 1;
        }
        windows
    }

    #[must_use]
    pub fn of(&self, density: Density) -> u16 {
        self.of_density[usize::from(density)]
    }

    /// Number of windows.
    #[must_use]
    pub fn count(&self) -> u16 {
        self.count
    }

    /// The window of every 16-bit code.
    #[must_use]
    pub fn of_codes(&self) -> Vec<u16> {
        (0..=u16::MAX).map(|code| self.of(super::code::density_of_code(code))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The definition, word by word, with a fresh sum for every window.
    fn brute_force(histogram: &[u64], width: usize) -> Vec<Option<usize>> {
        let mut label = vec![None; DENSITIES];
        for next in 0.. {
            let total = |start: usize| -> u64 {
                (start..=start + width).filter(|d| label[*d].is_none()).map(|d| histogram[d]).sum()
            };
            let Some(best) = (0..DENSITIES - width).rev().max_by_key(|s| total(*s)) else { break };
            if total(best) == 0 {
                break;
            }
            (best..=best + width).for_each(|d| label[d] = label[d].or(Some(next)));
        }
        label
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn windows_follow_the_definition(
            masses in prop::collection::vec((0..DENSITIES, 0..50u64), 0..60),
            width in prop_oneof![Just(0usize), 1..40usize, 400..3000usize, Just(DENSITIES - 1)],
        ) {
            let mut histogram = vec![0; DENSITIES];
            masses.into_iter().for_each(|(d, n)| histogram[d] += n);
            let windows = Windows::new(&histogram, width as Density);
            for (d, want) in brute_force(&histogram, width).into_iter().enumerate() {
                if let Some(want) = want {
                    prop_assert_eq!(usize::from(windows.of(d as Density)), want, "density {}", d);
                }
            }
            // Every density has a window, and none is wider than allowed.
            let mut bounds = vec![(DENSITIES, 0); usize::from(windows.count())];
            for d in 0..DENSITIES {
                let b = &mut bounds[usize::from(windows.of(d as Density))];
                *b = (b.0.min(d), b.1.max(d));
            }
            prop_assert!(bounds.iter().all(|(lo, hi)| lo <= hi && hi - lo <= width));
        }
    }

    #[test]
    fn the_heaviest_window_comes_first_and_ties_go_to_the_lower_value() {
        let mut histogram = vec![0; DENSITIES];
        (histogram[100], histogram[110], histogram[500], histogram[5000]) = (5, 5, 10, 3);
        let windows = Windows::new(&histogram, 10);
        assert_eq!((windows.of(100), windows.of(110)), (0, 0));
        assert_eq!((windows.of(500), windows.of(5000)), (1, 2));
        assert_eq!(window_width(0.03), 491);
        assert_eq!((window_width(0.0), window_width(1.0), window_width(7.0)), (0, 16383, 16383));
    }
}

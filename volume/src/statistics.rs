//! The full-resolution histogram of stored 8- or 16-bit values, and what is computed from it: Otsu's threshold, quantiles.

/// Counts of every stored value: 256 bins, or 65,536 as soon as a value needs them. Histograms of parts add up with
/// [`Histogram16::merge`] in any order to the same one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Histogram16 {
    bins: Vec<u64>,
}

impl Default for Histogram16 {
    fn default() -> Self {
        Self::new_16_bit()
    }
}

impl Histogram16 {
    const BINS_8: usize = 1 << 8;
    const BINS_16: usize = 1 << 16;

    /// An empty histogram of 256 bins.
    #[must_use]
    pub fn new_8_bit() -> Self {
        Self { bins: vec![0; Self::BINS_8] }
    }

    /// An empty histogram of 65,536 bins.
    #[must_use]
    pub fn new_16_bit() -> Self {
        Self { bins: vec![0; Self::BINS_16] }
    }

    /// Counts per value, value = index: 256 or 65,536 of them.
    #[must_use]
    pub fn bins(&self) -> &[u64] {
        &self.bins
    }

    pub fn add_8_bit(&mut self, values: &[u8]) {
        for &value in values {
            self.bins[usize::from(value)] += 1;
        }
    }

    pub fn add_16_bit(&mut self, values: &[u16]) {
        self.widen();
        for &value in values {
            self.bins[usize::from(value)] += 1;
        }
    }

    /// Adds `count` voxels of one value.
    pub fn add(&mut self, value: u16, count: u64) {
        if usize::from(value) >= self.bins.len() {
            self.widen();
        }
        self.bins[usize::from(value)] += count;
    }

    pub fn merge(&mut self, other: &Self) {
        if other.bins.len() > self.bins.len() {
            self.widen();
        }
        for (mine, theirs) in self.bins.iter_mut().zip(&other.bins) {
            *mine += theirs;
        }
    }

    fn widen(&mut self) {
        self.bins.resize(Self::BINS_16, 0);
    }

    /// Voxels counted.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.bins.iter().sum()
    }

    /// Smallest value; `None` where nothing was counted.
    #[must_use]
    pub fn min(&self) -> Option<u16> {
        self.bins.iter().position(|&n| n > 0).map(|value| value as u16)
    }

    /// Largest value; `None` where nothing was counted.
    #[must_use]
    pub fn max(&self) -> Option<u16> {
        self.bins.iter().rposition(|&n| n > 0).map(|value| value as u16)
    }

    /// Sum of all voxels' values.
    fn sum(&self) -> u128 {
        self.bins.iter().zip(0u128..).map(|(&n, value)| u128::from(n) * value).sum()
    }

    /// `None` where nothing was counted.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        let count = self.count();
        (count > 0).then(|| self.sum() as f64 / count as f64)
    }

    /// The smallest value whose share of voxels, together with all smaller values, reaches `q`; `q` is clamped to 0..=1
    /// (NaN counts as 0). `None` where nothing was counted.
    #[must_use]
    pub fn quantile(&self, q: f64) -> Option<u16> {
        let q = if q.is_nan() { 0.0 } else { q.clamp(0.0, 1.0) };
        let count = self.count() as f64;
        let mut below = 0;
        let reaches = |&n: &u64| {
            below += n;
            // Never true before the first voxel, where q may be 0, nor for an empty histogram.
            below > 0 && below as f64 / count >= q
        };
        self.bins.iter().position(reaches).map(|value| value as u16)
    }

    /// Otsu's threshold (Otsu 1979), the largest value of the lower class: a voxel is of the upper class iff its value is
    /// greater. It maximises the variance between classes over all bins; of several maxima the first. A volume of one value
    /// gives that value, `None` where nothing was counted.
    #[must_use]
    pub fn otsu(&self) -> Option<u16> {
        let (lowest, highest) = (self.min()?, self.max()?);
        let (count, sum) = (self.count(), self.sum());
        let (mut best, mut best_variance) = (lowest, -1.0);
        let (mut count_low, mut sum_low) = (0u64, 0u128);
        for value in lowest..highest {
            let n = self.bins[usize::from(value)];
            if n == 0 {
                // The classes are those of the value before.
                continue;
            }
            count_low += n;
            sum_low += u128::from(n) * u128::from(value);
            // w0 w1 (m0 - m1)^2 = (S0 N - S n0)^2 / (n0 n1 N^2), N constant; the difference is exact: for 2^44 voxels its
            // terms stay below 2^104.
            let difference = sum_low as i128 * i128::from(count) - sum as i128 * i128::from(count_low);
            let difference = difference as f64;
            let variance = difference / count_low as f64 * (difference / (count - count_low) as f64);
            if variance > best_variance {
                (best, best_variance) = (value, variance);
            }
        }
        Some(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn histogram(values: &[u16]) -> Histogram16 {
        let mut histogram = Histogram16::new_8_bit();
        values.iter().for_each(|&value| histogram.add(value, 1));
        histogram
    }

    /// Otsu from the definition, over every value and every voxel.
    fn otsu_by_definition(values: &[u16]) -> u16 {
        let (lo, hi) = (*values.iter().min().unwrap(), *values.iter().max().unwrap());
        let mut best = (lo, -1.0);
        for threshold in lo..hi {
            let (low, high): (Vec<f64>, Vec<f64>) =
                values.iter().map(|&v| f64::from(v)).partition(|&v| v <= f64::from(threshold));
            let mean = |class: &[f64]| class.iter().sum::<f64>() / class.len() as f64;
            let variance = low.len() as f64 * high.len() as f64 * (mean(&low) - mean(&high)).powi(2);
            // The definition's rounding must not decide between equals.
            if variance > best.1 * (1.0 + 1e-12) {
                best = (threshold, variance);
            }
        }
        best.0
    }

    #[test]
    fn otsu_is_the_largest_value_of_the_lower_class() {
        assert_eq!(histogram(&[1, 1, 2, 9, 9, 10]).otsu(), Some(2));
        // Nothing between the classes: the first of the equal maxima, not their middle.
        assert_eq!(histogram(&[0, 0, 255]).otsu(), Some(0));
        assert_eq!(histogram(&[0, 65_535]).otsu(), Some(0));
    }

    #[test]
    fn a_constant_or_empty_volume_has_a_threshold_or_none() {
        assert_eq!(histogram(&[7; 9]).otsu(), Some(7));
        assert_eq!(histogram(&[65_535]).otsu(), Some(65_535));
        let empty = Histogram16::new_16_bit();
        assert_eq!((empty.otsu(), empty.quantile(0.5), empty.min(), empty.max()), (None, None, None, None));
        assert_eq!(empty.mean(), None);
    }

    #[test]
    fn the_largest_volume_overflows_nothing() {
        let mut histogram = Histogram16::new_16_bit();
        histogram.add(0, (1 << 43) - 1);
        histogram.add(65_534, 1);
        histogram.add(65_535, 1 << 43);
        assert_eq!(histogram.otsu(), Some(0));
        assert_eq!(histogram.quantile(0.5), Some(65_534));
        assert_eq!(histogram.count(), 1 << 44);
        assert!((histogram.mean().unwrap() - 32_767.5).abs() < 1e-3);
    }

    #[test]
    fn quantile_is_the_first_value_that_reaches_the_share() {
        let ten = histogram(&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
        for (q, value) in [(0.0, 1), (0.1, 1), (0.1001, 2), (0.5, 5), (0.9, 9), (0.999, 10), (1.0, 10), (7.0, 10)] {
            assert_eq!(ten.quantile(q), Some(value), "{q}");
        }
        assert_eq!(ten.quantile(-1.0), Some(1));
        assert_eq!(ten.quantile(f64::NAN), Some(1));
        // 0.07 * 100 is greater than 7 in f64.
        let hundred: Vec<u16> = (1..=100).collect();
        assert_eq!(histogram(&hundred).quantile(0.07), Some(7));
    }

    #[test]
    fn eight_bit_bins_widen_when_a_value_needs_it() {
        let mut narrow = Histogram16::new_8_bit();
        narrow.add_8_bit(&[3, 255]);
        assert_eq!(narrow.bins().len(), 256);
        narrow.merge(&histogram(&[256]));
        assert_eq!((narrow.bins().len(), narrow.min(), narrow.max()), (65_536, Some(3), Some(256)));
        narrow.add_16_bit(&[65_535]);
        assert_eq!((narrow.count(), narrow.max()), (4, Some(65_535)));
    }

    proptest! {
        #[test]
        fn otsu_and_quantile_agree_with_their_definitions(
            values in prop::collection::vec(prop_oneof![0u16..20, 100u16..140, 0u16..300], 1..60),
            q in 0.0f64..=1.0,
        ) {
            let histogram = histogram(&values);
            prop_assert_eq!(histogram.otsu(), Some(otsu_by_definition(&values)));
            let mut sorted = values.clone();
            sorted.sort_unstable();
            let share = |v: u16| sorted.partition_point(|&w| w <= v) as f64 / sorted.len() as f64;
            let quantile = sorted.iter().copied().find(|&v| share(v) >= q);
            prop_assert_eq!(histogram.quantile(q), quantile);
            prop_assert_eq!(histogram.mean().map(|m| (m * 1e6).round()),
                Some((values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64 * 1e6).round()));
        }

        #[test]
        fn parts_merge_to_the_whole(values in prop::collection::vec(any::<u16>(), 0..200), cut in 0usize..200) {
            let cut = cut.min(values.len());
            let (mut a, mut b, mut whole) =
                (Histogram16::default(), Histogram16::default(), Histogram16::default());
            a.add_16_bit(&values[..cut]);
            b.add_16_bit(&values[cut..]);
            whole.add_16_bit(&values);
            b.merge(&a);
            prop_assert_eq!(b, whole);
        }
    }
}

//! Counts of stored numbers, one bin each, and what follows from them exactly.

use rayon::prelude::*;

use crate::store::voxel::Voxel;

const BINS: usize = 1 << 16;

/// How often each ordinal (stored number minus its type's smallest) occurs.
#[derive(Debug, Clone)]
pub(crate) struct Histogram {
    /// [`BINS`] entries.
    counts: Vec<u64>,
}

impl Histogram {
    pub(crate) fn new() -> Self {
        Self { counts: vec![0; BINS] }
    }

    pub(crate) fn add<T: Voxel>(&mut self, voxels: &[T]) {
        // One table a thread; u32 counts keep it in the cache and cannot overflow within a piece.
        let piece = voxels.len().div_ceil(rayon::current_num_threads()).clamp(1 << 16, 1 << 30);
        let parts: Vec<Vec<u32>> = voxels
            .par_chunks(piece)
            .map(|part| {
                let mut counts = vec![0u32; BINS];
                part.iter().for_each(|v| counts[usize::from(v.ordinal())] += 1);
                counts
            })
            .collect();
        for part in parts {
            self.counts.iter_mut().zip(part).for_each(|(sum, n)| *sum += u64::from(n));
        }
    }

    /// How often each ordinal occurs.
    pub(crate) fn counts(&self) -> &[u64] {
        &self.counts
    }

    pub(crate) fn counts_mut(&mut self) -> &mut [u64] {
        &mut self.counts
    }

    /// Leaves an ordinal out, as if it had never been counted; how often it was.
    pub(crate) fn leave_out(&mut self, ordinal: u16) -> u64 {
        std::mem::take(&mut self.counts[usize::from(ordinal)])
    }

    pub(crate) fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Smallest and largest ordinal that occurs; `(0, 0)` where nothing was counted.
    pub(crate) fn bounds(&self) -> (u16, u16) {
        let min = self.counts.iter().position(|&n| n > 0).unwrap_or(0);
        let max = self.counts.iter().rposition(|&n| n > 0).unwrap_or(0);
        (min as u16, max as u16)
    }

    /// Mean ordinal.
    pub(crate) fn mean(&self) -> f64 {
        // At most 2^44 voxels of 16 bits: the sum fits.
        let sum: u64 = self.counts.iter().zip(0u64..).map(|(n, ordinal)| n * ordinal).sum();
        sum as f64 / self.total().max(1) as f64
    }

    /// The smallest ordinal whose cumulative share is at least `q`.
    pub(crate) fn quantile(&self, q: f64) -> u16 {
        let total = self.total() as f64;
        let mut below = 0u64;
        for (ordinal, &n) in self.counts.iter().enumerate() {
            below += n;
            if n > 0 && below as f64 >= q * total {
                return ordinal as u16;
            }
        }
        self.bounds().1
    }

    /// As [`otsu`].
    pub(crate) fn otsu(&self) -> u16 {
        otsu(&self.counts) as u16
    }

    /// Counts per bin, where ordinal `o` falls into `bin_of[o]`.
    pub(crate) fn binned(&self, bins: usize, bin_of: impl Fn(u16) -> usize) -> Vec<u64> {
        let mut out = vec![0; bins];
        for (ordinal, &n) in self.counts.iter().enumerate().filter(|(_, n)| **n > 0) {
            out[bin_of(ordinal as u16).min(bins - 1)] += n;
        }
        out
    }
}

/// Otsu's threshold: the last place of the lower class at the first maximum of the between-class variance
/// `w0 w1 (m0 - m1)^2` (Otsu 1979; the convention is scikit-image's `threshold_otsu`).
pub(crate) fn otsu(counts: &[u64]) -> usize {
    let first = counts.iter().position(|&n| n > 0).unwrap_or(0);
    let last = counts.iter().rposition(|&n| n > 0).unwrap_or(0);
    let total: u64 = counts.iter().sum();
    let sum: u64 = counts.iter().zip(0u64..).map(|(n, place)| n * place).sum();
    let (mut best, mut threshold) = (f64::NEG_INFINITY, first);
    let (mut n0, mut s0) = (0u64, 0u64);
    for (place, &n) in counts.iter().enumerate().take(last).skip(first) {
        if n == 0 {
            // The classes are those of the place before.
            continue;
        }
        n0 += n;
        s0 += n * place as u64;
        let n1 = total - n0;
        let apart = s0 as f64 / n0 as f64 - (sum - s0) as f64 / n1 as f64;
        let variance = n0 as f64 * n1 as f64 * apart * apart;
        if variance > best {
            (best, threshold) = (variance, place);
        }
    }
    threshold
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_occur() {
        let mut h = Histogram::new();
        h.add(&[10u16, 10, 20, 30]);
        h.add(&[65535u16]);
        assert_eq!([0.0, 0.4, 0.41, 0.6, 0.8, 0.81, 1.0].map(|q| h.quantile(q)), [10, 10, 20, 20, 30, 65535, 65535]);
        assert_eq!(h.bounds(), (10, 65535));
        assert_eq!(h.mean(), (10.0 + 10.0 + 20.0 + 30.0 + 65535.0) / 5.0);
        assert_eq!(h.total(), 5);
    }

    #[test]
    fn otsu_is_the_top_of_the_lower_class() {
        let mut h = Histogram::new();
        h.add(&[10i16, 11, 12, 200, 201, 202].map(|v| v - 100));
        assert_eq!(h.otsu(), (12 - 100 + 32768) as u16);
        let mut constant = Histogram::new();
        constant.add(&[7u8; 9]);
        assert_eq!((constant.otsu(), constant.quantile(0.5)), (7, 7));
    }
}

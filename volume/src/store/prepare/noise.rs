//! How noisy a volume is: the standard deviation of what differs from voxel to voxel in homogeneous material.
//!
//! Of every aligned cube of 2 x 2 x 2 voxels the mixed third difference is taken: the sum of its eight values, each
//! with the sign of the product of the three axes' signs. It vanishes for whatever is trilinear there, and grows by
//! `sqrt 8` from independent noise. Counts go by the cube's mean, so that constant air does not hide a material's
//! noise, and by the size of the difference. Sums of integers: the same whatever parts a volume is counted in
//! (docs/adr/0009-light-from-noise.md).

use rayon::prelude::*;

use crate::store::voxel::{StoredType, Voxel};

/// Bins of means: as many as 8-bit cubes have sums; of 16-bit ones each stands for 32 values.
const MEANS: usize = 2048;
/// Bins of differences: single ones below 16, then eight for every doubling, up to `4 * 65535`.
const DIFFERENCES: usize = 128;
/// The finest and the coarsest groups of means that are judged, over the range that holds nearly all.
const GROUPS: [usize; 5] = [256, 128, 64, 32, 16];
/// Of all cubes on either side of that range.
const ASIDE: f64 = 0.001;
/// A group of fewer cubes says nothing: at least this share of all, and this many.
const LEAST_SHARE: f64 = 0.01;
const LEAST_CUBES: u64 = 64;
/// Groups that are large enough hold this share of all cubes, or coarser ones are asked.
const LEAST_COVERED: f64 = 0.25;
/// The upper over the lower quartile of noise: 3.6 for Gauss's. Outside this, a group's differences are those of edges.
const QUARTILES: (f64, f64) = (2.0, 5.2);
/// The mean of the groups beside one over which its noise spreads, at least, as a share of it.
const LEAST_BESIDE: f64 = 0.25;
/// The median of the absolute value of Gauss's distribution, in standard deviations.
const MEDIAN: f64 = 0.674_489_750_196_081_7;
/// By how many medians the median of n errs, times the square root of n.
const MEDIAN_ERROR: f64 = 1.17;

/// Counts of cubes by their mean and their mixed third difference.
#[derive(Debug, Clone)]
pub(crate) struct NoiseHistogram {
    /// By mean, then by difference.
    counts: Vec<u64>,
    /// From the sum of eight ordinals to the bin of their mean.
    shift: u32,
}

impl NoiseHistogram {
    pub(crate) fn new(stored_type: StoredType) -> Self {
        Self { counts: vec![0; MEANS * DIFFERENCES], shift: if stored_type.bytes() == 1 { 0 } else { 8 } }
    }

    pub(crate) fn counts(&self) -> &[u64] {
        &self.counts
    }

    pub(crate) fn counts_mut(&mut self) -> &mut [u64] {
        &mut self.counts
    }

    /// Counts the cubes of a box of `[nx, ny]` voxels a plane, x fastest, whose lowest corner has even coordinates in
    /// the volume. Cubes with a voxel that is not `known` are left out, and so is what is over where a side is odd.
    pub(crate) fn add<T: Voxel>(&mut self, [nx, ny]: [usize; 2], voxels: &[T], known: impl Fn(T) -> bool + Sync) {
        let rows = ny / 2;
        let units = voxels.len() / (nx * ny).max(1) / 2 * rows;
        let parts = rayon::current_num_threads().min(units * nx / (1 << 16)).max(1);
        let count = |part: usize| {
            // One table a thread; a box has fewer cubes than u32 counts.
            let mut counts = vec![0_u32; MEANS * DIFFERENCES];
            for unit in units * part / parts..units * (part + 1) / parts {
                let first = (unit / rows * 2 * ny + unit % rows * 2) * nx;
                let row = |offset: usize| &voxels[first + offset..][..nx];
                let cubes = [row(0), row(nx), row(ny * nx), row((ny + 1) * nx)].map(|row| row.as_chunks::<2>().0);
                for x in 0..nx / 2 {
                    let [a, b, c, d] = cubes.map(|row| row[x]);
                    if [a, b, c, d].as_flattened().iter().all(|v| known(*v)) {
                        counts[self.bin([a, b, c, d])] += 1;
                    }
                }
            }
            counts
        };
        let parts: Vec<_> = (0..parts).into_par_iter().map(count).collect();
        for part in parts {
            self.counts.iter_mut().zip(part).for_each(|(sum, n)| *sum += u64::from(n));
        }
    }

    /// Rows of pairs along x: those at (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1).
    #[inline(always)]
    fn bin<T: Voxel>(&self, cube: [[T; 2]; 4]) -> usize {
        let [a, b, c, d] = cube.map(|pair| pair.map(|v| i32::from(v.ordinal())));
        let sum = [a, b, c, d].as_flattened().iter().sum::<i32>() as u32;
        let rise = |[low, high]: [i32; 2]| high - low;
        let difference = (rise(a) - rise(b) - rise(c) + rise(d)).unsigned_abs();
        (sum >> self.shift) as usize * DIFFERENCES + bin_of(difference)
    }

    /// The noise's standard deviation in stored units; 0 where there is none, or nothing homogeneous to see it in.
    pub(crate) fn deviation(&self) -> f64 {
        let of_mean: Vec<u64> = self.counts.chunks_exact(DIFFERENCES).map(|row| row.iter().sum()).collect();
        let total: u64 = of_mean.iter().sum();
        let aside = (total as f64 * ASIDE) as u64;
        let beyond = |n: &u64, seen: &mut u64| {
            *seen += n;
            *seen > aside
        };
        let (mut below, mut above) = (0, 0);
        let Some(lo) = of_mean.iter().position(|n| beyond(n, &mut below)) else { return 0.0 };
        let hi = of_mean.iter().rposition(|n| beyond(n, &mut above)).unwrap_or(lo);
        let least = ((total as f64 * LEAST_SHARE) as u64).max(LEAST_CUBES);
        for groups in GROUPS.map(|groups| groups.min(hi - lo + 1)) {
            let mut differences = vec![[0_u64; DIFFERENCES]; groups];
            for (mean, row) in self.counts.chunks_exact(DIFFERENCES).enumerate() {
                let group = mean.clamp(lo, hi).saturating_sub(lo) * groups / (hi - lo + 1);
                differences[group].iter_mut().zip(row).for_each(|(sum, n)| *sum += n);
            }
            let cubes: Vec<u64> = differences.iter().map(|group| group.iter().sum()).collect();
            let large: Vec<usize> = (0..groups).filter(|&i| cubes[i] >= least).collect();
            let covered: u64 = large.iter().map(|&i| cubes[i]).sum();
            if covered as f64 >= LEAST_COVERED * total as f64 {
                // Stored units of a group.
                let width = (hi - lo + 1) as f64 / groups as f64 * f64::from(1_u32 << self.shift) / 8.0;
                let deviations = large.into_iter().map(|i| (i, deviation_of(&differences[i])));
                return deviations
                    .filter(|(i, sigma)| is_spread(&cubes, *i, sigma / width))
                    .map(|d| d.1)
                    .fold(0.0, f64::max);
            }
        }
        0.0
    }
}

/// Noise of `sigma` groups' widths spreads the means of eight voxels over groups beside the `i`th one; what stands
/// alone there is an edge that many cubes share by symmetry.
fn is_spread(cubes: &[u64], i: usize, sigma: f64) -> bool {
    let reach = (sigma / 8.0_f64.sqrt()).round() as usize;
    if reach == 0 {
        return true;
    }
    let beside = i.saturating_sub(reach)..(i + reach + 1).min(cubes.len());
    let (others, sum) = (beside.len() - 1, cubes[beside].iter().sum::<u64>() - cubes[i]);
    sum as f64 >= LEAST_BESIDE * cubes[i] as f64 * others as f64
}

/// The bin of a difference.
fn bin_of(difference: u32) -> usize {
    if difference < 16 {
        return difference as usize;
    }
    let octave = difference.ilog2();
    (16 + (octave - 4) * 8 + (difference >> (octave - 3) & 7)) as usize
}

/// The smallest difference of a bin.
fn first_of(bin: usize) -> f64 {
    if bin < 16 {
        return bin as f64;
    }
    let (octave, eighth) = ((bin - 16) / 8, (bin - 16) % 8);
    ((8 + eighth) << (octave + 1)) as f64
}

/// Of a group of cubes; 0 where most do not differ, or differ as edges do.
fn deviation_of(differences: &[u64; DIFFERENCES]) -> f64 {
    let cubes: u64 = differences.iter().sum();
    if 2 * differences[0] >= cubes {
        return 0.0;
    }
    // A difference d stands for what lies between d - 1/2 and d + 1/2.
    let quantile = |share: f64| {
        let (wanted, mut below) = (share * cubes as f64, 0.0);
        for (bin, &n) in differences.iter().enumerate().filter(|(_, n)| **n > 0) {
            if below + n as f64 >= wanted {
                let (lo, hi) = ((first_of(bin) - 0.5).max(0.0), first_of(bin + 1) - 0.5);
                return lo + (hi - lo) * (wanted - below) / n as f64;
            }
            below += n as f64;
        }
        0.0
    };
    let (lower, median, upper) = (quantile(0.25), quantile(0.5), quantile(0.75));
    if !(QUARTILES.0 * lower..=QUARTILES.1 * lower).contains(&upper) {
        return 0.0;
    }
    // The largest of many groups: less what chance adds.
    median / (MEDIAN * 8.0_f64.sqrt()) * (1.0 - MEDIAN_ERROR / (cubes as f64).sqrt())
}

/// To three digits: no more are known, and people read it.
pub(crate) fn rounded(noise: f64) -> Option<f64> {
    format!("{noise:.2e}").parse().ok().filter(|n: &f64| n.is_normal() && *n > 0.0)
}

#[cfg(test)]
mod tests;

//! What a look is chosen by, of all steps together.

use crate::store::manifest::{HISTOGRAM_BINS, Manifest, QUANTILES};
use crate::store::prepare::histogram::otsu;

/// Of all voxels of all steps, data units. Values are as exact as the bins of the histogram that they are taken from.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonStatistics {
    pub min: f64,
    pub max: f64,
    pub mean: f64,
    pub otsu: f64,
    /// At the shares [`QUANTILES`].
    pub quantiles: [f64; 9],
    /// Voxels in [`HISTOGRAM_BINS`] equal bins over the range that all steps have.
    pub histogram: Vec<u64>,
    /// The largest of the steps' noise: light that fades in above it is calm in all of them.
    pub noise: Option<f64>,
}

impl CommonStatistics {
    /// Of at least one step; their ranges are the same.
    pub(crate) fn of(steps: &[Manifest]) -> Option<Self> {
        let first = steps.first()?;
        let mut histogram = vec![0_u64; HISTOGRAM_BINS];
        for step in steps {
            histogram.iter_mut().zip(&step.histogram).for_each(|(sum, n)| *sum = sum.saturating_add(*n));
        }
        let min = steps.iter().map(|m| m.min).fold(f64::INFINITY, f64::min);
        let max = steps.iter().map(|m| m.max).fold(f64::NEG_INFINITY, f64::max);
        let (lo, hi) = first.data_range;
        // Where a share of a bin ends.
        let at = |bin: usize, share: f64| {
            let t = (bin as f64 + share) / HISTOGRAM_BINS as f64;
            (lo * (1.0 - t) + hi * t).clamp(min, max)
        };
        let voxels = |m: &Manifest| m.histogram.iter().sum::<u64>() as f64;
        let all: f64 = steps.iter().map(voxels).sum();
        let mean = steps.iter().map(|m| m.mean * (voxels(m) / all)).sum::<f64>().clamp(min, max);
        let quantiles = QUANTILES.map(|share| {
            let (bin, within) = quantile(&histogram, share);
            at(bin, within)
        });
        let noise = steps.iter().filter_map(|m| m.noise).reduce(f64::max);
        Some(Self { min, max, mean, otsu: at(otsu(&histogram), 1.0), quantiles, histogram, noise })
    }

    /// What a step's manifest says of its voxels becomes what is said of all; all else stays. Looks are chosen by it.
    #[must_use]
    pub fn in_place_of(&self, step: &Manifest) -> Manifest {
        Manifest {
            min: self.min,
            max: self.max,
            mean: self.mean,
            otsu: self.otsu,
            quantiles: self.quantiles,
            quantile_999: self.quantiles[8],
            histogram: self.histogram.clone(),
            noise: self.noise,
            ..step.clone()
        }
    }
}

/// The first bin at which so large a share of all is reached, and what part of it is needed for that.
fn quantile(histogram: &[u64], share: f64) -> (usize, f64) {
    let all = histogram.iter().sum::<u64>() as f64;
    let mut below = 0.0;
    for (bin, &n) in histogram.iter().enumerate().filter(|(_, n)| **n > 0) {
        let n = n as f64;
        if below + n >= share * all {
            return (bin, ((share * all - below) / n).clamp(0.0, 1.0));
        }
        below += n;
    }
    (histogram.len().saturating_sub(1), 1.0)
}

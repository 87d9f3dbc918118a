//! A transfer function from a histogram: multi-level Otsu thresholding.
//!
//! Values are divided into classes so that the variance between the classes is largest (Otsu 1979, "A Threshold
//! Selection Method from Gray-Level Histograms", section V; the exact maximum by dynamic programming, as in Liao, Chen
//! and Chung 2001, "A Fast Algorithm for Multilevel Thresholding"). As many classes are taken as are needed to explain
//! [`ENOUGH`] of the whole variance: Otsu's criterion of separability, eta.

use super::colormap::Colormap;
use super::function::{ColorPoint, OpacityPoint, TransferFunction, TransferFunctionError};
use super::window::DEFAULT_OPACITY;

/// The fewest and the most classes.
pub const CLASSES: std::ops::RangeInclusive<usize> = 2..=5;
/// The share of the variance at which no further class is made.
pub const ENOUGH: f64 = 0.95;
/// Codes of a volume.
const CODES: f64 = 65536.0;

/// A range of values that belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueClass {
    /// From one threshold to the next, data units; the outer ends are those of the histogram.
    pub range: (f64, f64),
    /// Mean value, data units.
    pub mean: f64,
    /// Share of the voxels, 0..=1.
    pub share: f64,
    /// What the suggested function gives the mean.
    pub opacity: f64,
    pub rgb: [f64; 3],
}

/// A function and what it was made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Suggestion {
    pub function: TransferFunction,
    /// Lowest values first; the first class is clear.
    pub classes: Vec<ValueClass>,
    /// Share of the variance that the classes explain, 0..=1.
    pub separability: f64,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SuggestError {
    #[error("{got} classes: must lie between {} and {}", CLASSES.start(), CLASSES.end())]
    Classes { got: usize },
    #[error(
        "all voxels lie in one bin of the histogram, at {value}: there are no classes to tell apart; use --window LO,HI"
    )]
    OneBin { value: f64 },
    #[error("the histogram counts no voxels")]
    Empty,
    #[error(transparent)]
    Function(#[from] TransferFunctionError),
}

/// A bin that is not empty.
#[derive(Debug, Clone, Copy)]
struct Bin {
    value: f64,
    count: f64,
}

/// A function for a volume whose voxels fall into `histogram`, equal bins over the codes of `range` (lo, hi in data
/// units). `classes` of [`CLASSES`], or as many as are needed; fewer where fewer bins are filled.
///
/// The lowest class (air, background) is clear up to its threshold. From there opacity rises linearly over the means of
/// the other classes, to [`DEFAULT_OPACITY`] at the highest one, each by the same amount; `colormap` spans the
/// threshold to the highest mean.
///
/// # Errors
/// A number of classes outside [`CLASSES`], a histogram of less than two bins, values too close for the map's points.
pub fn suggest(
    histogram: &[u64],
    range: (f64, f64),
    classes: Option<usize>,
    colormap: Colormap,
) -> Result<Suggestion, SuggestError> {
    let Classes { mut classes, separability } = classes_of(histogram, range, classes)?;
    let threshold = classes[0].range.1;
    let shown = classes.len() - 1;
    let mut opacities = vec![OpacityPoint { x: threshold, opacity: 0.0 }];
    for (k, class) in classes.iter().enumerate().skip(1) {
        opacities.push(OpacityPoint { x: class.mean, opacity: DEFAULT_OPACITY * k as f64 / shown as f64 });
    }
    let colors: Vec<ColorPoint> = colormap.points_over(threshold, classes[shown].mean);
    let function = TransferFunction::new(colors, opacities)?;
    for class in &mut classes {
        (class.opacity, class.rgb) = (function.opacity(class.mean), function.color(class.mean));
    }
    Ok(Suggestion { function, classes, separability })
}

/// Classes, lowest values first, without opacities and colours.
pub(super) struct Classes {
    /// Two at least.
    pub(super) classes: Vec<ValueClass>,
    /// Share of the variance that they explain, 0..=1.
    separability: f64,
}

/// The classes of a histogram; arguments and errors as [`suggest`].
pub(super) fn classes_of(
    histogram: &[u64],
    range: (f64, f64),
    classes: Option<usize>,
) -> Result<Classes, SuggestError> {
    if let Some(got) = classes
        && !CLASSES.contains(&got)
    {
        return Err(SuggestError::Classes { got });
    }
    let bins = filled(histogram, range);
    let (first, last) = match bins[..] {
        [] => return Err(SuggestError::Empty),
        [Bin { value, .. }] => return Err(SuggestError::OneBin { value }),
        [first, .., last] => (first.value, last.value),
    };
    let most = bins.len().min(*CLASSES.end());
    let (ends, separability) = match classes {
        Some(count) => divided(&bins, count.min(most)),
        None => {
            let mut tried = (*CLASSES.start()..=most).map(|count| divided(&bins, count));
            let enough = tried.find(|(_, eta)| *eta >= ENOUGH);
            enough.unwrap_or_else(|| divided(&bins, most))
        }
    };

    let between = |i: usize| 0.5 * (bins[i - 1].value + bins[i].value);
    let starts = std::iter::once(0).chain(ends.iter().copied());
    let voxels: f64 = bins.iter().map(|b| b.count).sum();
    let classes = starts
        .zip(&ends)
        .map(|(start, &end)| {
            let count: f64 = bins[start..end].iter().map(|b| b.count).sum();
            let low = if start == 0 { first } else { between(start) };
            let high = if end == bins.len() { last } else { between(end) };
            let mean = bins[start..end].iter().map(|b| b.value * (b.count / count)).sum();
            ValueClass { range: (low, high), mean, share: count / voxels, opacity: 0.0, rgb: [0.0; 3] }
        })
        .collect();
    Ok(Classes { classes, separability })
}

/// The bins that are not empty, at the values of their middles.
fn filled(histogram: &[u64], (lo, hi): (f64, f64)) -> Vec<Bin> {
    let codes = CODES / histogram.len().max(1) as f64;
    let value = |bin: usize| lo + (hi - lo) * ((bin as f64 + 0.5) * codes - 0.5) / (CODES - 1.0);
    let filled = histogram.iter().enumerate().filter(|(_, count)| **count > 0);
    filled.map(|(bin, &count)| Bin { value: value(bin), count: count as f64 }).collect()
}

/// Where `count` classes end (bins before it), so that the variance between them is largest; and its share of the whole
/// variance. `count` is at most the number of bins.
fn divided(bins: &[Bin], count: usize) -> (Vec<usize>, f64) {
    let n = bins.len();
    // Around the middle, so that squares do not cancel.
    let middle = 0.5 * (bins[0].value + bins[n - 1].value);
    let (mut counts, mut sums, mut squares) = (vec![0.0], vec![0.0], 0.0);
    for (i, bin) in bins.iter().enumerate() {
        let v = bin.value - middle;
        counts.push(counts[i] + bin.count);
        sums.push(sums[i] + bin.count * v);
        squares += bin.count * v * v;
    }
    // Of one class: its count times the square of its mean. The sum over classes is largest where the variance between
    // is.
    let score = |from: usize, to: usize| (sums[to] - sums[from]).powi(2) / (counts[to] - counts[from]);
    // best[k][to]: of the first `to` bins in k + 1 classes, and where the last of them starts.
    let mut best: Vec<Vec<(f64, usize)>> =
        vec![(0..=n).map(|to| (if to > 0 { score(0, to) } else { 0.0 }, 0)).collect()];
    for k in 1..count {
        let before = &best[k - 1];
        let row = (0..=n).map(|to| {
            let sums = (k..to).map(|from| (before[from].0 + score(from, to), from));
            sums.fold((f64::NEG_INFINITY, k), |winner, sum| if sum.0 > winner.0 { sum } else { winner })
        });
        let row = row.collect();
        best.push(row);
    }
    let mut ends = vec![n];
    for k in (1..count).rev() {
        let to = ends[ends.len() - 1];
        ends.push(best[k][to].1);
    }
    ends.reverse();
    let mean = score(0, n);
    let whole = squares - mean;
    let eta = if whole > 0.0 { ((best[count - 1][n].0 - mean) / whole).clamp(0.0, 1.0) } else { 1.0 };
    (ends, eta)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Peaks at bins, each so many voxels with neighbours of a tenth.
    fn peaks(at: &[(usize, u64)]) -> Vec<u64> {
        let mut histogram = vec![0; 256];
        for &(bin, count) in at {
            histogram[bin] += count;
            histogram[bin - 1] += count / 10;
            histogram[bin + 1] += count / 10;
        }
        histogram
    }

    #[test]
    fn classes_are_the_peaks_and_thresholds_lie_between() {
        let histogram = peaks(&[(20, 10_000), (120, 3000), (220, 800)]);
        let s = suggest(&histogram, (0.0, 255.0), None, Colormap::Viridis).unwrap();
        assert_eq!(s.classes.len(), 3, "{:?}", s.classes);
        for (class, (want, share)) in s.classes.iter().zip([(20.0, 0.7246), (120.0, 0.2174), (220.0, 0.058)]) {
            assert!((class.mean - want).abs() < 0.6 && (class.share - share).abs() < 1e-3, "{class:?}");
        }
        assert!(s.separability > 0.99 && s.separability <= 1.0);
        let threshold = s.classes[0].range.1;
        assert!((21.0..119.0).contains(&threshold));
        assert_eq!(s.classes[1].range.0, threshold);
        let f = &s.function;
        assert_eq!((f.opacity(20.0), f.opacity(threshold)), (0.0, 0.0));
        assert!((s.classes[1].opacity - 0.25).abs() < 1e-12 && (s.classes[2].opacity - 0.5).abs() < 1e-12);
        assert_eq!(f.color(s.classes[2].mean), Colormap::Viridis.points().last().unwrap().rgb);
        assert!(s.classes[1].rgb != s.classes[2].rgb);
    }

    /// Against every way of dividing a small histogram.
    #[test]
    fn the_division_is_the_best_of_all() {
        let counts = [3_u64, 9, 1, 0, 4, 7, 7, 2, 0, 5, 1, 6];
        let bins = filled(&counts, (0.0, 65535.0));
        let n = bins.len();
        let voxels: f64 = bins.iter().map(|b| b.count).sum();
        let mean_of = |part: &[Bin]| {
            part.iter().map(|b| b.count * b.value).sum::<f64>() / part.iter().map(|b| b.count).sum::<f64>()
        };
        let between = |ends: &[usize]| {
            let (mut from, mut sum) = (0, 0.0);
            for &to in ends {
                let part = &bins[from..to];
                let weight = part.iter().map(|b| b.count).sum::<f64>() / voxels;
                sum += weight * (mean_of(part) - mean_of(&bins)).powi(2);
                from = to;
            }
            sum
        };
        let whole = bins.iter().map(|b| b.count * (b.value - mean_of(&bins)).powi(2)).sum::<f64>() / voxels;
        for count in 2..=4 {
            let (ends, eta) = divided(&bins, count);
            let all = (0..1_usize << (n - 1)).filter(|bits| bits.count_ones() as usize == count - 1).map(|bits| {
                let inner = (1..n).filter(|i| bits >> (i - 1) & 1 == 1);
                inner.chain(std::iter::once(n)).collect::<Vec<_>>()
            });
            let best = all.map(|ends| between(&ends)).fold(0.0, f64::max);
            assert_eq!(ends.len(), count);
            assert!((between(&ends) / best - 1.0).abs() < 1e-12, "{count}: {ends:?}");
            assert!((eta - best / whole).abs() < 1e-9, "{count}: {eta} {}", best / whole);
        }
    }

    #[test]
    fn values_of_bytes_are_those_of_their_bins() {
        let mut histogram = vec![0; 256];
        (histogram[7], histogram[8], histogram[255]) = (5, 5, 5);
        let s = suggest(&histogram, (0.0, 255.0), Some(3), Colormap::Grayscale).unwrap();
        let thresholds: Vec<f64> = s.classes[..2].iter().map(|c| c.range.1).collect();
        assert!(thresholds[0] > 7.0 && thresholds[0] < 8.0 && thresholds[1] < 255.0, "{thresholds:?}");
    }

    #[test]
    fn what_cannot_be_divided_is_refused() {
        let of = |histogram: &[u64], classes| suggest(histogram, (3.0, 9.0), classes, Colormap::Turbo);
        assert_eq!(of(&[0; 256], None), Err(SuggestError::Empty));
        assert_eq!(of(&[], None), Err(SuggestError::Empty));
        assert!(matches!(of(&[0, 7, 0], None), Err(SuggestError::OneBin { value }) if (value - 6.0).abs() < 0.01));
        for got in [0, 1, 6, 1000] {
            assert_eq!(of(&[1, 1], Some(got)), Err(SuggestError::Classes { got }));
        }
        // Fewer values than classes: one each.
        let two = of(&[4, 0, 0, 4], Some(5)).unwrap();
        assert!(two.classes.len() == 2 && (two.separability - 1.0).abs() < 1e-12);
        let narrow = suggest(&[1, 1], (1e15, 1e15 + 1.0), None, Colormap::CoolToWarm);
        assert!(matches!(narrow, Err(SuggestError::Function(_))), "{narrow:?}");
    }
}

//! What is drawn of a transfer function, whatever it is drawn with.

use brickcast_volume::store::Manifest;
use brickcast_volume::transfer_function::TransferFunction;

/// A curve, with a histogram behind it.
pub(super) struct Plot<'a> {
    pub(super) function: &'a TransferFunction,
    /// False where its opacities are not known.
    pub(super) has_opacities: bool,
    /// Data values at the left and right end, apart from each other.
    pub(super) range: (f64, f64),
    /// Opacity at the top, above 0.
    pub(super) top: f64,
    histogram: Option<Histogram>,
}

struct Histogram {
    /// Data values of codes 0 and 65535.
    range: (f64, f64),
    /// Of every bin, 0..=1: logarithm of its voxels over that of the fullest.
    heights: Vec<f64>,
}

impl<'a> Plot<'a> {
    pub(super) fn new(function: &'a TransferFunction, has_opacities: bool, volume: Option<&Manifest>) -> Self {
        let opacities = if has_opacities { function.opacities() } else { &[] };
        let of_function = function.colors().iter().map(|p| p.x).chain(opacities.iter().map(|p| p.x));
        let of_volume = volume.iter().flat_map(|m| [m.range.0, m.range.1]);
        let (lo, hi) = of_function.chain(of_volume).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        // One point alone stands in the middle.
        let margin = if hi > lo { 0.0 } else { (lo.abs() * 0.1).max(1.0) };
        let top = opacities.iter().map(|p| p.opacity).fold(0.0, f64::max);
        let histogram = volume.map(|m| {
            let fullest = m.histogram.iter().copied().max().unwrap_or(0).max(1);
            let heights = m.histogram.iter().map(|&n| (n as f64).ln_1p() / (fullest as f64).ln_1p()).collect();
            Histogram { range: m.range, heights }
        });
        Self {
            function,
            has_opacities,
            range: (lo - margin, hi + margin),
            top: if top > 0.0 { top } else { 1.0 },
            histogram,
        }
    }

    /// The data value at a share of the way from left to right.
    pub(super) fn x(&self, share: f64) -> f64 {
        let (lo, hi) = self.range;
        if share >= 1.0 { hi } else { lo + (hi - lo) * share }
    }

    /// Smallest and largest opacity in column `i` of `columns`, as shares of the height: a spike between two columns is
    /// seen.
    pub(super) fn curve(&self, i: usize, columns: usize) -> Option<[f64; 2]> {
        if !self.has_opacities {
            return None;
        }
        let (from, to) = self.column(i, columns);
        let points = self.function.opacities();
        let inside = &points[points.partition_point(|p| p.x < from)..points.partition_point(|p| p.x <= to)];
        let ends = [self.function.opacity(from), self.function.opacity(to)];
        let all = inside.iter().map(|p| p.opacity).chain(ends);
        let (low, high) = all.fold((f64::MAX, f64::MIN), |(a, b), o| (a.min(o), b.max(o)));
        Some([low / self.top, high / self.top])
    }

    /// Height of the histogram in column `i` of `columns`, 0..=1.
    pub(super) fn voxels(&self, i: usize, columns: usize) -> f64 {
        let Some(Histogram { range: (lo, hi), heights }) = &self.histogram else { return 0.0 };
        let (from, to) = self.column(i, columns);
        if heights.is_empty() || to < *lo || from > *hi {
            return 0.0;
        }
        let last = heights.len() - 1;
        let width = if hi > lo { hi - lo } else { 1.0 };
        let bin = |x: f64| (((x - lo) / width * heights.len() as f64).max(0.0) as usize).min(last);
        let (first, last) = (bin(from), bin(to));
        heights[first..=last].iter().copied().fold(0.0, f64::max)
    }

    fn column(&self, i: usize, columns: usize) -> (f64, f64) {
        (self.x(i as f64 / columns as f64), self.x((i + 1) as f64 / columns as f64))
    }
}

/// A number in few characters.
pub(super) fn short(x: f64) -> String {
    let magnitude = x.abs();
    if magnitude != 0.0 && !(1e-3..1e7).contains(&magnitude) {
        return format!("{x:.3e}");
    }
    let whole = if magnitude >= 1.0 { magnitude.log10().floor() as usize + 1 } else { 1 };
    let text = format!("{x:.*}", 5_usize.saturating_sub(whole));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A colour as `#rrggbb`.
pub(super) fn hex(rgb: [f64; 3]) -> String {
    let [r, g, b] = rgb.map(|v| (v * 255.0).round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
pub(super) mod tests {
    use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint};

    use super::*;

    pub(in super::super) fn function(opacities: &[(f64, f64)]) -> TransferFunction {
        let colors = vec![ColorPoint { x: 0.0, rgb: [1.0, 0.0, 0.0] }, ColorPoint { x: 100.0, rgb: [0.0, 0.0, 1.0] }];
        let opacities = opacities.iter().map(|&(x, opacity)| OpacityPoint { x, opacity }).collect();
        TransferFunction::new(colors, opacities).unwrap()
    }

    #[test]
    fn spikes_narrower_than_a_column_are_seen() {
        let f = function(&[(0.0, 0.0), (50.3, 0.0), (50.31, 0.8), (50.32, 0.0)]);
        let plot = Plot::new(&f, true, None);
        assert_eq!((plot.range, plot.top), ((0.0, 100.0), 0.8));
        let high: Vec<usize> = (0..70).filter(|&i| plot.curve(i, 70).is_some_and(|[_, high]| high > 0.0)).collect();
        assert_eq!(high, [35]);
        assert_eq!(plot.curve(35, 70), Some([0.0, 1.0]));
        assert!(Plot::new(&f, false, None).curve(35, 70).is_none());
    }

    #[test]
    fn ranges_have_a_width() {
        let one = TransferFunction::new(
            vec![ColorPoint { x: 5.0, rgb: [0.0; 3] }],
            vec![OpacityPoint { x: 5.0, opacity: 0.0 }],
        );
        let one = one.unwrap();
        let plot = Plot::new(&one, true, None);
        assert_eq!((plot.range, plot.top), ((4.0, 6.0), 1.0));
        assert_eq!(plot.voxels(3, 10), 0.0);
    }

    #[test]
    fn numbers_are_short() {
        for (x, want) in [
            (0.0, "0"),
            (255.0, "255"),
            (-3024.0, "-3024"),
            (0.5, "0.5"),
            (1.0 / 3.0, "0.3333"),
            (123.456_7, "123.46"),
            (65_535.25, "65535"),
            (1e-9, "1.000e-9"),
            (-1e300, "-1.000e300"),
        ] {
            assert_eq!(short(x), want);
        }
        assert_eq!(hex([1.0, 0.5, 0.0]), "#ff8000");
    }
}

//! The default look's transfer function: the classes of the histogram as materials, a colour each.

use super::function::{ColorPoint, OpacityPoint, TransferFunction};
use super::suggest::{SuggestError, ValueClass, classes_of};

/// Opacity of the densest material, per opacity unit.
const DENSEST: f64 = 0.6;
/// Opacity of the lightest material where there are several: what is behind it shows.
const LIGHTEST: f64 = 0.05;
/// Opacities within a material and at its border where all of them are seen through.
const THIN: [f64; 2] = [0.008, 0.1];
/// A function that shows less than this share of the voxels was led astray by a few values far from all others.
const FEWEST_SHOWN: f64 = 1e-4;

/// Colours of one to four materials, lightest values first. All of a row differ by 25 or more in CIE 1976 (L*, a*, b*),
/// also for readers without one kind of cones (a test says so).
const PALETTE: [&[[f64; 3]]; 4] = [
    &[[0.90, 0.87, 0.80]],
    &[[0.45, 0.68, 0.88], [0.93, 0.62, 0.25]],
    &[[0.45, 0.68, 0.88], [0.95, 0.85, 0.55], [0.80, 0.36, 0.16]],
    &[[0.30, 0.47, 0.80], [0.55, 0.80, 0.86], [0.95, 0.85, 0.55], [0.80, 0.36, 0.16]],
];

/// How materials show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {
    /// Opacities rise by equal factors from [`LIGHTEST`] to [`DENSEST`]: a lighter material is seen through.
    Solid,
    /// All are seen through; what shows are their borders, pores among them.
    Glass,
}

/// A function and what it was made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Materials {
    pub function: TransferFunction,
    /// Lowest values first; the first is clear, the others have the opacity and colour of the function at their mean.
    pub classes: Vec<ValueClass>,
}

/// A colour for each class of the histogram (see [`super::suggest`]) but the lowest, which is clear. Within the middle
/// half of a class (from half-way between its low end and its mean to half-way between that and its high end) colour
/// and opacity are its own, between classes they run linearly, of glass over a peak at the border.
///
/// # Errors
/// As [`super::suggest`]; nothing where the classes show less than [`FEWEST_SHOWN`] of the voxels.
pub fn materials(histogram: &[u64], range: (f64, f64), body: Body) -> Result<Option<Materials>, SuggestError> {
    let mut classes = classes_of(histogram, range, None)?.classes;
    let shown = classes.len() - 1;
    if classes[1..].iter().map(|class| class.share).sum::<f64>() < FEWEST_SHOWN {
        return Ok(None);
    }
    let palette = PALETTE[shown.clamp(1, PALETTE.len()) - 1];
    let mut opacities = vec![OpacityPoint { x: classes[0].range.1, opacity: 0.0 }];
    let mut colors = Vec::new();
    for (k, class) in classes.iter_mut().skip(1).enumerate() {
        class.opacity = match body {
            Body::Solid => opacity(k, shown),
            Body::Glass => THIN[0],
        };
        if body == Body::Glass {
            // The first has nothing before its border: the peak lies half-way to its middle half.
            let (low, mean) = (class.range.0, class.mean);
            opacities.push(OpacityPoint { x: if k == 0 { low + 0.25 * (mean - low) } else { low }, opacity: THIN[1] });
        }
        class.rgb = palette[k.min(palette.len() - 1)];
        let ends = [0.5 * (class.range.0 + class.mean), 0.5 * (class.mean + class.range.1)];
        // The densest has no end.
        for x in ends.into_iter().take(if k + 1 == shown { 1 } else { 2 }) {
            opacities.push(OpacityPoint { x, opacity: class.opacity });
            colors.push(ColorPoint { x, rgb: class.rgb });
        }
    }
    let function = TransferFunction::new(colors, opacities)?;
    Ok(Some(Materials { function, classes }))
}

/// Of material `k` of `count`, from 0.
fn opacity(k: usize, count: usize) -> f64 {
    let below = (count - 1 - k) as f64 / (count - 1).max(1) as f64;
    DENSEST * (LIGHTEST / DENSEST).powf(below)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn histogram(peaks: &[(usize, u64)]) -> Vec<u64> {
        let mut histogram = vec![0; 256];
        for &(bin, count) in peaks {
            histogram[bin] += count;
            histogram[bin - 1] += count / 10;
            histogram[bin + 1] += count / 10;
        }
        histogram
    }

    #[test]
    fn every_class_but_the_lowest_is_a_material_of_its_own() {
        for (peaks, shown) in [
            (&[(20, 10_000), (200, 900)][..], 1),
            (&[(20, 10_000), (120, 3000), (220, 800)], 2),
            (&[(10, 9000), (80, 3000), (150, 3000), (230, 3000)], 3),
        ] {
            let m = materials(&histogram(peaks), (0.0, 255.0), Body::Solid).unwrap().unwrap();
            assert_eq!(m.classes.len(), shown + 1, "{:?}", m.classes);
            assert_eq!((m.function.opacity(peaks[0].0 as f64), m.classes[0].opacity), (0.0, 0.0));
            for (k, &(bin, _)) in peaks[1..].iter().enumerate() {
                let (got, want) = (m.function.opacity(bin as f64), opacity(k, shown));
                assert!((got - want).abs() < 0.02, "{bin}: {got} {want}");
                assert_eq!(m.function.color(m.classes[k + 1].mean), PALETTE[shown - 1][k]);
            }
            assert!((m.function.opacity(255.0) - DENSEST).abs() < 1e-12);
        }
    }

    #[test]
    fn glass_shows_borders_more_than_bodies() {
        let histogram = histogram(&[(20, 10_000), (120, 3000), (220, 800)]);
        let m = materials(&histogram, (0.0, 255.0), Body::Glass).unwrap().unwrap();
        let f = &m.function;
        assert_eq!((f.opacity(20.0), m.classes[0].range.1), (0.0, f.opacities()[0].x));
        for class in &m.classes[1..] {
            assert!((f.opacity(class.mean) - THIN[0]).abs() < 1e-12, "{class:?}");
        }
        assert!((f.opacity(m.classes[2].range.0) - THIN[1]).abs() < 1e-12);
        let inside_border = 0.75 * m.classes[1].range.0 + 0.25 * m.classes[1].mean;
        assert!((f.opacity(inside_border) - THIN[1]).abs() < 1e-12);
    }

    #[test]
    fn a_few_values_far_from_all_others_make_no_materials() {
        let mut histogram = vec![0; 256];
        (histogram[0], histogram[255]) = (1_000_000, 1);
        assert_eq!(materials(&histogram, (0.0, 1e6), Body::Solid), Ok(None));
        histogram[255] = 1000;
        assert!(materials(&histogram, (0.0, 1e6), Body::Solid).unwrap().is_some());
        assert!(matches!(materials(&[0, 7, 0], (0.0, 1.0), Body::Solid), Err(SuggestError::OneBin { .. })));
    }

    /// Linear sRGB as people see it that lack one kind of cones (Machado, Oliveira and Fernandes 2009, severity 1).
    const READERS: [[[f64; 3]; 3]; 4] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ];

    fn times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
        m.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
    }

    /// CIE 1976 (L*, a*, b*) under D65.
    fn lab(linear: [f64; 3]) -> [f64; 3] {
        let to_xyz = [
            [0.412_456_4, 0.357_576_1, 0.180_437_5],
            [0.212_672_9, 0.715_152_2, 0.072_175_0],
            [0.019_333_9, 0.119_192_0, 0.950_304_1],
        ];
        let f = |t: f64| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
        let [x, y, z] = times(&to_xyz, linear);
        let (x, y, z) = (f(x / 0.950_47), f(y), f(z / 1.088_83));
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    #[test]
    fn readers_of_every_kind_tell_the_colours_apart() {
        let linear = |c: f64| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        let seen = |reader, rgb: [f64; 3]| lab(times(reader, rgb.map(linear)).map(|c| c.clamp(0.0, 1.0)));
        let distance = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        for reader in &READERS {
            for row in PALETTE {
                for (i, &a) in row.iter().enumerate() {
                    for &b in &row[i + 1..] {
                        let apart = distance(seen(reader, a), seen(reader, b));
                        assert!(apart >= 25.0, "{a:?} {b:?}: {apart}");
                    }
                }
            }
            // Red and green of equal lightness would not do.
            let bad = distance(seen(&READERS[2], [0.8, 0.3, 0.2]), seen(&READERS[2], [0.45, 0.45, 0.2]));
            assert!(bad < 25.0, "{bad}");
        }
    }
}

//! What single samples would miss of a transfer function: where they suffice, slabs cost more and are no nearer to the
//! converged picture (docs/explanation/integral.md, Which of the two).

use super::function::TransferFunction;

/// Share of the range by which a value may change along one voxel: an edge of a scan takes a few voxels and is seldom
/// as high as the range.
const CHANGE_PER_VOXEL: f64 = 0.1;
/// How far opacity, or colour times opacity, may be from the straight line between two samples, as a share of the
/// greatest opacity: two samples tell what lies between them up to that.
const MOST_BENT: f64 = 0.25;
/// Windows begin this often along their length.
const WINDOWS: f64 = 4.0;
/// Places at which a window is looked at, control points apart.
const PLACES: u32 = 16;

/// Detail of a function between two values that may follow each other on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detail {
    /// Data units.
    pub values: [f64; 2],
    /// How far the function is from the straight line between them, as a share of its greatest opacity.
    pub bent: f64,
}

/// The first place where samples `step` voxels apart would miss something of `function`, by the values that a volume
/// of `range` (data units) may take one after the other; `None` where the function is all but straight between any two.
/// It depends on function, range and step alone.
#[must_use]
pub fn missed_by_samples(function: &TransferFunction, (lo, hi): (f64, f64), step: f64) -> Option<Detail> {
    let most = function.opacities().iter().map(|p| p.opacity).fold(0.0, f64::max);
    let width = (hi - lo) * (CHANGE_PER_VOXEL * step).min(1.0);
    if !(most > 0.0 && width > 0.0 && width.is_finite()) {
        return None;
    }
    let mut points: Vec<f64> = function.opacities().iter().map(|p| p.x).collect();
    points.extend(function.colors().iter().map(|p| p.x));
    points.sort_by(f64::total_cmp);
    let at = |x: f64| {
        let opacity = function.opacity(x) / most;
        let [r, g, b] = function.color(x).map(|c| c * opacity);
        [r, g, b, opacity]
    };
    let windows = ((hi - lo) / width * WINDOWS).ceil() as u32;
    (0..windows).map(|i| lo + f64::from(i) * width / WINDOWS).find_map(|from| {
        let to = from + width;
        let (first, last) = (at(from), at(to));
        let bent_at = |x: f64| {
            let share = (x - from) / width;
            let here = at(x);
            let off = |c: usize| (here[c] - (first[c] + (last[c] - first[c]) * share)).abs();
            (0..4).map(off).fold(0.0, f64::max)
        };
        let inside = &points[points.partition_point(|&x| x <= from)..points.partition_point(|&x| x < to)];
        let places = (1..PLACES).map(|k| from + width * f64::from(k) / f64::from(PLACES));
        let bent = inside.iter().copied().chain(places).map(bent_at).fold(0.0, f64::max);
        (bent > MOST_BENT).then_some(Detail { values: [from, to], bent })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer_function::{ColorPoint, OpacityPoint};

    fn function(opacities: &[(f64, f64)]) -> TransferFunction {
        let opacities = opacities.iter().map(|&(x, opacity)| OpacityPoint { x, opacity }).collect();
        TransferFunction::new(vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }], opacities).unwrap()
    }

    fn misses(function: &TransferFunction, step: f64) -> bool {
        missed_by_samples(function, (0.0, 1.0), step).is_some()
    }

    /// The functions of docs/explanation/integral.md, at the steps of its table up to a voxel.
    #[test]
    fn smooth_functions_are_sampled_and_narrow_ones_are_not() {
        let smooth = function(&[(0.0, 0.0), (0.25, 0.0), (0.5, 0.12), (0.75, 0.05), (1.0, 0.4)]);
        let window = function(&[(0.3, 0.0), (0.6, 0.6)]);
        let spiky =
            function(&[(0.0, 0.0), (0.294, 0.0), (0.3, 0.25), (0.306, 0.0), (0.694, 0.0), (0.7, 0.6), (0.706, 0.0)]);
        // Between all places at which windows are looked at.
        let peak = function(&[(0.5136, 0.0), (0.5137, 0.95), (0.5138, 0.0)]);
        let slab = function(&[(0.498, 0.0), (0.4985, 0.95), (0.5015, 0.95), (0.502, 0.0)]);
        for step in [1.0, 0.5, 0.25] {
            assert!(!misses(&smooth, step) && !misses(&window, step), "{step}");
            assert!(misses(&spiky, step) && misses(&peak, step) && misses(&slab, step), "{step}");
        }
    }

    /// Shorter steps need slabs less, and an edge of no width needs them always.
    #[test]
    fn the_step_counts_and_edges_are_never_sampled() {
        let ramp = function(&[(0.4, 0.0), (0.46, 0.5)]);
        assert!(misses(&ramp, 2.0) && misses(&ramp, 1.0) && !misses(&ramp, 0.25));
        let edge = function(&[(0.4, 0.0), (0.4_f64.next_up(), 0.5)]);
        assert!([4.0, 1.0, 0.1, 0.01].iter().all(|&step| misses(&edge, step)));
    }

    /// Faint detail beside a bright rest does not count, nor does detail of what is clear; colour counts as opacity
    /// does.
    #[test]
    fn what_counts_is_what_shows() {
        let faint = function(&[(0.1, 0.0), (0.6, 0.02), (0.601, 0.05), (0.602, 0.02), (1.0, 1.0)]);
        assert!(!misses(&faint, 1.0));
        let colors = |opacity| {
            let color = |x, red| ColorPoint { x, rgb: [red, 0.5, 0.5] };
            let opacities = vec![OpacityPoint { x: 0.0, opacity }, OpacityPoint { x: 1.0, opacity: 1.0 }];
            TransferFunction::new(vec![color(0.1, 0.0), color(0.1001, 1.0)], opacities).unwrap()
        };
        assert!(misses(&colors(1.0), 0.5) && !misses(&colors(0.0), 0.5));
        assert_eq!(missed_by_samples(&TransferFunction::nothing(), (0.0, 1.0), 1.0), None);
        assert_eq!(missed_by_samples(&colors(1.0), (0.0, 0.0), 1.0), None);
        let found = missed_by_samples(&function(&[(80.0, 0.0), (80.5, 1.0)]), (0.0, 255.0), 0.5).unwrap();
        assert!(found.values[0] < 80.5 && found.values[1] > 80.0 && found.bent > 0.25, "{found:?}");
    }
}

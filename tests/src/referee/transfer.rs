//! From values to colour and opacity.

/// Piecewise linear between points `(value, output)`, ascending in value, clamped outside. Colours are straight,
/// opacities for a path of one opacity unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Transfer {
    pub colors: Vec<(f64, [f64; 3])>,
    pub opacities: Vec<(f64, f64)>,
}

impl Transfer {
    /// One colour, one opacity, whatever the value.
    #[must_use]
    pub fn constant(color: [f64; 3], opacity: f64) -> Self {
        Self { colors: vec![(0.0, color)], opacities: vec![(0.0, opacity)] }
    }

    #[must_use]
    pub fn color(&self, value: f64) -> [f64; 3] {
        interpolate(&self.colors, value, |a, b, t| std::array::from_fn(|c| a[c] * (1.0 - t) + b[c] * t))
    }

    #[must_use]
    pub fn opacity(&self, value: f64) -> f64 {
        interpolate(&self.opacities, value, |a, b, t| a * (1.0 - t) + b * t)
    }

    /// Where to cut what runs evenly from `from` to `to` into slices over each of which the function is all but
    /// straight: shares of the way, from 0 to 1. `even` slices, cut at the function's points, and more between points
    /// that are close together.
    #[must_use]
    pub fn cuts(&self, from: f64, to: f64, even: usize) -> Vec<f64> {
        let points = self.colors.iter().map(|p| p.0).chain(self.opacities.iter().map(|p| p.0));
        let mut inside: Vec<f64> = points.map(|x| (x - from) / (to - from)).filter(|u| *u > 0.0 && *u < 1.0).collect();
        inside.sort_by(f64::total_cmp);
        let mut cuts: Vec<f64> = (0..=even).map(|i| i as f64 / even as f64).collect();
        for pair in inside.windows(2).filter(|pair| (pair[1] - pair[0]) * (even as f64) < 24.0) {
            cuts.extend((1..24).map(|i| pair[0] + (pair[1] - pair[0]) * f64::from(i) / 24.0));
        }
        cuts.extend(inside);
        cuts.sort_by(f64::total_cmp);
        cuts.dedup();
        cuts
    }
}

fn interpolate<T: Copy>(points: &[(f64, T)], value: f64, mix: impl Fn(T, T, f64) -> T) -> T {
    for pair in points.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        if value < x0 {
            return y0;
        }
        if value < x1 {
            return mix(y0, y1, (value - x0) / (x1 - x0));
        }
    }
    points[points.len() - 1].1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_between_points_and_clamped_outside() {
        let transfer = Transfer {
            colors: vec![(1.0, [0.0, 1.0, 0.5]), (3.0, [1.0, 0.0, 0.5])],
            opacities: vec![(0.0, 0.2), (1.0, 0.4), (5.0, 0.0)],
        };
        assert_eq!(transfer.color(1.5), [0.25, 0.75, 0.5]);
        assert_eq!((transfer.color(-9.0), transfer.color(9.0)), ([0.0, 1.0, 0.5], [1.0, 0.0, 0.5]));
        assert!((transfer.opacity(0.5) - 0.3).abs() < 1e-15 && (transfer.opacity(3.0) - 0.2).abs() < 1e-15);
        assert_eq!((transfer.opacity(-1.0), transfer.opacity(6.0)), (0.2, 0.0));
        assert_eq!(Transfer::constant([0.1, 0.2, 0.3], 0.4).opacity(77.0), 0.4);
    }
}

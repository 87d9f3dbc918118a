//! From values to colour and opacity.

/// Piecewise linear between points `(value, output)`, ascending in value, clamped outside. Colours are straight, opacities
/// for a path of one opacity unit.
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

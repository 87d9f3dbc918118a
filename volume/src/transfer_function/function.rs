//! A transfer function and its points.

/// A colour at a data value; straight (not premultiplied), display-referred, each channel in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorPoint {
    pub x: f64,
    pub rgb: [f64; 3],
}

/// An opacity at a data value, for a path of one opacity unit; in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpacityPoint {
    pub x: f64,
    pub opacity: f64,
}

/// Piecewise linear between its points, clamped outside. `x` is within [`MAX_X`] and strictly increasing in both lists,
/// which have at least one point and at most [`MAX_POINTS`].
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    pub(super) colors: Vec<ColorPoint>,
    pub(super) opacities: Vec<OpacityPoint>,
}

/// The most points of either list.
pub const MAX_POINTS: usize = 65_536;
/// The greatest magnitude of x: differences of two stay finite.
pub const MAX_X: f64 = 1e300;

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TransferFunctionError {
    #[error("{list} has {got} points: between 1 and {MAX_POINTS} are needed")]
    Count { list: &'static str, got: usize },
    #[error(
        "{list}[{index}]: x = {x} must be finite (at most {MAX_X:e} either way) and greater than the point before it \
         ({before})"
    )]
    Order { list: &'static str, index: usize, x: f64, before: f64 },
    #[error("{list}[{index}]: {value} must lie between 0 and 1")]
    Value { list: &'static str, index: usize, value: f64 },
    #[error("window {lo},{hi}: give two finite numbers, the lower first, far enough apart to hold a colour map")]
    Window { lo: f64, hi: f64 },
}

impl TransferFunction {
    /// # Errors
    /// Empty or over-long lists, x not finite and strictly increasing, values outside 0..=1.
    pub fn new(colors: Vec<ColorPoint>, opacities: Vec<OpacityPoint>) -> Result<Self, TransferFunctionError> {
        check_x("colors", colors.iter().map(|p| p.x))?;
        check_x("opacities", opacities.iter().map(|p| p.x))?;
        for (index, value) in colors.iter().enumerate().flat_map(|(i, p)| p.rgb.map(|v| (i, v))) {
            check_value("colors", index, value)?;
        }
        for (index, p) in opacities.iter().enumerate() {
            check_value("opacities", index, p.opacity)?;
        }
        Ok(Self { colors, opacities })
    }

    /// Shows nothing of any value.
    #[must_use]
    pub fn nothing() -> Self {
        let colors = vec![ColorPoint { x: 0.0, rgb: [0.0; 3] }];
        Self { colors, opacities: vec![OpacityPoint { x: 0.0, opacity: 0.0 }] }
    }

    #[must_use]
    pub fn colors(&self) -> &[ColorPoint] {
        &self.colors
    }

    #[must_use]
    pub fn opacities(&self) -> &[OpacityPoint] {
        &self.opacities
    }

    /// Straight colour at `x` (data units).
    #[must_use]
    pub fn color(&self, x: f64) -> [f64; 3] {
        let (i, t) = segment(&self.colors, |p| p.x, x);
        let (a, b) = (self.colors[i].rgb, self.colors[(i + 1).min(self.colors.len() - 1)].rgb);
        std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
    }

    /// Opacity per opacity unit at `x` (data units).
    #[must_use]
    pub fn opacity(&self, x: f64) -> f64 {
        let (i, t) = segment(&self.opacities, |p| p.x, x);
        let (a, b) = (self.opacities[i].opacity, self.opacities[(i + 1).min(self.opacities.len() - 1)].opacity);
        a + (b - a) * t
    }
}

/// The segment that holds `x` and the position in it, 0..=1; clamped outside.
fn segment<P>(points: &[P], x_of: impl Fn(&P) -> f64, x: f64) -> (usize, f64) {
    let after = points.partition_point(|p| x_of(p) <= x);
    if after == 0 {
        return (0, 0.0);
    }
    if after == points.len() {
        return (points.len() - 1, 0.0);
    }
    let (x0, x1) = (x_of(&points[after - 1]), x_of(&points[after]));
    (after - 1, (x - x0) / (x1 - x0))
}

fn check_x(list: &'static str, xs: impl ExactSizeIterator<Item = f64>) -> Result<(), TransferFunctionError> {
    if !(1..=MAX_POINTS).contains(&xs.len()) {
        return Err(TransferFunctionError::Count { list, got: xs.len() });
    }
    let mut before = f64::NEG_INFINITY;
    for (index, x) in xs.enumerate() {
        if !(x.abs() <= MAX_X && x > before) {
            return Err(TransferFunctionError::Order { list, index, x, before });
        }
        before = x;
    }
    Ok(())
}

fn check_value(list: &'static str, index: usize, value: f64) -> Result<(), TransferFunctionError> {
    if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(TransferFunctionError::Value { list, index, value }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn color(x: f64) -> ColorPoint {
        ColorPoint { x, rgb: [0.5; 3] }
    }

    fn opacity(x: f64, opacity: f64) -> OpacityPoint {
        OpacityPoint { x, opacity }
    }

    #[test]
    fn steps_an_ulp_wide_keep_both_sides() {
        for at in [0.0, -0.0, 5.0, -1e300, 1e-310] {
            let f = TransferFunction::new(vec![color(0.0)], vec![opacity(at, 0.25), opacity(f64::next_up(at), 0.75)]);
            let f = f.unwrap();
            assert_eq!((f.opacity(at), f.opacity(at.next_up())), (0.25, 0.75), "{at}");
            assert_eq!((f.opacity(-1e301), f.opacity(1e301)), (0.25, 0.75), "{at}");
        }
    }

    #[test]
    fn huge_x_cannot_make_nan() {
        let f = TransferFunction::new(vec![color(0.0)], vec![opacity(-1e300, 0.0), opacity(1e300, 1.0)]).unwrap();
        assert_eq!((f.opacity(0.0), f.opacity(9e299)), (0.5, 0.95));
        assert_eq!((f.opacity(f64::MAX), f.opacity(f64::MIN)), (1.0, 0.0));
    }

    #[test]
    fn lists_that_break_the_invariant_are_refused_by_index() {
        let good = || vec![opacity(0.0, 0.0)];
        let refused = |colors: Vec<ColorPoint>, opacities: Vec<OpacityPoint>| {
            TransferFunction::new(colors, opacities).unwrap_err().to_string()
        };
        assert!(refused(vec![], good()).contains("colors has 0 points"));
        assert!(refused(vec![color(0.0)], vec![]).contains("opacities has 0 points"));
        let many = (0..=MAX_POINTS).map(|i| opacity(i as f64, 0.0)).collect();
        assert!(refused(vec![color(0.0)], many).contains("65537"));
        for x in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e301] {
            assert!(refused(vec![color(0.0), color(x)], good()).contains("colors[1]"), "{x}");
        }
        for value in [f64::NAN, -0.001, 1.001, f64::INFINITY] {
            assert!(refused(vec![color(0.0)], vec![opacity(0.0, value)]).contains("opacities[0]"), "{value}");
        }
    }
}

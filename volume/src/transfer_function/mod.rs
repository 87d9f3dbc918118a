//! Transfer functions: piecewise linear colour and opacity over the volume's own data units.

pub mod table;

pub use table::TransferTable;

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

/// Piecewise linear between its points, clamped outside. `x` is finite and strictly increasing in both lists, which have at
/// least one point and at most [`MAX_POINTS`].
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    colors: Vec<ColorPoint>,
    opacities: Vec<OpacityPoint>,
}

/// The most points of either list.
pub const MAX_POINTS: usize = 65_536;

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TransferFunctionError {
    #[error("{list} has {got} points: between 1 and {MAX_POINTS} are needed")]
    Count { list: &'static str, got: usize },
    #[error("{list}[{index}]: x = {x} must be finite and greater than the point before it ({before})")]
    Order { list: &'static str, index: usize, x: f64, before: f64 },
    #[error("{list}[{index}]: {value} must lie between 0 and 1")]
    Value { list: &'static str, index: usize, value: f64 },
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
        if !(x.is_finite() && x > before) {
            return Err(TransferFunctionError::Order { list, index, x, before });
        }
        before = x;
    }
    Ok(())
}

fn check_value(list: &'static str, index: usize, value: f64) -> Result<(), TransferFunctionError> {
    if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(TransferFunctionError::Value { list, index, value }) }
}

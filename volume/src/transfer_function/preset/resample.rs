//! Control nodes, which may jump and curve, to points that are linear in between.

/// A control node: `N` values at `x`. `midpoint` and `sharpness` shape the way to the next node (see [`shaped`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Node<const N: usize> {
    pub(super) x: f64,
    pub(super) values: [f64; N],
    /// Fraction of the way at which the mean of both ends is reached, in 0..=1.
    pub(super) midpoint: f64,
    /// 0: linear, 1: a step, in 0..=1.
    pub(super) sharpness: f64,
}

/// How values run from one node to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Shape {
    Linear,
    /// The lower end's values below this fraction of the way, the upper end's from it on.
    Jump {
        at: f64,
    },
    /// The upper end's values right behind the lower end.
    Upper,
    /// Continuous, with a break at this fraction of the way.
    Curve {
        middle: f64,
    },
}

/// VTK's bounds for a midpoint, against division by zero (`vtkPiecewiseFunction::GetTable`).
const MIDPOINT_MARGIN: f64 = 1e-5;

impl<const N: usize> Node<N> {
    pub(super) fn middle(&self) -> f64 {
        self.midpoint.clamp(MIDPOINT_MARGIN, 1.0 - MIDPOINT_MARGIN)
    }

    /// The shape that midpoint and sharpness ask for: piecewise constant above a sharpness of 0.99, piecewise linear
    /// below 0.01 (`vtkPiecewiseFunction::GetTable`).
    pub(super) fn shape_to(&self, next: &Self) -> Shape {
        if self.values == next.values {
            Shape::Linear
        } else if self.sharpness > 0.99 {
            Shape::Jump { at: self.middle() }
        } else if self.sharpness < 0.01 && self.midpoint == 0.5 {
            Shape::Linear
        } else {
            Shape::Curve { middle: self.middle() }
        }
    }
}

/// The value at the fraction `s` of the way between two nodes, for a curve: VTK's "modified Hermite"
/// (`vtkPiecewiseFunction::GetTable`). `s` is bent so that 0.5 lies at the midpoint and then drawn towards it by
/// `0.5 (2 s)^(1 + 10 sharpness)`; a cubic Hermite curve follows whose slope at both ends is
/// `(1 - sharpness) (y1 - y0)`. Below a sharpness of 0.01: linear from either end to the mean at the midpoint.
pub(super) fn shaped(node: &Node<1>, next: &Node<1>, s: f64) -> f64 {
    let (y0, y1, sharpness, middle) = (node.values[0], next.values[0], node.sharpness, node.middle());
    let bent = if s < middle { 0.5 * s / middle } else { 0.5 + 0.5 * (s - middle) / (1.0 - middle) };
    if sharpness < 0.01 {
        return (1.0 - bent) * y0 + bent * y1;
    }
    let power = 1.0 + 10.0 * sharpness;
    let t = if bent < 0.5 { 0.5 * (2.0 * bent).powf(power) } else { 1.0 - 0.5 * (2.0 * (1.0 - bent)).powf(power) };
    let slope = (1.0 - sharpness) * (y1 - y0);
    let (t2, t3) = (t * t, t * t * t);
    let rise = 3.0 * t2 - 2.0 * t3;
    let y = (1.0 - rise) * y0 + rise * y1 + (t3 - 2.0 * t2 + t) * slope + (t3 - t2) * slope;
    y.clamp(y0.min(y1), y0.max(y1))
}

/// How closely pieces follow a curve: the coarser ones serve presets of so many nodes that the finest would exceed the
/// limit.
const TOLERANCES: [f64; 3] = [1e-4, 1e-3, 1e-2];
/// Pieces of either half of a curve before refinement.
const FIRST_PIECES: u32 = 8;
/// Each of them is halved at most this often.
const HALVINGS: u32 = 7;

/// Points of strictly increasing x, at most `limit` of them where `nodes` leave that possible (four times their count).
/// `nodes` are sorted by x; of several at one x the first counts from the left and the last from the right: the step is
/// two points an ulp apart.
pub(super) fn resample<const N: usize>(
    nodes: &[Node<N>],
    limit: usize,
    shape: impl Fn(&Node<N>, &Node<N>) -> Shape,
    value: impl Fn(&Node<N>, &Node<N>, f64) -> [f64; N],
) -> Vec<(f64, [f64; N])> {
    let fine = TOLERANCES.into_iter().find_map(|tolerance| at_tolerance(nodes, limit, tolerance, &shape, &value));
    fine.or_else(|| at_tolerance(nodes, usize::MAX, f64::INFINITY, &shape, &value)).unwrap_or_default()
}

/// `None` as soon as `limit` is exceeded.
fn at_tolerance<const N: usize>(
    nodes: &[Node<N>],
    limit: usize,
    tolerance: f64,
    shape: &impl Fn(&Node<N>, &Node<N>) -> Shape,
    value: &impl Fn(&Node<N>, &Node<N>, f64) -> [f64; N],
) -> Option<Vec<(f64, [f64; N])>> {
    let mut points = Points(Vec::new());
    let mut before: Option<&Node<N>> = None;
    for node in nodes {
        match before {
            Some(from) if from.x == node.x => points.push(node.x.next_up(), node.values),
            Some(from) => points.segment(from, node, tolerance, shape(from, node), value),
            None => points.push(node.x, node.values),
        }
        if points.0.len() > limit {
            return None;
        }
        before = Some(node);
    }
    Some(points.0)
}

struct Points<const N: usize>(Vec<(f64, [f64; N])>);

impl<const N: usize> Points<N> {
    /// Appends a point; at the x of the last one it takes its place.
    fn push(&mut self, x: f64, values: [f64; N]) {
        match self.0.last_mut() {
            Some(last) if last.0 == x => last.1 = values,
            Some(last) if last.0 > x => {}
            _ => self.0.push((x, values)),
        }
    }

    /// Appends what lies behind `from` up to and including `to`.
    fn segment(
        &mut self,
        from: &Node<N>,
        to: &Node<N>,
        tolerance: f64,
        shape: Shape,
        value: &impl Fn(&Node<N>, &Node<N>, f64) -> [f64; N],
    ) {
        let x_at = |s: f64| from.x + (to.x - from.x) * s;
        match shape {
            Shape::Linear => {}
            Shape::Jump { at } => {
                self.inside(x_at(at).next_down(), from.values, to.x);
                self.inside(x_at(at), to.values, to.x);
            }
            Shape::Upper => self.inside(from.x.next_up(), to.values, to.x),
            Shape::Curve { middle } => {
                let mut left = (0.0, from.values);
                let pieces = if tolerance.is_finite() { FIRST_PIECES } else { 1 };
                for i in 1..=2 * pieces {
                    let part = f64::from(i) / f64::from(pieces);
                    let s = if i <= pieces { middle * part } else { middle + (1.0 - middle) * (part - 1.0) };
                    let right = if i == 2 * pieces { (1.0, to.values) } else { (s, value(from, to, s)) };
                    self.refine(left, right, HALVINGS, tolerance, &x_at, &|s| value(from, to, s));
                    self.inside(x_at(right.0), right.1, to.x);
                    left = right;
                }
            }
        }
        self.push(to.x, to.values);
    }

    /// Appends the points that keep the way from `left` to `right` (fractions, values) within `tolerance`, ends
    /// excluded. Three probes: a curve symmetric to its middle deceives a single one.
    fn refine(
        &mut self,
        left: (f64, [f64; N]),
        right: (f64, [f64; N]),
        halvings: u32,
        tolerance: f64,
        x_at: &impl Fn(f64) -> f64,
        value: &impl Fn(f64) -> [f64; N],
    ) {
        let at = |t: f64| left.0 + (right.0 - left.0) * t;
        let off = |t: f64| {
            let v = value(at(t));
            (0..N).any(|c| (left.1[c] + (right.1[c] - left.1[c]) * t - v[c]).abs() > tolerance)
        };
        if halvings == 0 || !(off(0.5) || off(0.25) || off(0.75)) {
            return;
        }
        let middle = (at(0.5), value(at(0.5)));
        self.refine(left, middle, halvings - 1, tolerance, x_at, value);
        self.inside(x_at(middle.0), middle.1, x_at(1.0));
        self.refine(middle, right, halvings - 1, tolerance, x_at, value);
    }

    /// Appends a point only where it lies between the last one and `end`: neighbours may be an ulp apart.
    fn inside(&mut self, x: f64, values: [f64; N], end: f64) {
        if x < end && self.0.last().is_none_or(|last| last.0 < x) {
            self.0.push((x, values));
        }
    }
}

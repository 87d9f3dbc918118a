//! Codes and data values, and where the entries of a table of single samples stand.

use super::function::TransferFunction;

/// The largest code; tables reach to the one above, so that blocks of codes are powers of two.
pub(crate) const LAST_CODE: f64 = 65535.0;
/// Codes of a table over all of them.
pub(crate) const ALL_CODES: u32 = 65536;

/// A store's range of values, by code.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Codes {
    lo: f64,
    hi: f64,
}

impl Codes {
    /// `range`: data units of codes 0 and 65535.
    pub(crate) const fn new((lo, hi): (f64, f64)) -> Self {
        Self { lo, hi }
    }

    /// A volume of one value, whose codes all stand for it.
    pub(crate) fn is_one_value(self) -> bool {
        !(self.hi - self.lo).is_normal() || self.hi < self.lo
    }

    /// Data units of a code, which need not be whole; exact for whole codes of a range of whole numbers.
    pub(crate) fn x(self, code: f64) -> f64 {
        if self.is_one_value() {
            return self.lo;
        }
        if code == LAST_CODE { self.hi } else { self.lo + (self.hi - self.lo) * code / LAST_CODE }
    }

    /// The code of a data value, beyond 0 and 65535 where it lies outside.
    pub(crate) fn code(self, x: f64) -> f64 {
        if self.is_one_value() { 0.0 } else { (x - self.lo) / (self.hi - self.lo) * LAST_CODE }
    }
}

/// Entry i stands at code `first + i * stride`. Strides are powers of two and entries stand at multiples of them: with
/// a stride of 1 or less every whole code has an entry of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EntryGrid {
    pub(crate) first: f64,
    pub(crate) stride: f64,
    /// At least 4097.
    pub(crate) count: usize,
}

/// Pieces between entries, at least.
const PIECES: f64 = 4096.0;
/// Codes that a table spans, at least: positions computed in f32 then err by few entries.
const LEAST_WIDTH: f64 = 16.0;
/// How far a table may be from the function at any code, opacity and colour.
const DEVIATION: f64 = 2e-4;

impl EntryGrid {
    /// The entries for `function` with opacities as `step` makes them, over the codes between which it changes: beyond,
    /// single samples are those of the ends. As few as carry it at every code, where there are more than codes all of
    /// them.
    pub(crate) fn new(function: &TransferFunction, codes: Codes, step: impl Fn(f64) -> f64) -> Self {
        let (first, last) = changes(function, codes);
        let fitting = (last - first).max(LEAST_WIDTH) / PIECES;
        // The power of two at or below: the exponent alone, which no library rounds.
        let stride = f64::from_bits(fitting.to_bits() & f64::INFINITY.to_bits());
        let mut grid = Self::spanning(first, last, stride);
        while grid.stride > 1.0 && !grid.carries(function, codes, &step) {
            grid = Self::spanning(first, last, grid.stride / 2.0);
        }
        grid
    }

    fn spanning(first: f64, last: f64, stride: f64) -> Self {
        let first = (first / stride).floor() * stride;
        let pieces = ((last - first) / stride).ceil().max(PIECES);
        Self { first, stride, count: pieces as usize + 1 }
    }

    pub(crate) fn code(&self, i: usize) -> f64 {
        self.first + i as f64 * self.stride
    }

    /// True where the table is the function at the codes about its points. Between them both are all but straight.
    fn carries(&self, function: &TransferFunction, codes: Codes, step: impl Fn(f64) -> f64) -> bool {
        let at = |code: f64| {
            let x = codes.x(code);
            let [r, g, b] = function.color(x);
            [r, g, b, step(function.opacity(x))]
        };
        points(function).map(|x| codes.code(x)).filter(|code| (0.0..=LAST_CODE).contains(code)).all(|code| {
            [code.floor(), code.ceil()].into_iter().all(|code| {
                let entry = ((code - self.first) / self.stride).clamp(0.0, (self.count - 1) as f64);
                let (low, high) = (entry.floor() as usize, entry.ceil() as usize);
                let t = entry - low as f64;
                let (a, b, want) = (at(self.code(low)), at(self.code(high)), at(code));
                (0..4).all(|c| (a[c] + (b[c] - a[c]) * t - want[c]).abs() <= DEVIATION)
            })
        })
    }
}

/// Where the function's points lie.
pub(crate) fn points(function: &TransferFunction) -> impl Iterator<Item = f64> {
    function.colors().iter().map(|p| p.x).chain(function.opacities().iter().map(|p| p.x))
}

/// The codes between which the function changes; points between which it does not count for nothing.
fn changes(function: &TransferFunction, codes: Codes) -> (f64, f64) {
    let colors = function.colors().windows(2).filter(|w| w[0].rgb != w[1].rgb).map(|w| [w[0].x, w[1].x]);
    let opacities = function.opacities().windows(2).filter(|w| w[0].opacity != w[1].opacity).map(|w| [w[0].x, w[1].x]);
    let (first, last) = colors.chain(opacities).fold((f64::MAX, f64::MIN), |(a, b), [x, y]| (a.min(x), b.max(y)));
    if codes.is_one_value() || first > last {
        return (0.0, LAST_CODE);
    }
    let code = |x: f64| codes.code(x).clamp(0.0, LAST_CODE);
    let first = code(first).floor().min(LAST_CODE - LEAST_WIDTH);
    (first, code(last).ceil().max(first + LEAST_WIDTH))
}

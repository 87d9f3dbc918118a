//! How the pixels of a frame become colours.

use super::{PixelKind, Pixels, RawPixel};
use crate::premul::Premul;
use crate::transfer_function::TransferFunction;

/// What turns codes into colours: a scene's transfer function, over a store's range.
#[derive(Debug, Clone)]
pub struct Coloring {
    function: TransferFunction,
    /// Data units of codes 0 and 1.
    range: (f64, f64),
}

impl Coloring {
    /// `range`: data units of codes 0 and 1.
    #[must_use]
    pub fn new(function: TransferFunction, range: (f64, f64)) -> Self {
        Self { function, range }
    }

    /// A projection's pixels by the transfer function, with the opacity of one opacity unit, whatever the step; clear
    /// where a ray met no sample. Colours are what they are.
    #[must_use]
    pub fn colors(&self, pixels: &Pixels) -> Vec<Premul> {
        let color = |pixel: &RawPixel| match pixels.kind() {
            PixelKind::Over => Premul::from_array(*pixel),
            kind => kind.code(*pixel).map_or(Premul::CLEAR, |code| self.color(code)),
        };
        pixels.raw().iter().map(color).collect()
    }

    fn color(&self, code: f32) -> Premul {
        let (lo, hi) = self.range;
        let value = lo + (hi - lo) * f64::from(code);
        let ([r, g, b], a) = (self.function.color(value), self.function.opacity(value));
        Premul::from_array([r * a, g * a, b * a, a].map(|c| c as f32))
    }
}

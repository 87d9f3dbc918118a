//! What a cell may show by one opacity, at full resolution and as it is drawn.

use super::place::How;
use crate::transfer_function::extremes::{NOTHING, Span, TableExtremes};

/// Opacities that are so many times apart are clearly others.
const CLEARLY: f32 = 4.0;
const LAST_CODE: f32 = 65_535.0;

/// What decides the opacity of a sample by its code.
#[derive(Debug)]
pub(super) enum Opacity {
    Table(TableExtremes),
    /// An isosurface parts what is below its code from what is not.
    From(u16),
}

impl Opacity {
    pub(super) fn over(&self, [lo, hi]: [u16; 2]) -> Span {
        if lo > hi {
            return NOTHING;
        }
        match self {
            Self::Table(table) => table.alpha([lo, hi].map(|code| f32::from(code) / LAST_CODE)),
            Self::From(code) => [lo, hi].map(|end| f32::from(u8::from(end >= *code))),
        }
    }
}

/// The opacities of a cell: of its finest voxels, and of what is drawn in their place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spans {
    pub(super) finest: Span,
    pub(super) drawn: Span,
}

impl Spans {
    pub(super) fn shows(&self) -> bool {
        self.finest[1] > 0.0 || self.drawn[1] > 0.0
    }

    /// The worst that may be: the voxel that shows most under the mean that shows least, and the other way round.
    pub(super) fn judged(&self) -> How {
        let lost = is_clearly_less(self.drawn[0], self.finest[1]);
        How { lost, filled: is_clearly_less(self.finest[0], self.drawn[1]), gone: false }
    }

    /// All of it shows, at full resolution and as it is drawn.
    pub(super) fn is_full(&self) -> [bool; 2] {
        [self.finest, self.drawn].map(|[least, most]| least > 0.0 && least <= most)
    }

    /// Likewise, nothing of it.
    pub(super) fn is_clear(&self) -> [bool; 2] {
        [self.finest, self.drawn].map(|[least, most]| most <= 0.0 && least <= most)
    }
}

pub(super) fn is_clearly_less(less: f32, more: f32) -> bool {
    more > 0.0 && less * CLEARLY < more
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_clearly_other_is_hidden_and_noise_is_not() {
        let judged = |finest, means| {
            let how = Spans { finest, drawn: means }.judged();
            (how.lost, how.filled)
        };
        assert_eq!(judged([0.0, 0.5], [0.0, 0.0]), (true, false), "a pore that shows, in a mean that does not");
        assert_eq!(judged([0.0, 0.5], [0.5, 0.5]), (false, true), "a clear pore, in a mean that shows");
        assert_eq!(judged([0.0, 0.0], [0.0, 0.0]), (false, false));
        assert_eq!(judged([0.3, 0.5], [0.4, 0.4]), (false, false), "noise");
        assert_eq!(judged([0.05, 0.5], [0.06, 0.06]), (true, false));
        assert_eq!(judged([0.0, 1e-6], [0.0, 0.0]), (true, false), "whatever shows at all, shows");
        // Of several voxels the worst pair counts: nothing says which mean stands for which.
        assert_eq!(judged([0.0, 0.5], [0.0, 0.5]), (true, true));
        assert_eq!(judged(NOTHING, NOTHING), (false, false), "no data");
    }

    #[test]
    fn an_isosurface_parts_what_lies_on_both_sides_of_it() {
        let surface = Opacity::From(1000);
        let judged = |finest, means| Spans { finest: surface.over(finest), drawn: surface.over(means) }.judged();
        assert!(judged([10, 2000], [900, 900]).lost && judged([10, 2000], [1000, 1000]).filled);
        assert!(!judged([1000, 2000], [1500, 1500]).is_hidden() && !judged([10, 999], [500, 500]).is_hidden());
    }
}

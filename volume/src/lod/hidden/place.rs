//! What is hidden of a picture, and how.

use crate::brick::OwnedBox;

/// Cells in a row of which the same is hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HiddenPlace {
    /// On which level it is drawn.
    pub level: u8,
    /// In voxels of the finest level.
    pub voxels: OwnedBox,
    pub how: How,
}

/// How a cell is hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct How {
    /// Full resolution shows something there of which nothing, or clearly less, may be drawn.
    pub lost: bool,
    /// Something is drawn there where full resolution shows nothing, or clearly less: a pore that is filled.
    pub filled: bool,
    /// Nor is it drawn by any voxel around: no coarser outline of what is drawn, but gone.
    pub gone: bool,
}

impl How {
    pub(super) fn is_hidden(self) -> bool {
        self.lost || self.filled
    }

    pub(super) fn or(self, other: Self) -> Self {
        Self { lost: self.lost || other.lost, filled: self.filled || other.filled, gone: self.gone || other.gone }
    }
}

/// What is hidden of a picture.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Hidden {
    /// x fastest.
    pub places: Vec<HiddenPlace>,
    /// Cells in them, and of these those of each kind.
    pub cells: u64,
    pub lost: u64,
    pub filled: u64,
    pub gone: u64,
    /// Cells that are drawn by coarser voxels than the finest, and show something there or at full resolution.
    pub of: u64,
}

impl Hidden {
    pub(super) fn add(&mut self, place: HiddenPlace) {
        self.cells += 1;
        let How { lost, filled, gone } = place.how;
        for (count, is) in [(&mut self.lost, lost), (&mut self.filled, filled), (&mut self.gone, gone)] {
            *count += u64::from(is);
        }
        let is_next = |last: &&mut HiddenPlace| {
            let ([a, b], [c, d]) = ([last.voxels.lo, last.voxels.hi], [place.voxels.lo, place.voxels.hi]);
            let is_row = b.x == c.x && (a.y, a.z, b.y, b.z) == (c.y, c.z, d.y, d.z);
            is_row && (last.level, last.how) == (place.level, place.how)
        };
        match self.places.last_mut().filter(is_next) {
            Some(last) => last.voxels.hi.x = place.voxels.hi.x,
            None => self.places.push(place),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;

    #[test]
    fn cells_in_a_row_are_one_place() {
        let place = |x: u32, y: u32, filled| HiddenPlace {
            level: 1,
            voxels: OwnedBox { lo: UVec3::new(x, y, 0), hi: UVec3::new(x + 4, y + 4, 4) },
            how: How { lost: true, filled, gone: false },
        };
        let mut hidden = Hidden::default();
        for (x, y, filled) in [(0, 0, false), (4, 0, false), (12, 0, false), (16, 0, true), (20, 4, true)] {
            hidden.add(place(x, y, filled));
        }
        let ends: Vec<_> = hidden.places.iter().map(|p| (p.voxels.lo.x, p.voxels.hi.x)).collect();
        assert_eq!(ends, [(0, 8), (12, 16), (16, 20), (20, 24)]);
        assert_eq!((hidden.cells, hidden.lost, hidden.filled, hidden.gone), (5, 5, 2, 0));
    }
}

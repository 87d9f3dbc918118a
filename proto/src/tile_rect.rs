//! Tiles of the picture and rectangles of them.

use brickcast_volume::{PictureSize, PixelRect};
use glam::UVec2;

/// Pixels per tile edge.
pub const TILE: u32 = 64;

/// The most tiles that a picture can have, for pictures within [`brickcast_volume::visibility::MAX_PIXELS`] and
/// [`brickcast_volume::visibility::MAX_SIDE`] (the worst is 4097 x 16380: 65 x 256).
pub const MAX_TILES: u32 = 1 << 15;

/// Tiles `[lo, hi)` in units of [`TILE`] pixels; tile (0, 0) is top left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct TileRect {
    pub lo: [u32; 2],
    pub hi: [u32; 2],
}

impl TileRect {
    /// All tiles of a picture; those at the right and the bottom may be clipped.
    #[must_use]
    pub fn of_picture(size: PictureSize) -> Self {
        Self { lo: [0, 0], hi: [size.width().div_ceil(TILE), size.height().div_ceil(TILE)] }
    }

    /// The tiles that touch `pixels`; empty where it is empty.
    #[must_use]
    pub fn around(pixels: &PixelRect) -> Self {
        if pixels.is_empty() {
            return Self { lo: [0, 0], hi: [0, 0] };
        }
        let (lo, hi) = (pixels.lo / TILE, pixels.hi.map(|v| v.div_ceil(TILE)));
        Self { lo: lo.into(), hi: hi.into() }
    }

    /// Tiles per axis.
    #[must_use]
    pub fn dims(&self) -> [u32; 2] {
        [self.hi[0].saturating_sub(self.lo[0]), self.hi[1].saturating_sub(self.lo[1])]
    }

    /// Number of tiles.
    #[must_use]
    pub fn count(&self) -> u32 {
        let [x, y] = self.dims();
        x.saturating_mul(y)
    }

    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count() == 0
    }

    /// True where both have a tile in common.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        !self.is_empty() && !other.is_empty() && (0..2).all(|a| self.lo[a] < other.hi[a] && other.lo[a] < self.hi[a])
    }

    /// True where all tiles of `other` are this rectangle's too.
    #[must_use]
    pub fn covers(&self, other: &Self) -> bool {
        (0..2).all(|a| self.lo[a] <= other.lo[a] && other.hi[a] <= self.hi[a])
    }

    /// What is left of this rectangle without the tiles of `hole`, as rectangles: none twice.
    #[must_use]
    pub fn without(&self, hole: &Self) -> Vec<Self> {
        if !self.meets(hole) {
            return vec![*self];
        }
        let inner = |a: usize| (self.lo[a].max(hole.lo[a]), self.hi[a].min(hole.hi[a]));
        let ((left, right), (top, bottom)) = (inner(0), inner(1));
        let [x0, y0, x1, y1] = [self.lo[0], self.lo[1], self.hi[0], self.hi[1]];
        let around = [
            Self { lo: [x0, y0], hi: [x1, top] },
            Self { lo: [x0, top], hi: [left, bottom] },
            Self { lo: [right, top], hi: [x1, bottom] },
            Self { lo: [x0, bottom], hi: [x1, y1] },
        ];
        around.into_iter().filter(|r| !r.is_empty()).collect()
    }

    /// The rectangle of both, where they are disjoint and make one.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Option<Self> {
        let meet = |along: usize| {
            let across = 1 - along;
            let same = self.lo[across] == other.lo[across] && self.hi[across] == other.hi[across];
            same && (self.hi[along] == other.lo[along] || other.hi[along] == self.lo[along])
        };
        (meet(0) || meet(1)).then(|| Self {
            lo: [self.lo[0].min(other.lo[0]), self.lo[1].min(other.lo[1])],
            hi: [self.hi[0].max(other.hi[0]), self.hi[1].max(other.hi[1])],
        })
    }

    /// The axis along which it can be cut into the most strips: 0 x, 1 y.
    fn longer(&self) -> usize {
        usize::from(self.dims()[1] >= self.dims()[0])
    }

    /// How many strips of tiles it has along its longer side.
    #[must_use]
    pub fn strip_count(&self) -> u32 {
        self.dims()[self.longer()]
    }

    /// The strips `[from, to)` of it, as far as it has them.
    #[must_use]
    pub fn strips(&self, [from, to]: [u32; 2]) -> Self {
        let (mut part, along) = (*self, self.longer());
        part.lo[along] = self.lo[along].saturating_add(from).min(self.hi[along]);
        part.hi[along] = self.lo[along].saturating_add(to).min(self.hi[along]);
        part
    }

    #[must_use]
    pub fn contains(&self, tile: [u32; 2]) -> bool {
        (0..2).all(|a| tile[a] >= self.lo[a] && tile[a] < self.hi[a])
    }

    /// Position of `tile` in tables over this rectangle, row-major; `None` outside.
    #[must_use]
    pub fn linear(&self, tile: [u32; 2]) -> Option<u32> {
        self.contains(tile).then(|| (tile[0] - self.lo[0]) + (tile[1] - self.lo[1]) * self.dims()[0])
    }

    /// The tile at a position of such a table; `None` beyond its end.
    #[must_use]
    pub fn tile_at(&self, linear: u32) -> Option<[u32; 2]> {
        let width = self.dims()[0];
        (linear < self.count()).then(|| [self.lo[0] + linear % width, self.lo[1] + linear / width])
    }

    /// All tiles, row-major.
    pub fn tiles(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let rect = *self;
        (rect.lo[1]..rect.hi[1]).flat_map(move |y| (rect.lo[0]..rect.hi[0]).map(move |x| [x, y]))
    }

    /// The pixels of this rectangle's tiles, clipped to the picture.
    #[must_use]
    pub fn pixels(&self, size: PictureSize) -> PixelRect {
        let rect = PixelRect {
            lo: UVec2::from(self.lo).map(|v| v.saturating_mul(TILE)),
            hi: UVec2::from(self.hi).map(|v| v.saturating_mul(TILE)),
        };
        rect.intersect(&size.full_rect())
    }

    /// The pixels of one tile, clipped to the picture.
    #[must_use]
    pub fn tile_pixels(tile: [u32; 2], size: PictureSize) -> PixelRect {
        Self { lo: tile, hi: tile.map(|v| v.saturating_add(1)) }.pixels(size)
    }

    /// True where every tile is one of the picture's.
    #[must_use]
    pub fn fits(&self, size: PictureSize) -> bool {
        let all = Self::of_picture(size);
        (0..2).all(|a| self.hi[a] <= all.hi[a])
    }

    /// This rectangle cut into bands of whole tile rows with at most `max_pixels` pixels each (but at least one row).
    pub fn bands(&self, max_pixels: u64) -> impl Iterator<Item = Self> + use<> {
        let rect = *self;
        let row = u64::from(rect.dims()[0].max(1)) * u64::from(TILE * TILE);
        let rows = u32::try_from((max_pixels / row).max(1)).unwrap_or(u32::MAX);
        (rect.lo[1]..rect.hi[1])
            .step_by(rows as usize)
            .map(move |y| Self { lo: [rect.lo[0], y], hi: [rect.hi[0], y.saturating_add(rows).min(rect.hi[1])] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect(x0: u32, y0: u32, x1: u32, y1: u32) -> TileRect {
        TileRect { lo: [x0, y0], hi: [x1, y1] }
    }

    /// Tiles of `rects`, sorted: a tile in two of them stands there twice.
    fn tiles(rects: &[TileRect]) -> Vec<[u32; 2]> {
        let mut tiles: Vec<[u32; 2]> = rects.iter().flat_map(TileRect::tiles).collect();
        tiles.sort_unstable();
        tiles
    }

    #[test]
    fn a_rectangle_without_another_keeps_every_other_tile_once() {
        let whole = rect(2, 1, 7, 6);
        for hole in
            [rect(3, 2, 5, 4), rect(0, 0, 9, 3), rect(4, 0, 5, 9), rect(2, 1, 7, 6), rect(7, 1, 9, 6), rect(6, 5, 9, 9)]
        {
            let rest = whole.without(&hole);
            let want: Vec<[u32; 2]> = {
                let mut want: Vec<[u32; 2]> = whole.tiles().filter(|t| !hole.contains(*t)).collect();
                want.sort_unstable();
                want
            };
            assert_eq!(tiles(&rest), want, "{hole:?}");
            assert_eq!(whole.meets(&hole), want.len() < whole.count() as usize);
        }
        assert_eq!(rect(0, 0, 2, 2).joined(&rect(2, 0, 3, 2)), Some(rect(0, 0, 3, 2)));
        assert_eq!(rect(0, 2, 2, 4).joined(&rect(0, 0, 2, 2)), Some(rect(0, 0, 2, 4)));
        assert_eq!(rect(0, 0, 2, 2).joined(&rect(2, 1, 3, 2)), None);
        assert_eq!(rect(0, 0, 2, 2).joined(&rect(3, 0, 4, 2)), None);
    }

    #[test]
    fn strips_cover_the_rectangle_once() {
        for whole in [rect(1, 2, 4, 12), rect(1, 2, 14, 4), rect(0, 0, 1, 1), rect(3, 3, 6, 6)] {
            let count = whole.strip_count();
            assert_eq!(count, whole.dims().into_iter().max().unwrap());
            let each: Vec<TileRect> = (0..count).map(|i| whole.strips([i, i + 1])).collect();
            assert_eq!(tiles(&each), tiles(&[whole]));
            let halves = [whole.strips([0, count / 2]), whole.strips([count / 2, count])];
            assert_eq!(tiles(&halves), tiles(&[whole]));
            assert!(whole.strips([count, count + 3]).is_empty() && whole.strips([0, u32::MAX]) == whole);
        }
    }

    #[test]
    fn odd_picture_sizes_are_covered_once() {
        for (w, h) in [(1, 1), (17, 5), (64, 64), (65, 129), (211, 97)] {
            let size = PictureSize::new(w, h).unwrap();
            let all = TileRect::of_picture(size);
            let pixels: usize = all.tiles().map(|t| TileRect::tile_pixels(t, size).pixel_count()).sum();
            assert_eq!(pixels, size.pixel_count());
            assert_eq!(all.pixels(size), size.full_rect());
            assert_eq!(TileRect::around(&size.full_rect()), all);
            for (i, t) in all.tiles().enumerate() {
                assert_eq!((all.linear(t), all.tile_at(i as u32)), (Some(i as u32), Some(t)));
            }
            assert_eq!(all.tile_at(all.count()), None);
        }
    }

    #[test]
    fn no_legal_picture_has_more_tiles_than_the_limit() {
        for width in 1..=16_384_u32 {
            let height = ((1 << 26) / width).min(16_384);
            let size = PictureSize::new(width, height).unwrap();
            assert!(TileRect::of_picture(size).count() <= MAX_TILES, "{width}x{height}");
        }
    }

    #[test]
    fn bands_cover_every_row_once() {
        let rect = TileRect { lo: [3, 2], hi: [8, 31] };
        for max in [0, 5 * 64 * 64, 5 * 64 * 64 * 7 + 1, u64::MAX] {
            let tiles: Vec<_> = rect.bands(max).flat_map(|b| b.tiles()).collect();
            assert_eq!(tiles, rect.tiles().collect::<Vec<_>>(), "{max}");
        }
        assert_eq!(rect.bands(5 * 64 * 64 * 7 + 1).next().map(|b| b.dims()), Some([5, 7]));
    }

    #[test]
    fn absurd_rectangles_do_not_overflow() {
        let rect = TileRect { lo: [u32::MAX - 1, 0], hi: [u32::MAX, u32::MAX] };
        assert!(rect.pixels(PictureSize::new(3, 3).unwrap()).is_empty());
        assert!(!rect.fits(PictureSize::new(3, 3).unwrap()));
        assert_eq!(TileRect { lo: [5, 5], hi: [2, 9] }.count(), 0);
    }
}

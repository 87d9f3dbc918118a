//! Tiles that are not complete are hatched, so that a picture that lacks something can never pass for a finished one;
//! and, where that is asked for, what coarser levels hide is striped the other way.

use std::borrow::Cow;

use brickcast_proto::TileRect;
use brickcast_volume::{PixelRect, Premul};

use crate::picture::Picture;

/// Opaque magenta: no colour map ends in it.
const STRIPE: Premul = Premul { r: 1.0, g: 0.0, b: 1.0, a: 1.0 };
/// Pixels from stripe to stripe along a row; a quarter of them is striped.
const PERIOD: u32 = 16;

/// The picture with diagonal stripes over `tiles` (in units of 64 pixels), on top of what arrived of them.
#[must_use]
pub fn hatched<'a>(picture: &'a Picture, tiles: &[[u32; 2]]) -> Cow<'a, Picture> {
    if tiles.is_empty() {
        return Cow::Borrowed(picture);
    }
    let mut picture = picture.clone();
    let size = picture.size();
    for tile in tiles {
        let rect = TileRect::tile_pixels(*tile, size);
        for y in rect.lo.y..rect.hi.y {
            for x in (rect.lo.x..rect.hi.x).filter(|x| (x + y) % PERIOD < PERIOD / 4) {
                picture.pixels_mut()[y as usize * size.width() as usize + x as usize] = STRIPE;
            }
        }
    }
    Cow::Owned(picture)
}

/// Opaque orange, as no hatched tile is.
const HIDDEN: Premul = Premul { r: 1.0, g: 0.45, b: 0.0, a: 1.0 };
/// Close stripes: what is hidden may be a pixel large.
const HIDDEN_PERIOD: u32 = 4;

/// Stripes each pixel of these once, whatever lies before them.
pub fn striped(picture: &mut Picture, rects: impl Iterator<Item = PixelRect>) {
    let (width, height) = (picture.size().width(), picture.size().height());
    for rect in rects {
        for y in rect.lo.y..rect.hi.y.min(height) {
            for x in (rect.lo.x..rect.hi.x.min(width))
                .filter(|x| (x + HIDDEN_PERIOD * height - y).is_multiple_of(HIDDEN_PERIOD))
            {
                picture.pixels_mut()[(y * width + x) as usize] = HIDDEN;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::PictureSize;

    use super::*;

    #[test]
    fn what_is_hidden_is_striped_and_nothing_else() {
        let size = PictureSize::new(20, 9).unwrap();
        let mut picture = Picture::new(size, vec![Premul::CLEAR; size.pixel_count()]).unwrap();
        let rect = |lo: [u32; 2], hi: [u32; 2]| PixelRect { lo: lo.into(), hi: hi.into() };
        striped(&mut picture, [rect([4, 1], [12, 5]), rect([8, 1], [12, 5]), rect([18, 8], [30, 30])].into_iter());
        let at: Vec<usize> = (0..180).filter(|&i| picture.pixels()[i] == HIDDEN).collect();
        assert_eq!(at.iter().filter(|&&i| i < 160).count(), 8 * 4 / 4);
        assert!(at.iter().all(|i| i % 20 % 4 == i / 20 % 4));
        assert!(at.iter().all(|i| ((4..12).contains(&(i % 20)) && (1..5).contains(&(i / 20))) || *i >= 178), "{at:?}");
    }

    #[test]
    fn missing_tiles_are_striped_and_no_others() {
        let size = PictureSize::new(130, 70).unwrap();
        let picture = Picture::new(size, vec![Premul::CLEAR; size.pixel_count()]).unwrap();
        assert!(matches!(hatched(&picture, &[]), Cow::Borrowed(_)));
        // One whole, one clipped to 2 x 6 pixels.
        let marked = hatched(&picture, &[[1, 0], [2, 1]]);
        let striped = |x: usize, y: usize| marked.pixels()[y * 130 + x] == STRIPE;
        let count = |x0: usize, y0: usize, x1: usize, y1: usize| {
            (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y))).filter(|&(x, y)| striped(x, y)).count()
        };
        assert_eq!(count(64, 0, 128, 64), 64 * 64 / 4);
        assert!(count(128, 64, 130, 70) > 0);
        assert_eq!(count(0, 0, 130, 70), 64 * 64 / 4 + count(128, 64, 130, 70));
    }
}

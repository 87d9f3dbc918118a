//! Tiles that are not complete are hatched, so that a picture that lacks something can never pass for a finished one.

use std::borrow::Cow;

use brickcast_proto::TileRect;
use brickcast_volume::Premul;

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

#[cfg(test)]
mod tests {
    use brickcast_volume::PictureSize;

    use super::*;

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

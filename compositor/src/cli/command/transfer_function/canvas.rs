//! Rectangles and numbers on white.

use brickcast_volume::{PictureSize, Premul};

use crate::picture::{Picture, PictureError};

/// Opaque pixels; what lies outside is not drawn.
pub(super) struct Canvas {
    size: PictureSize,
    pixels: Vec<[f64; 3]>,
}

/// Three columns and five rows, top row first, left column first.
const GLYPHS: [(char, [u8; 5]); 14] = [
    ('0', [0b111, 0b101, 0b101, 0b101, 0b111]),
    ('1', [0b010, 0b110, 0b010, 0b010, 0b111]),
    ('2', [0b111, 0b001, 0b111, 0b100, 0b111]),
    ('3', [0b111, 0b001, 0b111, 0b001, 0b111]),
    ('4', [0b101, 0b101, 0b111, 0b001, 0b001]),
    ('5', [0b111, 0b100, 0b111, 0b001, 0b111]),
    ('6', [0b111, 0b100, 0b111, 0b101, 0b111]),
    ('7', [0b111, 0b001, 0b001, 0b010, 0b010]),
    ('8', [0b111, 0b101, 0b111, 0b101, 0b111]),
    ('9', [0b111, 0b101, 0b111, 0b001, 0b111]),
    ('.', [0b000, 0b000, 0b000, 0b000, 0b010]),
    ('-', [0b000, 0b000, 0b111, 0b000, 0b000]),
    ('+', [0b000, 0b010, 0b111, 0b010, 0b000]),
    ('e', [0b000, 0b111, 0b111, 0b100, 0b111]),
];
/// Pixels of a glyph's dot.
const DOT: usize = 2;
/// From one glyph to the next, pixels.
const ADVANCE: usize = 4 * DOT;

impl Canvas {
    pub(super) fn new(size: PictureSize) -> Self {
        Self { size, pixels: vec![[1.0; 3]; size.pixel_count()] }
    }

    /// A rectangle from (x, y) on, over what is there with `opacity`.
    pub(super) fn fill(&mut self, (x, y): (usize, usize), (w, h): (usize, usize), rgb: [f64; 3], opacity: f64) {
        let (width, height) = (self.size.width() as usize, self.size.height() as usize);
        for row in y.min(height)..(y + h).min(height) {
            for pixel in &mut self.pixels[row * width + x.min(width)..row * width + (x + w).min(width)] {
                for (below, over) in pixel.iter_mut().zip(rgb) {
                    *below += (over - *below) * opacity;
                }
            }
        }
    }

    /// A number, its top left corner at (x, y).
    pub(super) fn number(&mut self, (x, y): (usize, usize), text: &str) {
        for (k, c) in text.chars().enumerate() {
            let Some((_, rows)) = GLYPHS.iter().find(|(known, _)| *known == c) else { continue };
            for (row, bits) in rows.iter().enumerate() {
                for column in (0..3).filter(|column| bits >> (2 - column) & 1 == 1) {
                    self.fill((x + k * ADVANCE + column * DOT, y + row * DOT), (DOT, DOT), [0.2; 3], 1.0);
                }
            }
        }
    }

    /// How wide [`Canvas::number`] draws a text, pixels.
    pub(super) fn width_of(text: &str) -> usize {
        (text.chars().count() * ADVANCE).saturating_sub(DOT)
    }

    /// # Errors
    /// Never: there are as many pixels as the size has.
    pub(super) fn into_picture(self) -> Result<Picture, PictureError> {
        let opaque = |[r, g, b]: [f64; 3]| Premul { r: r as f32, g: g as f32, b: b as f32, a: 1.0 };
        Picture::new(self.size, self.pixels.into_iter().map(opaque).collect())
    }
}

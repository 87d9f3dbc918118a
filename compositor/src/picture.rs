//! A picture in memory, whoever made it and whatever becomes of it.

use brickcast_volume::{PictureSize, Premul};

/// Pixels that are no picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{got} pixels do not fill a picture of {width}x{height}")]
pub struct PictureError {
    pub got: usize,
    pub width: u32,
    pub height: u32,
}

/// A finished picture: premultiplied, row-major, (0, 0) top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    size: PictureSize,
    pixels: Vec<Premul>,
}

impl Picture {
    /// # Errors
    /// Another number of pixels than `size` has.
    pub fn new(size: PictureSize, pixels: Vec<Premul>) -> Result<Self, PictureError> {
        if pixels.len() != size.pixel_count() {
            return Err(PictureError { got: pixels.len(), width: size.width(), height: size.height() });
        }
        Ok(Self { size, pixels })
    }

    #[must_use]
    pub fn size(&self) -> PictureSize {
        self.size
    }

    #[must_use]
    pub fn pixels(&self) -> &[Premul] {
        &self.pixels
    }

    /// To draw over it.
    pub(crate) fn pixels_mut(&mut self) -> &mut [Premul] {
        &mut self.pixels
    }

    #[must_use]
    pub fn into_pixels(self) -> Vec<Premul> {
        self.pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_holds_as_many_pixels_as_its_size() {
        let size = PictureSize::new(3, 2).unwrap();
        let error = Picture::new(size, vec![Premul::CLEAR; 5]).unwrap_err().to_string();
        assert!(error.contains('5') && error.contains("3x2"), "{error}");
    }
}

//! A picture in memory, whoever made it and whatever becomes of it.

use brickcast_volume::scene::PixelSamples;
use brickcast_volume::{PictureSize, Premul};
use rayon::prelude::*;

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

    /// One that shows nothing.
    #[must_use]
    pub fn empty(size: PictureSize) -> Self {
        Self { size, pixels: vec![Premul::default(); size.pixel_count()] }
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

    /// The picture of `size` whose pixels are the means of this one's, which are its rays.
    ///
    /// # Errors
    /// Another number of rays than `samples` for each of its pixels.
    pub(crate) fn averaged(self, size: PictureSize, samples: PixelSamples) -> Result<Self, PictureError> {
        if self.size == size && samples == PixelSamples::One {
            return Ok(self);
        }
        let rays = samples.rays_of(size.width(), size.height());
        if rays.ok() != Some(self.size) {
            return Err(PictureError { got: self.pixels.len(), width: size.width(), height: size.height() });
        }
        let means = means(bytemuck::cast_slice::<_, [f32; 4]>(&self.pixels), size, samples);
        Self::new(size, means.into_iter().map(Premul::from_array).collect())
    }
}

/// Of the rays of a picture of `size`, row-major, the means of its pixels. A pixel's rays are summed in f32 row by row
/// from the top, each from the left, and divided once: the same bits wherever they came from.
pub(crate) fn means<const N: usize>(rays: &[[f32; N]], size: PictureSize, samples: PixelSamples) -> Vec<[f32; N]> {
    let (width, side) = (size.width() as usize, samples.side() as usize);
    let mean = |pixel: usize| {
        let (x, y) = (pixel % width * side, pixel / width * side);
        let mut sum = [0.0; N];
        for row in y..y + side {
            for ray in &rays[row * width * side + x..][..side] {
                sum.iter_mut().zip(ray).for_each(|(sum, value)| *sum += value);
            }
        }
        sum.map(|sum| sum / samples.count() as f32)
    };
    (0..size.pixel_count()).into_par_iter().map(mean).collect()
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

    #[test]
    fn a_pixel_is_the_mean_of_its_own_rays() {
        let size = PictureSize::new(3, 2).unwrap();
        for samples in PixelSamples::ALL {
            let side = samples.side() as usize;
            let rays = samples.rays_of(3, 2).unwrap();
            let ray = |i: usize| {
                let (x, y) = (i % rays.width() as usize, i / rays.width() as usize);
                let (column, row, within) = (x / side, y / side, (x % side + y % side) as f32);
                // Within a pixel the red varies about 10, 20, 30 (and 100 more a row) by the same amount everywhere.
                let red = (10 * (column + 1) + 100 * row) as f32 + within - (side - 1) as f32;
                Premul { r: red, g: 0.25, b: 0.0, a: 1.0 }
            };
            let picture = Picture::new(rays, (0..rays.pixel_count()).map(ray).collect()).unwrap();
            let small = picture.averaged(size, samples).unwrap();
            let reds: Vec<f32> = small.pixels().iter().map(|p| p.r).collect();
            assert_eq!(reds, [10.0, 20.0, 30.0, 110.0, 120.0, 130.0], "{samples:?}");
            assert!(small.pixels().iter().all(|p| (p.g, p.b, p.a) == (0.25, 0.0, 1.0)), "{samples:?}");
        }
        let other = Picture::new(size, vec![Premul::CLEAR; 6]).unwrap();
        assert!(other.averaged(size, PixelSamples::Four).is_err());
    }
}

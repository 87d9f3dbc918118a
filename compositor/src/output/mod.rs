//! Pictures to files: PNG, animated PNG, OpenEXR, and the manifest beside them.
//!
//! Every file is finished or absent: it is written under a temporary name in its own folder and renamed when complete.

pub mod animation;
mod atomic;
mod error;
pub mod exr;
mod hatch;
pub mod manifest;
pub mod png;
mod writer;

use std::path::Path;

use brickcast_volume::{PictureSize, Premul};

pub use error::OutputError;
pub use hatch::hatched;
pub use manifest::{write_json, write_manifest, write_text};
pub use writer::{FrameOptions, FrameWriter, MAX_FRAMES};

/// The largest picture that is read back, bytes of its file.
const MAX_FILE_BYTES: u64 = 2 << 30;

/// What a file name's extension stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputFormat {
    /// 8-bit straight RGBA, or opaque RGB over a background.
    Png,
    /// An animation of such pictures.
    Apng,
    /// 32-bit float premultiplied RGBA.
    Exr,
}

impl OutputFormat {
    /// # Errors
    /// No extension or another one than png, apng, exr (in any case).
    pub fn from_path(path: &Path) -> Result<Self, OutputError> {
        match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
            Some("png") => Ok(Self::Png),
            Some("apng") => Ok(Self::Apng),
            Some("exr") => Ok(Self::Exr),
            _ => Err(OutputError::Extension { path: path.to_owned() }),
        }
    }

    /// False where a background has no effect: EXR keeps its alpha.
    #[must_use]
    pub fn uses_background(self) -> bool {
        self != Self::Exr
    }
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
    pub fn new(size: PictureSize, pixels: Vec<Premul>) -> Result<Self, OutputError> {
        if pixels.len() != size.pixel_count() {
            return Err(OutputError::PixelCount { got: pixels.len(), width: size.width(), height: size.height() });
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

    #[must_use]
    pub fn into_pixels(self) -> Vec<Premul> {
        self.pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_choose_the_format_and_others_are_refused_by_name() {
        for (name, want) in
            [("a.png", OutputFormat::Png), ("b/C.PNG", OutputFormat::Png), ("x.y.apng", OutputFormat::Apng)]
        {
            assert_eq!(OutputFormat::from_path(Path::new(name)).unwrap(), want);
        }
        assert_eq!(OutputFormat::from_path(Path::new("a.exr")).unwrap(), OutputFormat::Exr);
        for name in ["a", "a.jpg", ".png", "dir.png/"] {
            if let Err(error) = OutputFormat::from_path(Path::new(name)) {
                let text = error.to_string();
                assert!(text.contains(name) && text.contains(".png, .apng or .exr"), "{text}");
            } else {
                assert_eq!(name, "dir.png/");
            }
        }
    }

    #[test]
    fn a_picture_holds_as_many_pixels_as_its_size() {
        let size = PictureSize::new(3, 2).unwrap();
        let error = Picture::new(size, vec![Premul::CLEAR; 5]).unwrap_err().to_string();
        assert!(error.contains('5') && error.contains("3x2"), "{error}");
    }
}

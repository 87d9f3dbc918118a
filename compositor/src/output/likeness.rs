//! Is a picture the one in a file? What was drawn again is compared with what is there.

use std::path::{Path, PathBuf};

use brickcast_volume::{PictureSize, Premul};

use super::error::OutputError;
use super::format::OutputFormat;
use super::png::{Decoded, opaque, straight};
use super::{exr, png};
use crate::picture::Picture;

/// What pictures of one scene may differ by that was not asked for exactly, premultiplied in 0..=1.
const INEXACT: f32 = 1.0 / 255.0;

/// A picture's file, or an animation's, read back.
#[derive(Debug)]
pub struct DrawnFile {
    pub path: PathBuf,
    kept: Kept,
}

#[derive(Debug)]
enum Kept {
    Bytes(Decoded),
    Floats(Picture),
}

/// How far two pictures differ; channels r, g, b, a, premultiplied in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    pub largest: [f32; 4],
    /// Pixels with another bit anywhere.
    pub pixels: usize,
    pub of_pixels: usize,
    /// What channels may differ by; 0 where the bits must be the same.
    pub allowed: f32,
}

impl Difference {
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.pixels == 0
    }

    /// NaN is over every limit.
    #[must_use]
    pub fn is_allowed(&self) -> bool {
        self.is_none() || (self.allowed > 0.0 && self.largest.iter().all(|d| *d <= self.allowed))
    }

    /// For people.
    #[must_use]
    pub fn in_words(&self) -> String {
        if self.is_none() {
            return "the same bits".to_owned();
        }
        let [r, g, b, a] = self.largest;
        let allowed = match self.allowed {
            0.0 => "an exact picture may not differ at all".to_owned(),
            allowed => format!("up to {allowed:.4} may be"),
        };
        format!(
            "{} of {} pixels differ, by at most {r:.4} in red, {g:.4} in green, {b:.4} in blue, {a:.4} in alpha of 1; \
             {allowed}",
            self.pixels, self.of_pixels
        )
    }
}

impl DrawnFile {
    /// # Errors
    /// No such file, another format than the name says, a picture over the limits.
    pub fn read(path: &Path) -> Result<Self, OutputError> {
        let kept = match OutputFormat::from_path(path)? {
            OutputFormat::Png | OutputFormat::Apng => Kept::Bytes(png::read(path)?),
            OutputFormat::Exr => Kept::Floats(exr::read(path)?),
            OutputFormat::Gif | OutputFormat::Mp4 | OutputFormat::Webm => {
                return Err(OutputError::NotCompared { path: path.to_owned() });
            }
        };
        Ok(Self { path: path.to_owned(), kept })
    }

    #[must_use]
    pub fn frames(&self) -> usize {
        match &self.kept {
            Kept::Bytes(decoded) => decoded.frames.len(),
            Kept::Floats(_) => 1,
        }
    }

    #[must_use]
    pub fn size(&self) -> PictureSize {
        match &self.kept {
            Kept::Bytes(decoded) => decoded.size,
            Kept::Floats(picture) => picture.size(),
        }
    }

    /// True where the file's pixels lie on a background.
    #[must_use]
    pub fn is_opaque(&self) -> bool {
        matches!(&self.kept, Kept::Bytes(decoded) if !decoded.has_alpha)
    }

    /// Compares a frame with `picture` as this file would hold it; `background` counts where the file is opaque.
    /// Nothing where there is no such frame, or one of another size.
    #[must_use]
    pub fn difference(
        &self,
        frame: usize,
        picture: &Picture,
        background: Option<[f32; 3]>,
        is_exact: bool,
    ) -> Option<Difference> {
        if picture.size() != self.size() {
            return None;
        }
        let (drawn, allowed) = (picture.pixels(), if is_exact { 0.0 } else { INEXACT });
        match &self.kept {
            Kept::Floats(kept) if frame == 0 => {
                let pairs = kept.pixels().iter().zip(drawn).map(|(a, b)| (a.to_array(), b.to_array()));
                Some(compared(pairs.map(|(a, b)| (a.map(f32::to_bits) != b.map(f32::to_bits), a, b)), allowed))
            }
            Kept::Floats(_) => None,
            Kept::Bytes(decoded) => {
                let stored = |p: Premul| match background.filter(|_| !decoded.has_alpha) {
                    None => straight(p),
                    Some(background) => {
                        let [r, g, b] = opaque(p, background);
                        [r, g, b, 255]
                    }
                };
                let pairs = decoded.frames.get(frame)?.iter().zip(drawn).map(|(&a, &b)| (a, stored(b)));
                let pairs = pairs.map(|(a, b)| (a != b, premultiplied(a), premultiplied(b)));
                // Either picture was rounded to 8 bits: its colour by half a step, and its alpha by another.
                let roundings = if decoded.has_alpha { 2.0 } else { 1.0 };
                Some(compared(pairs, if is_exact { 0.0 } else { allowed + roundings / 255.0 }))
            }
        }
    }
}

/// Eight bits of straight colour as premultiplied ones in 0..=1.
fn premultiplied([r, g, b, a]: [u8; 4]) -> [f32; 4] {
    let a = f32::from(a) / 255.0;
    [f32::from(r) / 255.0 * a, f32::from(g) / 255.0 * a, f32::from(b) / 255.0 * a, a]
}

fn compared(pairs: impl Iterator<Item = (bool, [f32; 4], [f32; 4])>, allowed: f32) -> Difference {
    let mut difference = Difference { largest: [0.0; 4], pixels: 0, of_pixels: 0, allowed };
    for (differs, a, b) in pairs {
        difference.of_pixels += 1;
        if !differs {
            continue;
        }
        difference.pixels += 1;
        for (largest, (a, b)) in difference.largest.iter_mut().zip(a.into_iter().zip(b)) {
            let d = (a - b).abs();
            // Once there, NaN stays.
            if d > *largest || d.is_nan() {
                *largest = d;
            }
        }
    }
    difference
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(values: &[f32]) -> Picture {
        let pixels = values.iter().map(|&v| Premul { r: v, g: v * 0.5, b: 0.0, a: 1.0 }).collect();
        Picture::new(PictureSize::new(values.len() as u32, 1).unwrap(), pixels).unwrap()
    }

    #[test]
    fn the_same_is_told_from_the_nearly_same_and_from_another() {
        let folder = tempfile::tempdir().unwrap();
        let drawn = picture(&[0.25, 0.5, 0.75]);
        for name in ["a.png", "a.exr"] {
            let path = folder.path().join(name);
            match OutputFormat::from_path(&path).unwrap() {
                OutputFormat::Exr => exr::write(&path, &drawn).unwrap(),
                _ => png::write(&path, &drawn, None).unwrap(),
            };
            let file = DrawnFile::read(&path).unwrap();
            assert_eq!((file.frames(), file.is_opaque()), (1, false));
            let against = |values: &[f32], exact| file.difference(0, &picture(values), None, exact).unwrap();
            assert_eq!(against(&[0.25, 0.5, 0.75], true).in_words(), "the same bits");
            let near = against(&[0.25, 0.5, 0.753], false);
            assert!(near.pixels == 1 && near.is_allowed() && !near.is_none(), "{name}: {near:?}");
            assert!(!against(&[0.25, 0.5, 0.753], true).is_allowed(), "{name}");
            let far = against(&[0.25, 0.9, 0.75], false);
            assert!(!far.is_allowed() && (far.largest[0] - 0.4).abs() < 0.005, "{name}: {far:?}");
            assert!(
                far.in_words().contains("1 of 3 pixels differ") && far.in_words().contains("in red"),
                "{}",
                far.in_words()
            );
            assert!(file.difference(0, &picture(&[0.25, 0.5]), None, true).is_none());
            assert!(file.difference(1, &drawn, None, true).is_none());
        }
    }

    #[test]
    fn no_number_is_no_small_difference() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        exr::write(&path, &picture(&[f32::NAN, 0.5])).unwrap();
        let file = DrawnFile::read(&path).unwrap();
        assert!(!file.difference(0, &picture(&[0.1, 0.5]), None, false).unwrap().is_allowed());
    }

    #[test]
    fn opaque_files_are_compared_over_their_background() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let clear = Picture::new(PictureSize::new(2, 1).unwrap(), vec![Premul::CLEAR; 2]).unwrap();
        png::write(&path, &clear, Some([0.2, 0.4, 0.6])).unwrap();
        let file = DrawnFile::read(&path).unwrap();
        assert!(file.is_opaque());
        assert!(file.difference(0, &clear, Some([0.2, 0.4, 0.6]), true).unwrap().is_none());
        assert!(!file.difference(0, &clear, Some([0.9, 0.4, 0.6]), false).unwrap().is_allowed());
    }
}

//! Sequences: an animated PNG, written frame by frame, and names for numbered files.

use std::io::Write;
use std::path::{Path, PathBuf};

use brickcast_volume::PictureSize;

use super::error::OutputError;
use super::png;
use super::reel::Reel;
use crate::picture::Picture;

/// An animated PNG in the making; it loops for ever. Dropped before [`ApngWriter::finish`], it leaves nothing behind.
pub struct ApngWriter {
    stream: png::Stream,
    cutter: ApngCutter,
    path: PathBuf,
    pushed: u32,
}

/// Ends an animation in the making with the frames that it has.
#[derive(Debug, Clone)]
pub(super) struct ApngCutter {
    reel: Reel,
    shape: Shape,
}

/// What an animation's header says.
#[derive(Debug, Clone, Copy)]
struct Shape {
    size: PictureSize,
    background: Option<[f32; 3]>,
    frames: u32,
    /// Seconds a frame.
    delay: (u16, u16),
}

impl std::fmt::Debug for ApngWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ApngWriter").field("path", &self.path).field("pushed", &self.pushed).finish_non_exhaustive()
    }
}

impl ApngWriter {
    /// Starts an animation of exactly `frames` frames, `fps` a second (see [`frame_delay`]).
    ///
    /// # Errors
    /// No frames, an impossible rate, a missing folder, a full disk.
    pub fn create(
        path: &Path,
        size: PictureSize,
        frames: u32,
        fps: f64,
        background: Option<[f32; 3]>,
    ) -> Result<Self, OutputError> {
        let shape = Shape { size, background, frames, delay: frame_delay(fps)? };
        let reel = Reel::create(path)?;
        let stream = shape.stream(reel.clone()).map_err(|e| png::encoding(path, e))?;
        Ok(Self { stream, cutter: ApngCutter { reel, shape }, path: path.to_owned(), pushed: 0 })
    }

    pub(super) fn cutter(&self) -> ApngCutter {
        self.cutter.clone()
    }

    /// # Errors
    /// A frame of another size, or one too many; a full disk.
    pub fn push(&mut self, picture: &Picture) -> Result<(), OutputError> {
        let Shape { size, background, frames, .. } = self.cutter.shape;
        if self.pushed == frames {
            return Err(OutputError::FrameCount { path: self.path.clone(), want: frames, got: self.pushed + 1 });
        }
        check_size(&self.path, size, picture)?;
        let bytes = png::bytes(picture.pixels(), background);
        self.stream.write_image_data(&bytes).map_err(|e| png::encoding(&self.path, e))?;
        self.pushed += 1;
        self.cutter.reel.frame_is_whole();
        Ok(())
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// Fewer frames than announced, a full disk.
    pub fn finish(self) -> Result<PathBuf, OutputError> {
        let Self { stream, cutter, path, pushed } = self;
        let want = cutter.shape.frames;
        if pushed != want {
            return Err(OutputError::FrameCount { path, want, got: pushed });
        }
        stream.finish().map_err(|e| png::encoding(&path, e))?;
        cutter.reel.finish()?;
        Ok(path)
    }
}

impl Shape {
    fn stream<W: Write>(&self, out: W) -> Result<::png::Writer<W>, ::png::EncodingError> {
        let mut encoder = png::encoder(out, self.size, self.background);
        encoder.set_animated(self.frames, 0)?;
        encoder.set_frame_delay(self.delay.0, self.delay.1)?;
        encoder.set_blend_op(::png::BlendOp::Source)?;
        encoder.set_dispose_op(::png::DisposeOp::None)?;
        encoder.validate_sequence(true);
        encoder.write_header()
    }

    /// The bytes that an animation of this shape begins with, and those that it ends with.
    fn head_and_end(&self) -> Result<(Vec<u8>, Vec<u8>), ::png::EncodingError> {
        /// Length, name and checksum of the chunk that ends a PNG.
        const END_BYTES: usize = 12;
        let mut bytes = Vec::new();
        // Dropped without a frame, it writes nothing but its end.
        drop(self.stream(&mut bytes)?);
        let end = bytes.split_off(bytes.len().saturating_sub(END_BYTES));
        Ok((bytes, end))
    }
}

impl ApngCutter {
    /// As [`Cutter::cut`](super::cutter::Cutter::cut).
    pub(super) fn cut(&self, park: bool) -> Result<Option<(PathBuf, u32)>, OutputError> {
        let head_and_end = |frames| {
            let shape = Shape { frames, ..self.shape };
            shape.head_and_end().map_err(|e| png::encoding(Path::new("animation"), e))
        };
        self.reel.cut(park, head_and_end)
    }
}

pub(super) fn check_size(path: &Path, want: PictureSize, picture: &Picture) -> Result<(), OutputError> {
    let got = picture.size();
    if got == want {
        return Ok(());
    }
    Err(OutputError::FrameSize {
        path: path.to_owned(),
        got_width: got.width(),
        got_height: got.height(),
        width: want.width(),
        height: want.height(),
    })
}

/// Seconds a frame as a fraction of 16-bit numbers: 1/fps for whole rates, else to the millisecond.
///
/// # Errors
/// A rate outside 0.1..=240.
pub fn frame_delay(fps: f64) -> Result<(u16, u16), OutputError> {
    if !(0.1..=240.0).contains(&fps) {
        return Err(OutputError::FramesPerSecond(fps));
    }
    if fps.fract() == 0.0 { Ok((1, fps as u16)) } else { Ok(((1000.0 / fps).round() as u16, 1000)) }
}

/// `x_0000.png` for frame 0 of `x.png`; more digits where `frames` needs them.
#[must_use]
pub fn numbered(path: &Path, frame: u32, frames: u32) -> PathBuf {
    let digits = frames.saturating_sub(1).to_string().len().max(4);
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}_{frame:0digits$}{extension}"))
}

#[cfg(test)]
mod tests {
    use brickcast_volume::Premul;

    use super::*;

    fn frame(size: PictureSize, v: f32) -> Picture {
        Picture::new(size, vec![Premul { r: v, g: 0.0, b: 0.0, a: 1.0 }; size.pixel_count()]).unwrap()
    }

    #[test]
    fn frames_come_back_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let size = PictureSize::new(7, 3).unwrap();
        for (frames, background) in [(1, None), (5, None), (3, Some([0.0; 3]))] {
            let path = folder.path().join("a.apng");
            let mut writer = ApngWriter::create(&path, size, frames, 12.5, background).unwrap();
            for i in 0..frames {
                writer.push(&frame(size, i as f32 / 10.0)).unwrap();
            }
            assert!(writer.push(&frame(size, 0.0)).is_err());
            assert_eq!(writer.finish().unwrap(), path);
            let back = png::read(&path).unwrap();
            let reds: Vec<_> = back.frames.iter().map(|f| f[20]).collect();
            let want: Vec<_> = (0..frames).map(|i| [(i as f32 * 25.5).round() as u8, 0, 0, 255]).collect();
            assert_eq!(reds, want);
            std::fs::remove_file(&path).unwrap();
        }
    }

    #[test]
    fn an_unfinished_animation_is_absent() {
        let folder = tempfile::tempdir().unwrap();
        let size = PictureSize::new(2, 2).unwrap();
        let path = folder.path().join("a.apng");
        let mut writer = ApngWriter::create(&path, size, 3, 10.0, None).unwrap();
        writer.push(&frame(size, 0.5)).unwrap();
        assert!(writer.push(&frame(PictureSize::new(2, 3).unwrap(), 0.5)).unwrap_err().to_string().contains("2x3"));
        let error = writer.finish().unwrap_err().to_string();
        assert!(error.contains("3 frames and got 1"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// Also in the middle of a frame, and by another thread than the one that makes it.
    #[test]
    fn an_animation_that_is_cut_plays_the_frames_that_it_has() {
        let folder = tempfile::tempdir().unwrap();
        let size = PictureSize::new(70, 40).unwrap();
        let path = folder.path().join("a.apng");
        for (pushed, old) in [(1, None), (3, None), (3, Some("old")), (5, None)] {
            if let Some(old) = old {
                std::fs::write(&path, old).unwrap();
            }
            let mut writer = ApngWriter::create(&path, size, 5, 10.0, None).unwrap();
            let cutter = writer.cutter();
            assert!(cutter.cut(false).unwrap().is_none(), "no frames, no animation");
            for i in 0..pushed {
                writer.push(&frame(size, i as f32 / 10.0)).unwrap();
            }
            writer.cutter.reel.write_all(b"the beginning of a frame").unwrap();
            let cut = std::thread::spawn(move || cutter.cut(false).unwrap()).join().unwrap();
            let (place, frames) = cut.unwrap();
            drop(writer);
            assert_eq!(frames, pushed);
            assert_eq!(place, folder.path().join(if old.is_some() { "a.partial.apng" } else { "a.apng" }));
            let back = png::read(&place).unwrap();
            let reds: Vec<_> = back.frames.iter().map(|f| f[20][0]).collect();
            assert_eq!(reds, (0..pushed).map(|i| (i as f32 * 25.5).round() as u8).collect::<Vec<_>>());
            if let Some(old) = old {
                assert_eq!(std::fs::read(&path).unwrap(), old.as_bytes());
                std::fs::remove_file(&path).unwrap();
            }
            std::fs::remove_file(&place).unwrap();
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
    }

    #[test]
    fn rates_are_exact_or_to_the_millisecond() {
        assert_eq!(frame_delay(30.0).unwrap(), (1, 30));
        assert_eq!(frame_delay(12.5).unwrap(), (80, 1000));
        assert_eq!(frame_delay(0.1).unwrap(), (10_000, 1000));
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
            assert!(frame_delay(fps).is_err(), "{fps}");
        }
    }

    #[test]
    fn numbers_have_four_digits_and_sort() {
        let name = |path: &str, frame, frames| numbered(Path::new(path), frame, frames).to_string_lossy().into_owned();
        assert_eq!(name("x.png", 0, 10), "x_0000.png");
        assert_eq!(name("dir/a.b.exr", 12, 10_000), "dir/a.b_0012.exr");
        assert_eq!(name("x.png", 7, 10_001), "x_00007.png");
    }
}

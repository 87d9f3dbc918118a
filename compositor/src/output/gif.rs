//! Animated GIFs: opaque frames, each with 256 colours of its own.

use std::path::{Path, PathBuf};

use ::gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};
use brickcast_volume::PictureSize;

use super::animation::{check_size, frame_delay};
use super::error::OutputError;
use super::png::opaque;
use super::reel::Reel;
use crate::picture::Picture;

/// Players take shorter times for a tenth of a second.
const MIN_DELAY: f64 = 2.0;
/// 1 looks at every pixel for the colours of a frame, 30 at few.
const SPEED: i32 = 10;

/// An animated GIF in the making; it loops for ever. Dropped before [`GifWriter::finish`], it leaves nothing behind.
pub(super) struct GifWriter {
    encoder: Encoder<Reel>,
    cutter: GifCutter,
    path: PathBuf,
    size: PictureSize,
    /// Hundredths of a second from frame to frame.
    delay: f64,
    background: [f32; 3],
    pushed: u32,
}

/// Ends a GIF in the making with the frames that it has.
#[derive(Debug, Clone)]
pub(super) struct GifCutter(Reel);

impl GifCutter {
    /// As [`Cutter::cut`](super::cutter::Cutter::cut).
    pub(super) fn cut(&self, park: bool) -> Result<Option<(PathBuf, u32)>, OutputError> {
        /// What ends a GIF; its head does not tell how many frames it has.
        const TRAILER: u8 = 0x3b;
        self.0.cut(park, |_| Ok((Vec::new(), vec![TRAILER])))
    }
}

impl std::fmt::Debug for GifWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GifWriter").field("path", &self.path).field("pushed", &self.pushed).finish_non_exhaustive()
    }
}

impl GifWriter {
    /// # Errors
    /// An impossible rate, a missing folder, a full disk.
    pub(super) fn create(path: &Path, size: PictureSize, fps: f64, background: [f32; 3]) -> Result<Self, OutputError> {
        frame_delay(fps)?;
        let delay = 100.0 / fps;
        if delay < MIN_DELAY {
            return Err(OutputError::GifRate(fps));
        }
        let [width, height] = sides(path, size)?;
        let reel = Reel::create(path)?;
        let mut encoder = Encoder::new(reel.clone(), width, height, &[]).map_err(|e| encoding(path, e))?;
        encoder.set_repeat(Repeat::Infinite).map_err(|e| encoding(path, e))?;
        Ok(Self { encoder, cutter: GifCutter(reel), path: path.to_owned(), size, delay, background, pushed: 0 })
    }

    pub(super) fn cutter(&self) -> GifCutter {
        self.cutter.clone()
    }

    /// # Errors
    /// A frame of another size, a full disk.
    pub(super) fn push(&mut self, picture: &Picture) -> Result<(), OutputError> {
        let path = &self.path;
        check_size(path, self.size, picture)?;
        let [width, height] = sides(path, self.size)?;
        let pixel = |p| {
            let [r, g, b] = opaque(p, self.background);
            [r, g, b, u8::MAX]
        };
        let mut bytes: Vec<u8> = picture.pixels().iter().flat_map(|p| pixel(*p)).collect();
        // Rounded by when the frame begins and ends: the whole keeps to its rate.
        let at = |frame: u32| (f64::from(frame) * self.delay).round();
        let delay = (at(self.pushed + 1) - at(self.pushed)) as u16;
        let frame =
            Frame { delay, dispose: DisposalMethod::Keep, ..Frame::from_rgba_speed(width, height, &mut bytes, SPEED) };
        self.encoder.write_frame(&frame).map_err(|e| encoding(path, e))?;
        self.pushed += 1;
        self.cutter.0.frame_is_whole();
        Ok(())
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// A full disk.
    pub(super) fn finish(self) -> Result<PathBuf, OutputError> {
        let Self { encoder, cutter, path, .. } = self;
        encoder.into_inner().map_err(|e| encoding(&path, e))?;
        cutter.0.finish()?;
        Ok(path)
    }
}

/// Those of a picture fit.
fn sides(path: &Path, size: PictureSize) -> Result<[u16; 2], OutputError> {
    let too_long = |_| OutputError::Encode { path: path.to_owned(), problem: "a side is too long".to_owned() };
    Ok([u16::try_from(size.width()).map_err(too_long)?, u16::try_from(size.height()).map_err(too_long)?])
}

fn encoding(path: &Path, error: EncodingError) -> OutputError {
    match error {
        EncodingError::Io(error) => OutputError::Write { path: path.to_owned(), error },
        other => OutputError::Encode { path: path.to_owned(), problem: other.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::Premul;

    use super::*;

    const WHITE: [f32; 3] = [1.0; 3];

    use std::fs::File;
    use std::io::Write as _;

    /// Frames as they play, RGBA, and their times in hundredths of a second.
    fn read(path: &Path) -> (Vec<Vec<u8>>, Vec<u16>) {
        let mut options = ::gif::DecodeOptions::new();
        options.set_color_output(::gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(File::open(path).unwrap()).unwrap();
        assert_eq!(decoder.repeat(), Repeat::Infinite);
        let (mut frames, mut delays) = (Vec::new(), Vec::new());
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            frames.push(frame.buffer.to_vec());
            delays.push(frame.delay);
        }
        (frames, delays)
    }

    #[test]
    fn frames_come_back_on_their_background_and_at_their_rate() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gif");
        let size = PictureSize::new(7, 3).unwrap();
        let mut writer = GifWriter::create(&path, size, 30.0, WHITE).unwrap();
        for i in 0..6 {
            let pixel = |x: usize| match x % 7 {
                0 => Premul::CLEAR,
                _ => Premul { r: i as f32 / 10.0, g: 0.2, b: 0.0, a: 1.0 },
            };
            writer.push(&Picture::new(size, (0..21).map(pixel).collect()).unwrap()).unwrap();
        }
        let other = PictureSize::new(3, 7).unwrap();
        assert!(writer.push(&Picture::new(other, vec![Premul::CLEAR; 21]).unwrap()).is_err());
        assert!(!path.exists());
        assert_eq!(writer.finish().unwrap(), path);
        let (frames, delays) = read(&path);
        assert_eq!(delays, [3, 4, 3, 3, 4, 3], "30 a second");
        for (i, frame) in frames.iter().enumerate() {
            assert_eq!(frame[..4], [255; 4]);
            assert_eq!(frame[4..8], [(i as f32 * 25.5).round() as u8, 51, 0, 255]);
        }
    }

    /// More colours than a frame can have: the nearest of those that it has.
    #[test]
    fn many_colours_become_near_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gif");
        let size = PictureSize::new(64, 64).unwrap();
        let pixel = |i: usize| Premul { r: (i % 64) as f32 / 63.0, g: (i / 64) as f32 / 63.0, b: 0.5, a: 1.0 };
        let picture = Picture::new(size, (0..64 * 64).map(pixel).collect()).unwrap();
        let mut writer = GifWriter::create(&path, size, 10.0, WHITE).unwrap();
        writer.push(&picture).unwrap();
        writer.finish().unwrap();
        let (frames, _) = read(&path);
        let want = picture.pixels().iter().flat_map(|p| opaque(*p, WHITE));
        let got = frames[0].chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
        let worst = got.zip(want).map(|(a, b)| a.abs_diff(b)).max().unwrap();
        assert!(worst < 64, "{worst}");
    }

    /// In the middle of a frame, too.
    #[test]
    fn one_that_is_cut_plays_the_frames_that_it_has() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gif");
        let size = PictureSize::new(5, 4).unwrap();
        for (pushed, name) in [(2_u8, "a.gif"), (3, "a.partial.gif")] {
            let mut writer = GifWriter::create(&path, size, 10.0, WHITE).unwrap();
            let cutter = writer.cutter();
            assert!(cutter.cut(false).unwrap().is_none(), "no frames, no animation");
            for i in 0..pushed {
                let pixel = Premul { r: f32::from(i) / 10.0, g: 0.0, b: 0.0, a: 1.0 };
                writer.push(&Picture::new(size, vec![pixel; 20]).unwrap()).unwrap();
            }
            writer.cutter.0.write_all(b"the beginning of a frame").unwrap();
            let cut = std::thread::spawn(move || cutter.cut(false).unwrap()).join().unwrap();
            drop(writer);
            assert_eq!(cut, Some((folder.path().join(name), u32::from(pushed))));
            let (frames, _) = read(&folder.path().join(name));
            let reds: Vec<u8> = frames.iter().map(|frame| frame[0]).collect();
            assert_eq!(reds, (0..pushed).map(|i| (f32::from(i) * 25.5).round() as u8).collect::<Vec<_>>());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn an_unfinished_one_is_absent_and_impossible_rates_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gif");
        let size = PictureSize::new(2, 2).unwrap();
        let mut writer = GifWriter::create(&path, size, 50.0, WHITE).unwrap();
        writer.push(&Picture::new(size, vec![Premul::CLEAR; 4]).unwrap()).unwrap();
        drop(writer);
        for (fps, words) in [(0.0, "0.1 and 240"), (60.0, "at most 50")] {
            let error = GifWriter::create(&path, size, fps, WHITE).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

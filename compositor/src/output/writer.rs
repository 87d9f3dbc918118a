//! One door for all formats: open, push every frame, finish.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use brickcast_volume::PictureSize;
use brickcast_volume::store::remove_leftovers;

use super::animation::{ApngWriter, check_size, numbered};
use super::atomic::{check_target, folder_of};
use super::cutter::Cutter;
use super::error::OutputError;
use super::film::{Container, FilmWriter};
use super::format::OutputFormat;
use super::gif::GifWriter;
use super::limits::MAX_FRAMES;
use super::{exr, png};
use crate::picture::Picture;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameOptions {
    /// How many frames will be pushed, 1..=[`MAX_FRAMES`].
    pub frames: u32,
    /// Of an animation; 0.1..=240.
    pub fps: f64,
    /// Display-referred RGB in 0..=1 behind the frames ([`OutputFormat::background`]).
    pub background: Option<[f32; 3]>,
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self { frames: 1, fps: 24.0, background: None }
    }
}

/// Ends a sequence early with the frames that are done; any number of them, from any thread.
#[derive(Debug, Clone)]
pub struct Keeper {
    animation: Option<Cutter>,
    /// Of numbered files.
    path: PathBuf,
    /// How many there are to be.
    frames: u32,
    done: Arc<AtomicU32>,
}

/// The part of a sequence that was kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kept {
    /// Of the animation, or of the first numbered file.
    pub path: PathBuf,
    pub is_animation: bool,
    pub frames: u32,
    /// How many were to be.
    pub of: u32,
}

impl Keeper {
    /// What was kept; nothing of a single picture, where no frame is done, and where all are. An animation is given its
    /// name, or `x.partial.apng` where a file has that. With `park`, whoever still writes it waits from now on for the
    /// end of the process.
    ///
    /// # Errors
    /// A full disk.
    pub fn keep(&self, park: bool) -> Result<Option<Kept>, OutputError> {
        if let Some(animation) = &self.animation {
            let cut = animation.cut(park)?;
            return Ok(cut.map(|(path, frames)| Kept { path, is_animation: true, frames, of: self.frames }));
        }
        let (frames, of) = (self.done.load(Ordering::Acquire), self.frames);
        let some = (1..of).contains(&frames);
        Ok(some.then(|| Kept { path: numbered(&self.path, 0, of), is_animation: false, frames, of }))
    }
}

/// All frames in one file.
#[derive(Debug)]
enum Animation {
    Apng(ApngWriter),
    Gif(GifWriter),
    Film(FilmWriter),
}

impl Animation {
    /// None where frames are files of their own.
    fn open(
        format: OutputFormat,
        path: &Path,
        size: PictureSize,
        o: FrameOptions,
    ) -> Result<Option<Self>, OutputError> {
        let opaque = format.background(o.background).unwrap_or_default();
        let film = |container| Ok(Some(Self::Film(FilmWriter::create(path, container, size, o.fps, opaque)?)));
        match format {
            OutputFormat::Png | OutputFormat::Exr => Ok(None),
            OutputFormat::Apng => Ok(Some(Self::Apng(ApngWriter::create(path, size, o.frames, o.fps, o.background)?))),
            OutputFormat::Gif => Ok(Some(Self::Gif(GifWriter::create(path, size, o.fps, opaque)?))),
            OutputFormat::Mp4 => film(Container::Mp4),
            OutputFormat::Webm => film(Container::Webm),
        }
    }

    fn cutter(&self) -> Cutter {
        match self {
            Self::Apng(writer) => Cutter::Apng(writer.cutter()),
            Self::Gif(writer) => Cutter::Gif(writer.cutter()),
            Self::Film(writer) => Cutter::Film(writer.cutter()),
        }
    }

    fn push(&mut self, picture: &Picture) -> Result<(), OutputError> {
        match self {
            Self::Apng(writer) => writer.push(picture),
            Self::Gif(writer) => writer.push(picture),
            Self::Film(writer) => writer.push(picture),
        }
    }

    fn finish(self) -> Result<PathBuf, OutputError> {
        match self {
            Self::Apng(writer) => writer.finish(),
            Self::Gif(writer) => writer.finish(),
            Self::Film(writer) => writer.finish(),
        }
    }
}

/// Writes a picture or a sequence: one file, numbered files (`x_0000.png` ...), or one animation.
///
/// A numbered file is complete as soon as its frame is pushed; an animation appears with [`FrameWriter::finish`].
#[derive(Debug)]
pub struct FrameWriter {
    format: OutputFormat,
    path: PathBuf,
    size: PictureSize,
    options: FrameOptions,
    animation: Option<Animation>,
    pushed: u32,
    done: Arc<AtomicU32>,
    written: Vec<PathBuf>,
}

impl FrameWriter {
    /// Checks what can be checked before a frame is rendered; an animation's file is opened.
    ///
    /// # Errors
    /// A missing folder, a folder in the file's place, no frames or too many, an impossible rate.
    pub fn open(
        format: OutputFormat,
        path: &Path,
        size: PictureSize,
        options: FrameOptions,
    ) -> Result<Self, OutputError> {
        if !(1..=MAX_FRAMES).contains(&options.frames) {
            return Err(OutputError::Frames(options.frames));
        }
        check_target(path)?;
        // What killed writers of stores left there; those of pictures are looked for with every file.
        remove_leftovers(&folder_of(path));
        let animation = Animation::open(format, path, size, options)?;
        Ok(Self {
            format,
            path: path.to_owned(),
            size,
            options,
            animation,
            pushed: 0,
            done: Arc::default(),
            written: Vec::new(),
        })
    }

    #[must_use]
    pub fn keeper(&self) -> Keeper {
        let animation = self.animation.as_ref().map(Animation::cutter);
        Keeper { animation, path: self.path.clone(), frames: self.options.frames, done: Arc::clone(&self.done) }
    }

    /// # Errors
    /// A frame of another size, one too many, a full disk.
    pub fn push(&mut self, picture: &Picture) -> Result<(), OutputError> {
        let want = self.options.frames;
        if self.pushed == want {
            return Err(OutputError::FrameCount { path: self.path.clone(), want, got: want + 1 });
        }
        check_size(&self.path, self.size, picture)?;
        if let Some(animation) = &mut self.animation {
            animation.push(picture)?;
        } else {
            let path = if want == 1 { self.path.clone() } else { numbered(&self.path, self.pushed, want) };
            self.written.push(match self.format {
                OutputFormat::Exr => exr::write(&path, picture)?,
                _ => png::write(&path, picture, self.options.background)?,
            });
        }
        self.pushed += 1;
        self.done.store(self.pushed, Ordering::Release);
        Ok(())
    }

    /// The file that the last push completed; `None` where frames go into one animation.
    #[must_use]
    pub fn last_written(&self) -> Option<&Path> {
        self.written.last().map(PathBuf::as_path)
    }

    /// Completes the output and lists the files written.
    ///
    /// # Errors
    /// Fewer frames than announced, a full disk.
    pub fn finish(mut self) -> Result<Vec<PathBuf>, OutputError> {
        let (want, got) = (self.options.frames, self.pushed);
        if got != want {
            return Err(OutputError::FrameCount { path: self.path, want, got });
        }
        if let Some(animation) = self.animation.take() {
            self.written.push(animation.finish()?);
        }
        Ok(self.written)
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::Premul;

    use super::*;

    fn picture(size: PictureSize, v: f32) -> Picture {
        Picture::new(size, vec![Premul { r: v, g: v, b: v, a: 1.0 }; size.pixel_count()]).unwrap()
    }

    #[test]
    fn one_frame_takes_the_name_and_more_are_numbered() {
        let folder = tempfile::tempdir().unwrap();
        let size = PictureSize::new(4, 3).unwrap();
        for (name, frames, want) in [
            ("a.png", 1, vec!["a.png"]),
            ("a.exr", 1, vec!["a.exr"]),
            ("a.apng", 2, vec!["a.apng"]),
            ("a.gif", 3, vec!["a.gif"]),
            ("b.png", 2, vec!["b_0000.png", "b_0001.png"]),
            ("b.exr", 3, vec!["b_0000.exr", "b_0001.exr", "b_0002.exr"]),
        ] {
            let path = folder.path().join(name);
            let format = OutputFormat::from_path(&path).unwrap();
            let options = FrameOptions { frames, ..FrameOptions::default() };
            let mut writer = FrameWriter::open(format, &path, size, options).unwrap();
            for i in 0..frames {
                writer.push(&picture(size, i as f32 / 4.0)).unwrap();
            }
            assert!(writer.push(&picture(size, 0.0)).is_err());
            let written = writer.finish().unwrap();
            assert_eq!(written, want.iter().map(|n| folder.path().join(n)).collect::<Vec<_>>());
            assert!(written.iter().all(|p| p.is_file()));
        }
        let second = exr::read(&folder.path().join("b_0001.exr")).unwrap();
        assert_eq!(second.pixels()[0].r, 0.25);
    }

    #[test]
    fn what_cannot_end_well_is_refused_before_the_first_frame() {
        let folder = tempfile::tempdir().unwrap();
        let size = PictureSize::new(4, 3).unwrap();
        let open = |name: &str, options| {
            FrameWriter::open(OutputFormat::Apng, &folder.path().join(name), size, options).unwrap_err().to_string()
        };
        assert!(open("no/a.apng", FrameOptions::default()).contains("does not exist"));
        assert!(open("a.apng", FrameOptions { frames: 0, ..FrameOptions::default() }).contains("at least 1"));
        assert!(open("a.apng", FrameOptions { fps: 0.0, ..FrameOptions::default() }).contains("0.1 and 240"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn too_few_frames_are_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let size = PictureSize::new(4, 3).unwrap();
        let options = FrameOptions { frames: 2, ..FrameOptions::default() };
        let mut writer = FrameWriter::open(OutputFormat::Png, &folder.path().join("a.png"), size, options).unwrap();
        let keeper = writer.keeper();
        assert_eq!(keeper.keep(false).unwrap(), None);
        writer.push(&picture(size, 0.5)).unwrap();
        assert!(writer.finish().unwrap_err().to_string().contains("2 frames and got 1"));
        let path = folder.path().join("a_0000.png");
        assert!(path.is_file());
        assert_eq!(keeper.keep(false).unwrap(), Some(Kept { path, is_animation: false, frames: 1, of: 2 }));
    }
}

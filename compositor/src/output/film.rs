//! Films (.mp4, .webm): frames go to the user's ffmpeg as they come.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use brickcast_volume::PictureSize;

use super::animation::{check_size, frame_delay};
use super::atomic::AtomicFile;
use super::error::OutputError;
use super::png::opaque;
use crate::picture::Picture;

/// Of what ffmpeg says, the most that is read, bytes.
const MAX_SAID: u64 = 4096;
/// The program.
const FFMPEG: &str = "ffmpeg";

/// A film's container, as ffmpeg calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Container {
    Mp4,
    Webm,
}

impl Container {
    fn arguments(self) -> &'static [&'static str] {
        match self {
            // H.264 where this ffmpeg has it.
            Self::Mp4 => &["-crf", "18", "-movflags", "+faststart", "-f", "mp4"],
            // VP9.
            Self::Webm => &["-crf", "30", "-b:v", "0", "-f", "webm"],
        }
    }
}

/// A film in the making. Dropped before [`FilmWriter::finish`], it leaves nothing behind.
#[derive(Debug)]
pub(super) struct FilmWriter {
    // Before the file in drop order: nobody writes to it any more when it is removed.
    encoder: Encoder,
    file: AtomicFile,
    size: PictureSize,
    background: [f32; 3],
}

/// ffmpeg at work; killed where it is dropped.
#[derive(Debug)]
struct Encoder {
    child: Child,
    frames: Option<ChildStdin>,
    said: Option<JoinHandle<String>>,
}

/// # Errors
/// There is no ffmpeg on the PATH.
pub(super) fn check(path: &Path) -> Result<(), OutputError> {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let is_there = |folder: PathBuf| folder.join(FFMPEG).with_extension(std::env::consts::EXE_EXTENSION).is_file();
    match std::env::split_paths(&folders).any(is_there) {
        true => Ok(()),
        false => Err(OutputError::NoEncoder { path: path.to_owned() }),
    }
}

impl FilmWriter {
    /// # Errors
    /// No ffmpeg, an impossible rate, a missing folder, a full disk.
    pub(super) fn create(
        path: &Path,
        container: Container,
        size: PictureSize,
        fps: f64,
        background: [f32; 3],
    ) -> Result<Self, OutputError> {
        frame_delay(fps)?;
        check(path)?;
        let file = AtomicFile::create(path)?;
        let [width, height] = even(size);
        let mut command = Command::new(FFMPEG);
        command.args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y"]);
        command.args(["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", &format!("{width}x{height}")]);
        command.args(["-framerate", &fps.to_string(), "-i", "-", "-vf", FILTERS]);
        // Its own output is our file, which it opens by that name: it needs to go back in it.
        command.args(container.arguments()).arg("file:/dev/stdout");
        command.stdin(Stdio::piped()).stdout(file.handle()?).stderr(Stdio::piped());
        #[cfg(unix)]
        // An interrupt of the terminal is ours to answer.
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|error| problem(path, &format!("it does not start: {error}")))?;
        let frames = child.stdin.take();
        let said = child.stderr.take().map(|said| std::thread::spawn(move || read(said)));
        Ok(Self { encoder: Encoder { child, frames, said }, file, size, background })
    }

    /// # Errors
    /// A frame of another size; what ffmpeg says.
    pub(super) fn push(&mut self, picture: &Picture) -> Result<(), OutputError> {
        check_size(self.file.target(), self.size, picture)?;
        let ([width, height], own) = (even(self.size), self.size.width() as usize);
        let mut bytes = Vec::with_capacity(3 * width * height);
        for row in picture.pixels().chunks_exact(own) {
            bytes
                .extend(row.iter().chain(row.last().filter(|_| own < width)).flat_map(|p| opaque(*p, self.background)));
        }
        if bytes.len() < 3 * width * height {
            bytes.extend_from_within(bytes.len() - 3 * width..);
        }
        let sent = self.encoder.frames.as_mut().map(|frames| frames.write_all(&bytes));
        match sent {
            Some(Ok(())) => Ok(()),
            _ => Err(self.encoder.failed(self.file.target())),
        }
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// What ffmpeg says; a full disk.
    pub(super) fn finish(mut self) -> Result<PathBuf, OutputError> {
        self.encoder.frames = None;
        match self.encoder.child.wait() {
            Ok(status) if status.success() => self.file.commit(),
            _ => Err(self.encoder.failed(self.file.target())),
        }
    }
}

/// Colours of high definition, in a layout that every player knows.
const FILTERS: &str = "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,\
                       setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709";

/// That layout has a colour for four pixels: an odd side is one longer, its last pixels there twice.
fn even(size: PictureSize) -> [usize; 2] {
    [size.width(), size.height()].map(|side| side.next_multiple_of(2) as usize)
}

/// All that is said, as far as it is kept: whoever says more must not have to wait.
fn read(mut said: ChildStderr) -> String {
    let mut text = Vec::new();
    let _ = said.by_ref().take(MAX_SAID).read_to_end(&mut text);
    let _ = std::io::copy(&mut said, &mut std::io::sink());
    String::from_utf8_lossy(&text).trim().replace('\n', "; ")
}

fn problem(path: &Path, what: &str) -> OutputError {
    OutputError::Encode { path: path.to_owned(), problem: format!("{FFMPEG}: {what}") }
}

impl Encoder {
    /// Ends it, and tells why it could not go on.
    fn failed(&mut self, path: &Path) -> OutputError {
        self.end();
        let said = self.said.take().and_then(|said| said.join().ok()).filter(|said| !said.is_empty());
        problem(path, &said.unwrap_or_else(|| "it ended early, and says nothing".to_owned()))
    }

    fn end(&mut self) {
        self.frames = None;
        // One that is gone already is what is wanted.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_even_in_a_film() {
        let of = |w, h| even(PictureSize::new(w, h).unwrap());
        assert_eq!([of(1, 1), of(64, 47), of(65, 48)], [[2, 2], [64, 48], [66, 48]]);
    }
}

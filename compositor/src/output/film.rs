//! Films (.mp4, .webm): frames go to the user's ffmpeg as they come.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use brickcast_volume::PictureSize;

use super::animation::{check_size, frame_delay};
use super::atomic::AtomicFile;
use super::error::OutputError;
use super::place::place_of_part;
use super::png::opaque;
use crate::picture::Picture;

/// Of what ffmpeg says, the most that is read, bytes.
const MAX_SAID: u64 = 4096;
/// Whoever ends a film early waits no longer than this for ffmpeg to finish what it has got.
const LONGEST_END: Duration = Duration::from_secs(10);
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

/// A film in the making. Dropped before [`FilmWriter::finish`] and not cut, it leaves nothing behind.
#[derive(Debug)]
pub(super) struct FilmWriter {
    film: FilmCutter,
    path: PathBuf,
    size: PictureSize,
    background: [f32; 3],
}

/// Ends a film in the making with the frames that ffmpeg has got.
#[derive(Debug, Clone)]
pub(super) struct FilmCutter(Arc<Mutex<Film>>);

#[derive(Debug)]
struct Film {
    // Before the file in drop order: nobody writes to it any more when it is removed.
    encoder: Encoder,
    /// None once it is at its place.
    file: Option<AtomicFile>,
    /// That ffmpeg has got.
    frames: u32,
    /// Whoever still makes it waits for the end of the process.
    is_parked: bool,
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
        let encoder = Encoder { child, frames, said };
        let film = Film { encoder, file: Some(file), frames: 0, is_parked: false };
        Ok(Self { film: FilmCutter(Arc::new(Mutex::new(film))), path: path.to_owned(), size, background })
    }

    pub(super) fn cutter(&self) -> FilmCutter {
        self.film.clone()
    }

    /// # Errors
    /// A frame of another size; what ffmpeg says.
    pub(super) fn push(&mut self, picture: &Picture) -> Result<(), OutputError> {
        check_size(&self.path, self.size, picture)?;
        let ([width, height], own) = (even(self.size), self.size.width() as usize);
        let mut bytes = Vec::with_capacity(3 * width * height);
        for row in picture.pixels().chunks_exact(own) {
            bytes
                .extend(row.iter().chain(row.last().filter(|_| own < width)).flat_map(|p| opaque(*p, self.background)));
        }
        if bytes.len() < 3 * width * height {
            bytes.extend_from_within(bytes.len() - 3 * width..);
        }
        let mut film = self.film.mine();
        let sent = film.encoder.frames.as_mut().map(|frames| frames.write_all(&bytes));
        match sent {
            Some(Ok(())) => {
                film.frames += 1;
                Ok(())
            }
            _ => Err(film.encoder.failed(&self.path)),
        }
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// What ffmpeg says; a full disk.
    pub(super) fn finish(self) -> Result<PathBuf, OutputError> {
        let mut film = self.film.mine();
        film.encoder.frames = None;
        match film.encoder.child.wait() {
            Ok(status) if status.success() => film.file.take().map_or(Ok(self.path), AtomicFile::commit),
            _ => Err(film.encoder.failed(&self.path)),
        }
    }
}

impl FilmCutter {
    /// For whoever makes it.
    fn mine(&self) -> MutexGuard<'_, Film> {
        let film = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !film.is_parked {
            return film;
        }
        drop(film);
        loop {
            std::thread::park();
        }
    }

    /// As [`Cutter::cut`](super::cutter::Cutter::cut); nothing also where ffmpeg takes no more frames for so long that
    /// nobody would wait.
    pub(super) fn cut(&self, park: bool) -> Result<Option<(PathBuf, u32)>, OutputError> {
        let until = Instant::now() + LONGEST_END;
        let Some(mut film) = polled(until, || self.0.try_lock().ok()) else { return Ok(None) };
        if film.frames == 0 {
            return Ok(None);
        }
        let Some(file) = film.file.take() else { return Ok(None) };
        film.is_parked = park;
        film.encoder.frames = None;
        match polled(until, || film.encoder.child.try_wait().transpose()) {
            Some(Ok(status)) if status.success() => {
                let place = place_of_part(file.target());
                Ok(Some((file.commit_as(&place)?, film.frames)))
            }
            _ => Err(film.encoder.failed(file.target())),
        }
    }
}

/// What `ask` answers, asked again and again until then.
fn polled<T>(until: Instant, mut ask: impl FnMut() -> Option<T>) -> Option<T> {
    loop {
        match ask() {
            None if Instant::now() < until => std::thread::sleep(Duration::from_millis(5)),
            answer => return answer,
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

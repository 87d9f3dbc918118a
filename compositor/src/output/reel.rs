//! The file of an animation in the making. It can be ended after any whole frame, also by another thread while frames
//! are still written: the film is cut there, and its header told how many frames it has.

use std::fs::File;
use std::io::{BufWriter, Seek as _, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::atomic::AtomicFile;
use super::error::OutputError;
use super::place::place_of_part;

/// A handle to the file; all are of one.
#[derive(Debug, Clone)]
pub(super) struct Reel(Arc<Mutex<Film>>);

#[derive(Debug)]
struct Film {
    /// None once it is at its place.
    file: Option<AtomicFile>,
    writer: BufWriter<File>,
    written: u64,
    /// Bytes up to the end of the last whole frame.
    whole: u64,
    frames: u32,
    /// Whoever still writes waits for the end of the process.
    is_parked: bool,
}

impl Reel {
    pub(super) fn create(path: &Path) -> Result<Self, OutputError> {
        let file = AtomicFile::create(path)?;
        let writer = file.writer()?;
        let film = Film { file: Some(file), writer, written: 0, whole: 0, frames: 0, is_parked: false };
        Ok(Self(Arc::new(Mutex::new(film))))
    }

    fn film(&self) -> MutexGuard<'_, Film> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// As [`Reel::film`], for whoever makes it.
    fn my_film(&self) -> MutexGuard<'_, Film> {
        let film = self.film();
        if !film.is_parked {
            return film;
        }
        drop(film);
        loop {
            std::thread::park();
        }
    }

    /// What was written so far ends with a whole frame.
    pub(super) fn frame_is_whole(&self) {
        let mut film = self.my_film();
        film.whole = film.written;
        film.frames += 1;
    }

    /// Gives the whole film its name.
    pub(super) fn finish(&self) -> Result<Option<PathBuf>, OutputError> {
        let mut film = self.my_film();
        let Some(file) = film.file.take() else { return Ok(None) };
        film.writer.flush().map_err(|error| file.error(error))?;
        file.commit().map(Some)
    }

    /// Ends the film with the frames that are whole, and gives it the name of a part of it; nothing where there are
    /// none, or it is finished. `head_and_end` are the bytes that a film of so many frames begins with, at most as many
    /// as this one's, and ends with. With `park`, whoever makes the film waits from now on for the end of the process.
    pub(super) fn cut(
        &self,
        park: bool,
        head_and_end: impl FnOnce(u32) -> Result<(Vec<u8>, Vec<u8>), OutputError>,
    ) -> Result<Option<(PathBuf, u32)>, OutputError> {
        let mut film = if park { self.film() } else { self.my_film() };
        if film.frames == 0 {
            return Ok(None);
        }
        let Some(file) = film.file.take() else { return Ok(None) };
        film.is_parked = park;
        let (head, end) = head_and_end(film.frames)?;
        film.cut_with(&head, &end).map_err(|error| file.error(error))?;
        let place = place_of_part(file.target());
        Ok(Some((file.commit_as(&place)?, film.frames)))
    }
}

impl Film {
    fn cut_with(&mut self, head: &[u8], end: &[u8]) -> std::io::Result<()> {
        // The next frame may have begun: it goes.
        self.writer.flush()?;
        let file = self.writer.get_mut();
        file.set_len(self.whole)?;
        file.seek(SeekFrom::Start(self.whole))?;
        file.write_all(end)?;
        file.seek(SeekFrom::Start(0))?;
        file.write_all(head)
    }
}

/// What a frame's encoder writes. What comes after the end is not written.
impl Write for Reel {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut film = self.my_film();
        if film.file.is_none() {
            return Ok(bytes.len());
        }
        let written = film.writer.write(bytes)?;
        film.written += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        let mut film = self.my_film();
        if film.file.is_none() { Ok(()) } else { film.writer.flush() }
    }
}

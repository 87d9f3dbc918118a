//! What is on the disk and not finished, so that a signal can remove it before the process ends.
//!
//! Whoever makes something lists it, and takes it off the list when it is finished or removed. Both happen under one
//! lock, and [`clear`] takes that lock for good: nothing can be begun or finished behind its back.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file or folder that is removed should a signal end the process; off the list when this is dropped.
#[derive(Debug)]
pub struct Listed(PathBuf);

impl Listed {
    /// Lists `path`, which `make` makes: where it fails, what is there is somebody else's.
    ///
    /// # Errors
    /// That of `make`.
    pub fn making<T, E>(path: &Path, make: impl FnOnce() -> Result<T, E>) -> Result<(T, Self), E> {
        let mut list = unfinished();
        let made = make()?;
        // Absolute, whatever becomes of the working directory.
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        list.push(path.clone());
        Ok((made, Self(path)))
    }

    /// Runs `finish`, which gives what is listed its final place or takes it away, undisturbed by signals; then it is
    /// off the list.
    pub fn settle<T>(mut self, finish: impl FnOnce() -> T) -> T {
        let mut list = unfinished();
        let result = finish();
        // Taken: by the time this is dropped, somebody may have listed the same path anew.
        remove(&mut list, &std::mem::take(&mut self.0));
        result
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        remove(&mut unfinished(), &self.0);
    }
}

fn remove(list: &mut Vec<PathBuf>, path: &Path) {
    if let Some(at) = list.iter().position(|listed| listed == path) {
        list.swap_remove(at);
    }
}

/// Removes all that is listed. Afterwards everyone who begins or finishes something waits for ever: for the end of the
/// process only.
pub fn clear() {
    let list = unfinished();
    for path in list.iter() {
        // Whoever writes in a folder may make a file while it is emptied, but not for long: its own folders go.
        for _ in 0..50 {
            match removed(path) {
                Ok(()) => break,
                Err(error) if error.kind() == io::ErrorKind::NotFound => break,
                Err(_) => std::thread::sleep(Duration::from_millis(10)),
            }
        }
    }
    std::mem::forget(list);
}

fn removed(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path)?.is_dir() {
        true => fs::remove_dir_all(path),
        false => fs::remove_file(path),
    }
}

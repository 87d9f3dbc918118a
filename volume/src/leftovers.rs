//! What is on the disk and not finished, so that a signal can remove it before the process ends.
//!
//! Whoever makes something lists it, and takes it off the list when it is finished or removed. Both happen under one
//! lock, and [`clear`] takes that lock for good: nothing can be begun or finished behind its back. What is of use
//! before it is finished is brought to an end first ([`Farewell`]).

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Brings something to an end, and says what was kept of it, for people.
type LastWords = Box<dyn FnOnce() -> Option<String> + Send>;

static FAREWELLS: Mutex<Vec<(u64, LastWords)>> = Mutex::new(Vec::new());

fn farewells() -> MutexGuard<'static, Vec<(u64, LastWords)>> {
    FAREWELLS.lock().unwrap_or_else(PoisonError::into_inner)
}

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

/// What is to be done should a signal end the process, before what is unfinished is removed; no more when this is
/// dropped.
#[derive(Debug)]
pub struct Farewell(u64);

impl Farewell {
    /// `end` brings something to an end, from another thread, and says what was kept. Whoever still works at it must
    /// wait afterwards: for the end of the process only.
    #[must_use]
    pub fn of(end: impl FnOnce() -> Option<String> + Send + 'static) -> Self {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let id = COUNTER.fetch_add(1, Ordering::Relaxed);
        farewells().push((id, Box::new(end)));
        Self(id)
    }
}

impl Drop for Farewell {
    fn drop(&mut self) {
        // Taken out first: what it holds may lock something when it goes.
        let mut list = farewells();
        let gone = list.iter().position(|(id, _)| *id == self.0).map(|at| list.swap_remove(at));
        drop(list);
        drop(gone);
    }
}

/// As [`fs::create_dir_all`], of folders in one that is listed: none of them comes back behind the back of [`clear`].
///
/// # Errors
/// As [`fs::create_dir_all`].
pub fn create_dir_all(path: &Path) -> io::Result<()> {
    let _list = unfinished();
    fs::create_dir_all(path)
}

/// What became of things that were not finished.
#[derive(Debug, Default)]
pub struct Cleared {
    /// What was of use all the same and was kept, for people.
    pub kept: Vec<String>,
    /// What could not be removed.
    pub left: Vec<(PathBuf, io::Error)>,
}

/// Ends what is of use unfinished, and removes all else that is listed. Afterwards everyone who begins or finishes
/// something waits for ever: for the end of the process only.
#[must_use]
pub fn clear() -> Cleared {
    let ends = std::mem::take(&mut *farewells());
    let kept = ends.into_iter().filter_map(|(_, end)| end()).collect();
    let list = unfinished();
    let left = list.iter().filter_map(|path| cleared(path).err().map(|error| (path.clone(), error))).collect();
    std::mem::forget(list);
    Cleared { kept, left }
}

fn cleared(path: &Path) -> io::Result<()> {
    let mut tries = 0;
    // Whoever writes in a folder may make a file while it is emptied, but not for long: its own folders go.
    loop {
        match removed(path) {
            Ok(()) => return Ok(()),
            Err(error) if error.kind() == io::ErrorKind::NotFound && fs::symlink_metadata(path).is_err() => {
                return Ok(());
            }
            Err(error) if tries == 50 => return Err(error),
            Err(_) => std::thread::sleep(Duration::from_millis(10)),
        }
        tries += 1;
    }
}

fn removed(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path)?.is_dir() {
        true => fs::remove_dir_all(path),
        false => fs::remove_file(path),
    }
}

//! A file that is finished or absent: written under another name in the same folder, then renamed.
//!
//! `.NAME.brickcast-PID-N.part` is locked while its writer lives. One whose process is gone and whose lock is free was
//! left by a writer that was killed: whoever writes in that folder next removes it. In containers the same few numbers
//! live again and again: of a file that nobody has touched for a while, the lock alone tells.

use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::leftovers::Listed;

/// Removes itself unless [`Unfinished::finish`] was reached; so does a signal that ends the process.
#[derive(Debug)]
pub struct Unfinished {
    file: File,
    temporary: PathBuf,
    target: PathBuf,
    listed: Option<Listed>,
}

const MARK: &str = ".brickcast-";
const ENDING: &str = ".part";

impl Unfinished {
    /// # Errors
    /// A folder at the target, a folder that is missing or cannot be written.
    pub fn create(target: &Path) -> io::Result<Self> {
        if target.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a directory"));
        }
        let name = target.file_name().ok_or_else(|| io::Error::other("it has no file name"))?;
        sweep_once(&folder_of(target));
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        // A leftover of a process that was killed may have our id: try a few names, never for ever.
        let mut last = None;
        for _ in 0..100 {
            let n = COUNTER.fetch_add(1, Ordering::Relaxed);
            let mut temporary = OsString::from(".");
            temporary.push(name);
            temporary.push(format!("{MARK}{}-{n}{ENDING}", std::process::id()));
            let temporary = target.with_file_name(temporary);
            match Listed::making(&temporary, || File::create_new(&temporary)) {
                Ok((file, listed)) => {
                    // File systems without locks: the file is then never taken for a dead one's either.
                    let _ = file.try_lock();
                    return Ok(Self { file, temporary, target: target.to_path_buf(), listed: Some(listed) });
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => last = Some(error),
                Err(error) => return Err(error),
            }
        }
        Err(last.unwrap_or_else(|| io::ErrorKind::AlreadyExists.into()))
    }

    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Another handle to the same file. What is written through it must be there before [`Unfinished::finish`].
    ///
    /// # Errors
    /// The system has no more handles.
    pub fn handle(&self) -> io::Result<File> {
        self.file.try_clone()
    }

    /// Gives the file its name, replacing what had it.
    ///
    /// # Errors
    /// A full disk, a folder that cannot be written.
    pub fn finish(self) -> io::Result<()> {
        let target = self.target.clone();
        self.finish_as(&target)
    }

    /// The same under another name in the same folder.
    ///
    /// # Errors
    /// As [`Unfinished::finish`].
    pub fn finish_as(mut self, target: &Path) -> io::Result<()> {
        // Before the rename, or a crash could leave the name with half of the content.
        self.file.sync_all()?;
        let Some(listed) = self.listed.take() else { return Ok(()) };
        listed.settle(|| {
            let renamed = fs::rename(&self.temporary, target);
            if renamed.is_err() {
                let _ = fs::remove_file(&self.temporary);
            }
            renamed
        })
    }
}

impl Write for Unfinished {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        self.file.write(data)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(listed) = self.listed.take() {
            // Nothing more can be done about a file that cannot be removed either.
            let _ = listed.settle(|| fs::remove_file(&self.temporary));
        }
    }
}

fn folder_of(target: &Path) -> PathBuf {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// [`sweep`], the first time that this process writes in a folder: a sequence of many pictures must not read it again
/// and again.
pub(crate) fn sweep_once(folder: &Path) {
    static SWEPT: Mutex<Option<HashSet<PathBuf>>> = Mutex::new(None);
    let mut swept = SWEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if swept.get_or_insert_default().insert(folder.to_path_buf()) {
        sweep(folder);
    }
}

/// Removes what killed writers left in a folder. Failures are left to the next writer.
fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let Some(process) = process_of(&entry.file_name()) else { continue };
        let path = entry.path();
        if is_ours(&path) && is_settled(&path, process) && is_unlocked(&path) {
            let _ = fs::remove_file(&path);
        }
    }
}

/// The process that a temporary file's name speaks of.
fn process_of(name: &OsStr) -> Option<u32> {
    let name = name.to_str()?.strip_prefix('.')?.strip_suffix(ENDING)?;
    let (_, writer) = name.rsplit_once(MARK)?;
    let (process, count) = writer.split_once('-')?;
    count.parse::<u32>().ok()?;
    process.parse().ok()
}

/// A regular file of this user.
fn is_ours(path: &Path) -> bool {
    let Ok(metadata) = fs::symlink_metadata(path) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        if metadata.uid() != rustix::process::geteuid().as_raw() {
            return false;
        }
    }
    metadata.is_file()
}

/// True where whoever made this has had the time to lock it, or is no more.
#[must_use]
pub fn is_settled(path: &Path, process: u32) -> bool {
    const BEGINNING: Duration = Duration::from_secs(60);
    let changed = || fs::symlink_metadata(path).and_then(|data| data.modified()).ok();
    !is_alive(process) || changed().and_then(|at| at.elapsed().ok()).is_some_and(|age| age > BEGINNING)
}

/// Of a process of this machine and container; those elsewhere that share the folder hold their locks.
#[cfg(unix)]
fn is_alive(process: u32) -> bool {
    let pid = i32::try_from(process).ok().and_then(rustix::process::Pid::from_raw);
    // Someone else's process is alive although it may not be asked.
    pid.is_some_and(|pid| rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH))
}

#[cfg(not(unix))]
fn is_alive(_: u32) -> bool {
    true
}

fn is_unlocked(path: &Path) -> bool {
    File::options().write(true).open(path).is_ok_and(|file| file.try_lock().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_abandoned_file_leaves_nothing_and_the_old_one_alone() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.png");
        fs::write(&target, "old").unwrap();
        let mut file = Unfinished::create(&target).unwrap();
        file.write_all(b"half").unwrap();
        assert_eq!(names(folder.path()).len(), 2);
        drop(file);
        assert_eq!(names(folder.path()), ["a.png"]);
        assert_eq!(fs::read(&target).unwrap(), b"old");
    }

    #[test]
    fn a_finished_file_replaces_the_old_one_and_leaves_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.png");
        fs::write(&target, "old and longer").unwrap();
        let mut file = Unfinished::create(&target).unwrap();
        file.write_all(b"new").unwrap();
        file.finish().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.png"]);
    }

    /// The id of a process that has ended and was waited for.
    #[cfg(unix)]
    fn dead() -> u32 {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        child.id()
    }

    #[cfg(unix)]
    #[test]
    fn what_a_killed_writer_left_is_swept_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let (at, dead, alive) = (folder.path(), dead(), std::process::id());
        let locked_name = format!(".l.png.brickcast-{dead}-0.part");
        // In containers every process has the number of the one before.
        let old = at.join(format!(".o.png.brickcast-{alive}-7777778.part"));
        fs::write(&old, "x").unwrap();
        let hour_ago = std::time::SystemTime::now() - Duration::from_secs(3600);
        File::options().write(true).open(&old).unwrap().set_modified(hour_ago).unwrap();
        let keep = [
            format!(".a.png.brickcast-{alive}-7777777.part"),
            locked_name.clone(),
            format!(".a.png.{dead}.part"),
            format!("a.png.brickcast-{dead}-0.part"),
            format!(".a.png.brickcast-{dead}-x.part"),
            "thesis.part".to_owned(),
        ];
        for name in keep.iter().chain([&format!(".a.png.brickcast-{dead}-3.part")]) {
            fs::write(at.join(name), "x").unwrap();
        }
        fs::create_dir(at.join(format!(".d.brickcast-{dead}-0.part"))).unwrap();
        // A writer in another container: its id means nothing here, its lock does.
        let locked = File::options().write(true).open(at.join(&locked_name)).unwrap();
        locked.try_lock().unwrap();
        Unfinished::create(&at.join("b.png")).unwrap().finish().unwrap();
        let mut want = keep.to_vec();
        want.extend(["b.png".to_owned(), format!(".d.brickcast-{dead}-0.part")]);
        want.sort();
        assert_eq!(names(at), want);
    }
}

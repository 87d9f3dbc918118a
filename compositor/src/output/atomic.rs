//! A file that appears under its name only when it is complete.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::OutputError;

/// Dropped without [`AtomicFile::commit`], it leaves nothing behind.
#[derive(Debug)]
pub(super) struct AtomicFile {
    file: File,
    temporary: PathBuf,
    target: PathBuf,
    committed: bool,
}

static COUNTER: AtomicU32 = AtomicU32::new(0);

/// Refuses what could not be written later: a missing folder, a folder in the file's place.
pub(super) fn check_target(target: &Path) -> Result<(), OutputError> {
    let folder = folder_of(target);
    if !folder.is_dir() {
        return Err(OutputError::NoFolder { path: target.to_owned(), folder });
    }
    if target.is_dir() || target.file_name().is_none() {
        return Err(OutputError::IsFolder { path: target.to_owned() });
    }
    Ok(())
}

fn folder_of(target: &Path) -> PathBuf {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

impl AtomicFile {
    /// # Errors
    /// As [`check_target`], or where the folder cannot be written.
    pub(super) fn create(target: &Path) -> Result<Self, OutputError> {
        check_target(target)?;
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        // A leftover of a process that was killed may have our id: try a few names, never for ever.
        let mut last = None;
        for _ in 0..100 {
            let n = COUNTER.fetch_add(1, Ordering::Relaxed);
            let temporary = folder_of(target).join(format!(".{name}.{}-{n}.part", std::process::id()));
            match File::create_new(&temporary) {
                Ok(file) => return Ok(Self { file, temporary, target: target.to_owned(), committed: false }),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => last = Some(error),
                Err(error) => return Err(OutputError::Write { path: target.to_owned(), error }),
            }
        }
        let error = last.unwrap_or_else(|| ErrorKind::AlreadyExists.into());
        Err(OutputError::Write { path: target.to_owned(), error })
    }

    pub(super) fn target(&self) -> &Path {
        &self.target
    }

    /// A buffered writer over the same file. Flush it before [`AtomicFile::commit`].
    pub(super) fn writer(&self) -> Result<BufWriter<File>, OutputError> {
        Ok(BufWriter::with_capacity(1 << 16, self.file.try_clone().map_err(|e| self.error(e))?))
    }

    pub(super) fn error(&self, error: std::io::Error) -> OutputError {
        OutputError::Write { path: self.target.clone(), error }
    }

    /// Gives the file its name, replacing what had it.
    pub(super) fn commit(mut self) -> Result<PathBuf, OutputError> {
        self.file.flush().and_then(|()| self.file.sync_all()).map_err(|e| self.error(e))?;
        std::fs::rename(&self.temporary, &self.target).map_err(|e| self.error(e))?;
        self.committed = true;
        Ok(self.target.clone())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.committed {
            // Nothing can be done about a failure here, and the file is hidden by its name.
            let _ = std::fs::remove_file(&self.temporary);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn an_abandoned_file_leaves_nothing_and_the_old_one_alone() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.png");
        std::fs::write(&target, "old").unwrap();
        let file = AtomicFile::create(&target).unwrap();
        file.writer().unwrap().write_all(b"half").unwrap();
        assert_eq!(std::fs::read(&target).unwrap(), b"old");
        drop(file);
        assert_eq!(names(folder.path()), ["a.png"]);
        assert_eq!(std::fs::read(&target).unwrap(), b"old");
    }

    #[test]
    fn a_committed_file_replaces_the_old_one_and_leaves_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.png");
        std::fs::write(&target, "old and longer").unwrap();
        let file = AtomicFile::create(&target).unwrap();
        let mut writer = file.writer().unwrap();
        writer.write_all(b"new").unwrap();
        writer.flush().unwrap();
        assert_eq!(file.commit().unwrap(), target);
        assert_eq!(std::fs::read(&target).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.png"]);
    }

    #[test]
    fn missing_folders_and_folders_as_targets_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = AtomicFile::create(&folder.path().join("no/such/a.png")).unwrap_err().to_string();
        assert!(error.contains("does not exist") && error.contains("no/such"), "{error}");
        let error = AtomicFile::create(folder.path()).unwrap_err().to_string();
        assert!(error.contains("it is a folder"), "{error}");
    }
}

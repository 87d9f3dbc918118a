//! A file that appears under its name only when it is complete, with the errors of outputs.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use brickcast_volume::unfinished::Unfinished;

use super::error::OutputError;

/// Dropped without [`AtomicFile::commit`], it leaves nothing behind.
#[derive(Debug)]
pub(super) struct AtomicFile(Unfinished);

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

pub(super) fn folder_of(target: &Path) -> PathBuf {
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
        let file = Unfinished::create(target);
        Ok(Self(file.map_err(|error| OutputError::Write { path: target.to_owned(), error })?))
    }

    pub(super) fn target(&self) -> &Path {
        self.0.target()
    }

    /// The same file, for another process.
    pub(super) fn handle(&self) -> Result<File, OutputError> {
        self.0.handle().map_err(|e| self.error(e))
    }

    /// A buffered writer over the same file. Flush it before [`AtomicFile::commit`].
    pub(super) fn writer(&self) -> Result<BufWriter<File>, OutputError> {
        Ok(BufWriter::with_capacity(1 << 16, self.handle()?))
    }

    pub(super) fn error(&self, error: std::io::Error) -> OutputError {
        OutputError::Write { path: self.target().to_owned(), error }
    }

    /// Gives the file its name, replacing what had it.
    pub(super) fn commit(self) -> Result<PathBuf, OutputError> {
        let path = self.target().to_owned();
        self.commit_as(&path)
    }

    /// Gives the file another name in the same folder.
    pub(super) fn commit_as(self, path: &Path) -> Result<PathBuf, OutputError> {
        match self.0.finish_as(path) {
            Ok(()) => Ok(path.to_owned()),
            Err(error) => Err(OutputError::Write { path: path.to_owned(), error }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_folders_and_folders_as_targets_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = AtomicFile::create(&folder.path().join("no/such/a.png")).unwrap_err().to_string();
        assert!(error.contains("does not exist") && error.contains("no/such"), "{error}");
        let error = AtomicFile::create(folder.path()).unwrap_err().to_string();
        assert!(error.contains("it is a folder"), "{error}");
    }
}

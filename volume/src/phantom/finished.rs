//! A file that is finished or absent: written under another name in the same folder, then renamed.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Removes itself unless [`Unfinished::finish`] was reached.
#[derive(Debug)]
pub(super) struct Unfinished {
    file: File,
    temporary: PathBuf,
    target: PathBuf,
    finished: bool,
}

impl Unfinished {
    pub(super) fn create(target: &Path) -> io::Result<Self> {
        if target.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a directory"));
        }
        let mut name = OsString::from(".");
        name.push(target.file_name().ok_or_else(|| io::Error::other("it has no file name"))?);
        name.push(format!(".{}.part", std::process::id()));
        let temporary = target.with_file_name(name);
        let file = File::create(&temporary)?;
        Ok(Self { file, temporary, target: target.into(), finished: false })
    }

    pub(super) fn finish(mut self) -> io::Result<()> {
        // Before the rename, or a crash could leave the name with half of the content.
        self.file.sync_all()?;
        fs::rename(&self.temporary, &self.target)?;
        self.finished = true;
        Ok(())
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
        if !self.finished {
            // Nothing more can be done about a file that cannot be removed either.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

//! The one door for files that are no volumes: presets, cameras, settings, certificates, pictures read back, what the
//! system tells.
//!
//! What comes through is a regular file, and no more of it than was agreed. A FIFO or a terminal would be waited for, a
//! device may never end, and a file of many gigabytes would be read until memory is gone: all of them are refused, by
//! name and at once.

use std::fmt;
use std::fs::{File, FileType};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

#[derive(Debug, thiserror::Error)]
pub enum FileError {
    #[error("{what} {}: cannot be read: {source}", path.display())]
    Io { what: &'static str, path: PathBuf, source: io::Error },
    #[error("{what} {} is {kind}, and only regular files are read; copy its content to a file first", path.display())]
    NotRegular { what: &'static str, path: PathBuf, kind: FileKind },
    #[error(
        "{what} {} has more than the {most} bytes that are read of such a file; is it the right one?", path.display()
    )]
    TooLong { what: &'static str, path: PathBuf, most: u64 },
    #[error("{what} {} is no UTF-8 text (byte {at}); is it the right file?", path.display())]
    NotText { what: &'static str, path: PathBuf, at: usize },
}

/// What stands at a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    Regular,
    Folder,
    Fifo,
    Socket,
    CharacterDevice,
    BlockDevice,
    Other,
}

impl FileKind {
    #[must_use]
    pub fn of(file_type: FileType) -> Self {
        #[cfg(unix)]
        {
            use std::os::unix::fs::FileTypeExt as _;
            let kinds = [
                (file_type.is_fifo(), Self::Fifo),
                (file_type.is_socket(), Self::Socket),
                (file_type.is_char_device(), Self::CharacterDevice),
                (file_type.is_block_device(), Self::BlockDevice),
            ];
            if let Some((_, kind)) = kinds.into_iter().find(|(is, _)| *is) {
                return kind;
            }
        }
        match (file_type.is_file(), file_type.is_dir()) {
            (true, _) => Self::Regular,
            (_, true) => Self::Folder,
            _ => Self::Other,
        }
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Regular => "a regular file",
            Self::Folder => "a folder",
            Self::Fifo => "a named pipe (FIFO)",
            Self::Socket => "a socket",
            Self::CharacterDevice => "a character device",
            Self::BlockDevice => "a block device",
            Self::Other => "no file of a known kind",
        })
    }
}

/// Why nothing was opened.
#[derive(Debug)]
pub enum NotOpened {
    Io(io::Error),
    NotRegular(FileKind),
}

/// Opens a regular file for reading, never waiting for whoever might write. Links are followed.
///
/// # Errors
/// No such file, no permission; anything but a regular file.
pub fn open_regular(path: &Path) -> Result<File, NotOpened> {
    let regular = |metadata: std::fs::Metadata| match FileKind::of(metadata.file_type()) {
        FileKind::Regular => Ok(()),
        kind => Err(NotOpened::NotRegular(kind)),
    };
    // Before it is opened: some devices act on that alone, and a socket cannot be opened at all.
    regular(std::fs::metadata(path).map_err(NotOpened::Io)?)?;
    let file = open_without_waiting(path).map_err(NotOpened::Io)?;
    // And of what was opened: the path may have been given to something else meanwhile.
    regular(file.metadata().map_err(NotOpened::Io)?)?;
    Ok(file)
}

fn open_without_waiting(path: &Path) -> io::Result<File> {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt as _;
        options.custom_flags((rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY).bits() as i32);
    }
    options.open(path)
}

/// The content of a regular file of at most `most` bytes; `what` names its kind in errors, such as `camera file`.
///
/// # Errors
/// Nothing there, or nothing that may be read; no regular file; more than `most` bytes.
pub fn read(what: &'static str, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    let failed = |source| FileError::Io { what, path: path.to_path_buf(), source };
    let file = open_regular(path).map_err(|error| match error {
        NotOpened::Io(source) => failed(source),
        NotOpened::NotRegular(kind) => FileError::NotRegular { what, path: path.to_path_buf(), kind },
    })?;
    let mut bytes = Vec::new();
    // Not by its length: it may grow, and what the system tells of itself has none.
    file.take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(failed)?;
    match bytes.len() as u64 > most {
        true => Err(FileError::TooLong { what, path: path.to_path_buf(), most }),
        false => Ok(bytes),
    }
}

/// As [`read`], of text.
///
/// # Errors
/// As [`read`], and what is no UTF-8.
pub fn read_text(what: &'static str, path: &Path, most: u64) -> Result<String, FileError> {
    String::from_utf8(read(what, path, most)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        FileError::NotText { what, path: path.to_path_buf(), at }
    })
}

/// What the system tells of itself or of this process below `/proc` and `/sys`; nothing where it does not.
#[must_use]
pub fn system_text(path: impl AsRef<Path>) -> Option<String> {
    const MOST: u64 = 4 << 20;
    read_text("system file", path.as_ref(), MOST).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(path: &Path, most: u64) -> String {
        read("camera file", path, most).unwrap_err().to_string()
    }

    #[test]
    fn a_file_comes_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.json");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read_text("camera file", &path, 5).unwrap(), "12345");
        let error = refusal(&path, 4);
        assert!(error.contains("c.json") && error.contains("camera file") && error.contains("4 bytes"), "{error}");
        std::fs::write(&path, b"ab\xffcd").unwrap();
        let error = read_text("camera file", &path, 9).unwrap_err().to_string();
        assert!(error.contains("c.json") && error.contains("byte 2"), "{error}");
        let error = refusal(&folder.path().join("none"), 9);
        assert!(error.contains("none") && error.contains("cannot be read"), "{error}");
    }

    #[test]
    fn a_folder_is_called_one() {
        let folder = tempfile::tempdir().unwrap();
        assert!(refusal(folder.path(), 9).contains("is a folder"), "{}", refusal(folder.path(), 9));
    }

    /// Would hang for ever, or fill the memory, where it is not refused.
    #[cfg(unix)]
    #[test]
    fn pipes_devices_and_sockets_are_neither_waited_for_nor_read() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&pipe, &link).unwrap();
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        for (path, kind) in [
            (pipe.as_path(), "a named pipe"),
            (&link, "a named pipe"),
            (&socket, "a socket"),
            (Path::new("/dev/zero"), "a character device"),
        ] {
            let error = refusal(path, 9);
            assert!(error.contains(kind) && error.contains(path.to_str().unwrap()), "{error}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_the_system_tells_is_read_although_its_files_have_no_length() {
        assert!(system_text("/proc/self/status").unwrap().contains("VmHWM:"));
        assert_eq!(system_text("/proc/no/such"), None);
    }
}

//! A folder that reads never leave, whatever links are put into it, and whenever.

use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use crate::store::error::StoreError;

/// A data root. Links below it are followed where they stay inside, and refused where they lead out.
///
/// On Unix the way to a file is gone from a held descriptor, in one call or one component at a time, and no step
/// follows a link: what is swapped for a link between looking and opening is an error. Elsewhere the place is looked
/// up, checked and opened, so that a link swapped in between is followed. Hard links and mounts count as content of the
/// root. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Jail {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    /// Canonical.
    root: PathBuf,
    held: platform::Held,
}

/// Why nothing was opened.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// It leads out, or was swapped for a link just now.
    Outside,
    Io(io::Error),
}

impl Jail {
    /// # Errors
    /// A root that is not there, or is not a folder that can be listed.
    pub fn new(root: &Path) -> io::Result<Self> {
        let root = root.canonicalize()?;
        let held = platform::Held::new(&root)?;
        Ok(Self { inner: Arc::new(Inner { root, held }) })
    }

    /// Names in a folder, relative to the root, that may be folders themselves; a link may be one.
    ///
    /// # Errors
    /// Not a folder, one that leads out of the root, or one that cannot be listed.
    pub fn subfolders(&self, relative: &Path) -> Result<impl Iterator<Item = OsString> + use<>, StoreError> {
        self.follow(relative, platform::Held::entries).map_err(|refusal| match refusal {
            Refusal::Outside => StoreError::Outside { file: relative.to_path_buf() },
            Refusal::Io(source) => StoreError::Io { action: "list", path: self.path(relative), source },
        })
    }

    /// The path of `absolute` below the root; nothing where it is elsewhere by its name.
    #[must_use]
    pub fn below(&self, absolute: &Path) -> Option<PathBuf> {
        absolute.strip_prefix(&self.inner.root).ok().map(Path::to_path_buf)
    }

    pub(crate) fn path(&self, relative: &Path) -> PathBuf {
        self.inner.root.join(relative)
    }

    /// What is at `relative`, of whatever kind.
    pub(crate) fn open(&self, relative: &Path) -> Result<File, Refusal> {
        self.follow(relative, platform::Held::open)
    }

    /// Through the place as it is named; if that did not do, through the place that its links lead to.
    fn follow<T>(
        &self,
        relative: &Path,
        open: impl Fn(&platform::Held, &Path) -> Result<T, Refusal>,
    ) -> Result<T, Refusal> {
        if !relative.components().all(|c| matches!(c, Component::Normal(_))) {
            return Err(Refusal::Outside);
        }
        let held = &self.inner.held;
        if platform::NEVER_FOLLOWS {
            match open(held, relative) {
                Err(Refusal::Io(e)) if e.kind() == io::ErrorKind::NotFound => return Err(Refusal::Io(e)),
                // Perhaps of a link.
                Err(_) => {}
                opened => return opened,
            }
        }
        open(held, &self.without_links(relative)?)
    }

    /// The place that the links of `relative` lead to, relative to the root.
    fn without_links(&self, relative: &Path) -> Result<PathBuf, Refusal> {
        match self.path(relative).canonicalize() {
            Ok(real) => real.strip_prefix(&self.inner.root).map(Path::to_path_buf).map_err(|_| Refusal::Outside),
            // What cannot be looked at behind a link that leads out is outside all the same.
            Err(e) => match relative.parent() {
                Some(parent) => self.without_links(parent).and(Err(Refusal::Io(e))),
                None => Err(Refusal::Io(e)),
            },
        }
    }
}

#[cfg(unix)]
pub(crate) mod platform {
    use std::ffi::{OsStr, OsString};
    use std::fs::File;
    use std::io;
    use std::os::fd::{AsFd, OwnedFd};
    use std::os::unix::ffi::OsStrExt as _;
    use std::path::Path;

    use rustix::fs::{CWD, Dir, FileType, Mode, OFlags, openat};
    #[cfg(target_os = "linux")]
    use rustix::fs::{ResolveFlags, openat2};
    use rustix::io::{Errno, retry_on_intr};

    use super::Refusal;

    pub(super) const NEVER_FOLLOWS: bool = true;

    /// Without waiting: a FIFO opens at once and is told from a file afterwards.
    const READ: OFlags = OFlags::RDONLY.union(OFlags::CLOEXEC).union(OFlags::NONBLOCK).union(OFlags::NOCTTY);

    /// The root, as it was when the jail was made.
    #[derive(Debug)]
    pub(super) struct Held {
        root: OwnedFd,
        /// The system goes all of a way in one call, if told so without following links.
        pub(super) at_once: bool,
    }

    impl Held {
        pub(super) fn new(root: &Path) -> io::Result<Self> {
            let root = open_at(CWD, root.as_os_str(), OFlags::DIRECTORY)?;
            // Old kernels cannot, and some containers forbid it.
            let at_once = without_links(&root, Path::new(".")).is_ok();
            Ok(Self { root, at_once })
        }

        /// No component may be a link. An empty path is the root.
        pub(super) fn open(&self, relative: &Path) -> Result<File, Refusal> {
            self.walk(relative).map(File::from).map_err(|errno| match errno {
                // A folder on the way that is a link is not said to be one, but to be no folder.
                Errno::LOOP | Errno::MLINK | Errno::NOTDIR => Refusal::Outside,
                errno => Refusal::Io(errno.into()),
            })
        }

        fn walk(&self, relative: &Path) -> rustix::io::Result<OwnedFd> {
            if self.at_once && !relative.as_os_str().is_empty() {
                return without_links(&self.root, relative);
            }
            let mut components = relative.components().peekable();
            let mut at = open_at(&self.root, OsStr::new("."), OFlags::DIRECTORY)?;
            while let Some(component) = components.next() {
                let kind = if components.peek().is_some() { OFlags::DIRECTORY } else { OFlags::empty() };
                at = open_at(&at, component.as_os_str(), OFlags::NOFOLLOW | kind)?;
            }
            Ok(at)
        }

        pub(super) fn entries(&self, relative: &Path) -> Result<impl Iterator<Item = OsString> + use<>, Refusal> {
            let folder = self.open(relative)?;
            if !folder.metadata().map_err(Refusal::Io)?.is_dir() {
                return Err(Refusal::Io(Errno::NOTDIR.into()));
            }
            let folder = Dir::new(folder).map_err(|errno| Refusal::Io(errno.into()))?;
            Ok(folder.filter_map(|entry| {
                let entry = entry.ok()?;
                let name = OsStr::from_bytes(entry.file_name().to_bytes());
                let may_be_folder =
                    matches!(entry.file_type(), FileType::Directory | FileType::Symlink | FileType::Unknown);
                (may_be_folder && name != "." && name != "..").then(|| name.to_owned())
            }))
        }
    }

    fn open_at(folder: impl AsFd, name: &OsStr, flags: OFlags) -> rustix::io::Result<OwnedFd> {
        retry_on_intr(|| openat(folder.as_fd(), name, READ | flags, Mode::empty()))
    }

    #[cfg(target_os = "linux")]
    fn without_links(folder: &OwnedFd, relative: &Path) -> rustix::io::Result<OwnedFd> {
        let resolve = ResolveFlags::BENEATH | ResolveFlags::NO_SYMLINKS;
        retry_on_intr(|| openat2(folder, relative, READ, Mode::empty(), resolve))
    }

    #[cfg(not(target_os = "linux"))]
    fn without_links(_: &OwnedFd, _: &Path) -> rustix::io::Result<OwnedFd> {
        Err(Errno::NOSYS)
    }

    /// Links are followed.
    pub(in super::super) fn open_free(path: &Path) -> io::Result<File> {
        Ok(open_at(CWD, path.as_os_str(), OFlags::empty())?.into())
    }
}

#[cfg(not(unix))]
pub(super) mod platform {
    use std::ffi::OsString;
    use std::fs::File;
    use std::io;
    use std::path::{Path, PathBuf};

    use super::Refusal;

    pub(super) const NEVER_FOLLOWS: bool = false;

    #[derive(Debug)]
    pub(super) struct Held(PathBuf);

    impl Held {
        pub(super) fn new(root: &Path) -> io::Result<Self> {
            std::fs::read_dir(root)?;
            Ok(Self(root.to_path_buf()))
        }

        pub(super) fn open(&self, relative: &Path) -> Result<File, Refusal> {
            open_free(&self.0.join(relative)).map_err(Refusal::Io)
        }

        pub(super) fn entries(&self, relative: &Path) -> Result<impl Iterator<Item = OsString> + use<>, Refusal> {
            let folder = std::fs::read_dir(self.0.join(relative)).map_err(Refusal::Io)?;
            Ok(folder.flatten().filter(|e| e.file_type().is_ok_and(|t| !t.is_file())).map(|e| e.file_name()))
        }
    }

    #[expect(clippy::disallowed_methods, reason = "the door of stores, where there are no FIFOs among files")]
    pub(in super::super) fn open_free(path: &Path) -> io::Result<File> {
        File::open(path)
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests;

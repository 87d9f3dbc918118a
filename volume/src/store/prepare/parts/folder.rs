//! Where parts lie until they are joined: `.NAME.brickcast-parts/I-of-N/` beside the store, each with `part/`, which is
//! finished or absent as a store is, and `scan.json` where voxels are mapped.
//!
//! Whoever makes a part has its own folder to itself: makers of different parts share nothing, whatever the file system
//! thinks of locks.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::error::{PartsError, listed};
use super::number::PartNumber;
use crate::ids::StoreHash;
use crate::small_file;
use crate::store::error::StoreError;
use crate::store::files::abandoned::remove_leftovers;
use crate::store::files::shape::StoreShape;
use crate::store::files::walk;
use crate::unfinished::Unfinished;

/// What a scan of a part found.
const SCAN_FILE: &str = "scan.json";
const LOCK_FILE: &str = "lock";
/// The hash of the store that the parts became, from just before it is there.
const JOINED_FILE: &str = "joined";

pub(super) struct PartsFolder {
    pub(super) path: PathBuf,
}

impl PartsFolder {
    /// Beside `store`; nothing where that is no name of a store.
    pub(super) fn place(store: &Path) -> Option<PathBuf> {
        let mut name = OsString::from(".");
        name.push(store.file_name()?);
        name.push(".brickcast-parts");
        Some(store.with_file_name(name))
    }

    pub(super) fn of(store: &Path) -> Result<Self, StoreError> {
        let unusable = || StoreError::Target { path: store.to_path_buf(), why: "it has no last component" };
        Ok(Self { path: Self::place(store).ok_or_else(unusable)? })
    }

    /// Where it is not there.
    pub(super) fn create(&self) -> Result<(), StoreError> {
        created(&self.path)
    }

    /// The folder of a part, which is there then.
    pub(super) fn make(&self, part: PartNumber) -> Result<PathBuf, StoreError> {
        self.create()?;
        let own = self.path.join(part.folder());
        created(&own).map(|()| own)
    }

    /// Where a part is once it is finished.
    pub(super) fn part(&self, part: PartNumber) -> PathBuf {
        self.path.join(part.folder()).join("part")
    }

    pub(super) fn scan(&self, part: PartNumber) -> PathBuf {
        self.path.join(part.folder()).join(SCAN_FILE)
    }

    /// The one division that all parts here are of, as the number of its parts; nothing where there are none.
    pub(super) fn division(&self) -> Result<Option<u32>, StoreError> {
        let entries = match fs::read_dir(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            entries => entries.map_err(StoreError::io("list", &self.path))?,
        };
        let mut counts = Vec::new();
        for entry in entries {
            let name = entry.map_err(StoreError::io("list", &self.path))?.file_name();
            let part = name.to_str().and_then(PartNumber::of_folder);
            // What was begun and not finished is of no division yet.
            let is_begun = |part: &PartNumber| !self.part(*part).exists() && !self.scan(*part).exists();
            counts.extend(part.filter(|part| !is_begun(part)).map(|part| part.count));
        }
        counts.sort_unstable();
        counts.dedup();
        match counts[..] {
            [] => Ok(None),
            [count] => Ok(Some(count)),
            _ => {
                Err(PartsError::Divisions { divisions: format!("into {}", listed(&counts)), folder: self.path.clone() }
                    .into())
            }
        }
    }

    /// Kept as long as parts are joined: nobody else joins them meanwhile, where the file system has locks.
    pub(super) fn lock(&self) -> Result<File, StoreError> {
        let path = self.path.join(LOCK_FILE);
        let lock = File::options().write(true).create(true).truncate(false).open(&path);
        let lock = lock.map_err(StoreError::io("create", &path))?;
        match lock.try_lock() {
            Err(fs::TryLockError::WouldBlock) => Err(PartsError::InUse { folder: self.path.clone() }.into()),
            _ => Ok(lock),
        }
    }

    /// Keeps in mind, before the store appears at its place, which one the parts were joined to.
    pub(super) fn note_joined(&self, store: StoreHash) -> Result<(), StoreError> {
        let path = self.path.join(JOINED_FILE);
        let written = Unfinished::create(&path).and_then(|mut file| {
            file.write_all(store.to_string().as_bytes())?;
            file.finish()
        });
        written.map_err(StoreError::io("write", &path))
    }

    /// True where the parts here were joined to this store, and are of no use any more.
    pub(super) fn is_joined_to(&self, store: StoreHash) -> bool {
        let noted = small_file::read("note of a store", &self.path.join(JOINED_FILE), 64);
        noted.is_ok_and(|noted| noted == store.to_string().as_bytes())
    }

    /// Removes a part that is of no use.
    pub(super) fn remove_part(&self, part: PartNumber) -> Result<(), StoreError> {
        let path = self.part(part);
        match fs::symlink_metadata(&path) {
            Ok(_) => walk::remove(&path, &StoreShape::any()).map(drop),
            Err(_) => Ok(()),
        }
    }

    /// Removes all parts that were joined, and the folder. What is of nobody's making stays, and the folder with it.
    pub(super) fn remove(&self, count: u32) {
        for part in PartNumber::all(count) {
            let _ = self.remove_part(part);
            let _ = fs::remove_file(self.scan(part));
            let own = self.path.join(part.folder());
            remove_leftovers(&own);
            let _ = fs::remove_dir(own);
        }
        remove_leftovers(&self.path);
        for file in [LOCK_FILE, JOINED_FILE] {
            let _ = fs::remove_file(self.path.join(file));
        }
        let _ = fs::remove_dir(&self.path);
    }
}

/// Several makers of parts may make a folder at once.
fn created(folder: &Path) -> Result<(), StoreError> {
    match fs::create_dir(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => Err(StoreError::io("create", folder)(error)),
        _ => Ok(()),
    }
}

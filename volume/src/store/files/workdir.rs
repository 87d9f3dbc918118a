//! A store is finished or absent: it is written in a working directory beside its target and renamed at the end.
//!
//! `.NAME.brickcast-tmp-PID-N/` holds `lock` (held while its writer lives), `store/` (being written), scratch files
//! and, for the moment of replacing one, `old/`, which is `gone/` once it was replaced. A working directory whose lock is
//! free was left by a writer that was killed: the next writer for the same target puts `old/`, which is whole, back where
//! the target is gone, and whoever writes in that folder next removes the rest.
//!
//! Nothing is ever removed that no store has: a folder that holds anything else is refused, before the work and again
//! before the old store goes; of what dead writers left, it stays.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::abandoned::{GONE, MARK, clear, clear_scratch, recover, remove_leftovers};
use super::lock::locked;
use super::shape::StoreShape;
use super::walk::Found;
use crate::leftovers::{self, Listed};
use crate::store::error::StoreError;
use crate::unfinished::sweep_once;

#[derive(Debug)]
pub(crate) struct WorkDir {
    target: PathBuf,
    parent: PathBuf,
    dir: PathBuf,
    /// Of a series, the step that is being made.
    step: Option<String>,
    force: bool,
    /// Kept open, and so locked, as long as the directory is ours.
    lock: Option<File>,
    /// Set where the directory holds something that must not be removed.
    keep: bool,
    /// A signal that ends the process removes the directory.
    listed: Option<Listed>,
}

impl WorkDir {
    /// Checks the target, and makes an empty directory for the store beside it.
    pub(crate) fn create(target: &Path, force: bool) -> Result<Self, StoreError> {
        let unusable = |why| StoreError::Target { path: target.to_path_buf(), why };
        let name = target.file_name().ok_or_else(|| unusable("it has no last component"))?;
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        if !parent.is_dir() {
            return Err(unusable("the directory that it would be in does not exist; create it first"));
        }
        let mut prefix = OsString::from(".");
        prefix.push(name);
        prefix.push(MARK);
        recover(target, &parent, &prefix);
        remove_leftovers(&parent);
        sweep_once(&parent);
        check_target(target, force)?;
        for _ in 0..10_000 {
            // No name twice: whoever still looks at what had it would meddle with what has it now.
            static COUNTER: AtomicU32 = AtomicU32::new(0);
            let n = COUNTER.fetch_add(1, Ordering::Relaxed);
            let mut dir_name = prefix.clone();
            dir_name.push(format!("{}-{n}", std::process::id()));
            let dir = parent.join(dir_name);
            let listed = match Listed::making(&dir, || fs::create_dir(&dir)) {
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
                made => Some(made.map_err(StoreError::io("create", &dir))?.1),
            };
            let lock = match locked(&dir) {
                Ok(Some(lock)) => Some(lock),
                // Somebody has taken it for a dead writer's.
                Ok(None) => continue,
                Err(error) => {
                    clear(&dir);
                    return Err(StoreError::io("create a lock in", &dir)(error));
                }
            };
            let work = Self { target: target.to_path_buf(), parent, dir, step: None, force, lock, keep: false, listed };
            fs::create_dir(work.store()).map_err(StoreError::io("create", &work.store()))?;
            return Ok(work);
        }
        Err(unusable("ten thousand working directories of killed writers lie beside it; remove them"))
    }

    /// Where the store's files are written until it is published.
    pub(crate) fn store(&self) -> PathBuf {
        let root = self.dir.join("store");
        self.step.as_ref().map_or(root.clone(), |step| root.join(step))
    }

    /// From now on [`WorkDir::store`] is that of a step of a series.
    pub(crate) fn enter(&mut self, step: usize) -> Result<(), StoreError> {
        self.step = Some(step.to_string());
        fs::create_dir(self.store()).map_err(StoreError::io("create", &self.store()))
    }

    /// The step is made: its scratch files go, and [`WorkDir::store`] is the series again.
    pub(crate) fn leave(&mut self) {
        self.step = None;
        clear_scratch(&self.dir);
    }

    /// Where files are that live no longer than the work.
    pub(crate) fn scratch(&self) -> PathBuf {
        self.dir.clone()
    }

    /// Makes the finished store appear at its target, in place of an old one where that was allowed.
    pub(crate) fn publish(mut self) -> Result<(), StoreError> {
        sync_directories(&self.store())?;
        // A signal in the middle would take the old store with the directory.
        match self.listed.take() {
            Some(listed) => listed.settle(|| self.put_in_place())?,
            None => self.put_in_place()?,
        }
        sync_directory(&self.parent)
    }

    fn put_in_place(&mut self) -> Result<(), StoreError> {
        let staged = self.store();
        if is_there(&self.target, self.force)? {
            let old = self.dir.join("old");
            fs::rename(&self.target, &old).map_err(StoreError::io("move away", &self.target))?;
            // Looked at where nobody puts anything any more: what came since the first look is seen.
            let kept = foreign_in(&old, &self.target);
            let put = kept.and_then(|()| {
                fs::rename(&staged, &self.target).map_err(StoreError::io("put the finished store at", &self.target))
            });
            if let Err(error) = put {
                if let Err(source) = fs::rename(&old, &self.target) {
                    self.keep = true;
                    return Err(StoreError::Stranded { target: self.target.clone(), old, source });
                }
                return Err(error);
            }
            // Never put back from now on: where its removal ends half way, it is a store no more.
            self.keep = fs::rename(&old, self.dir.join(GONE)).is_err();
        } else {
            fs::rename(&staged, &self.target).map_err(StoreError::io("put the finished store at", &self.target))?;
        }
        Ok(())
    }
}

impl Drop for WorkDir {
    fn drop(&mut self) {
        if !self.keep {
            // An old store that was replaced takes a while: a signal goes on with it.
            let list = || Listed::making(&self.dir, || Ok::<_, io::Error>(())).ok().map(|made| made.1);
            let _listed = self.listed.take().or_else(list);
            // Under its lock, which goes with it: nobody else clears what takes the name next. What cannot be removed
            // now is removed by the next writer.
            clear(&self.dir);
            drop(self.lock.take());
        }
    }
}

/// True where there is a folder at `target` that may be replaced if it is a store, false where there is nothing.
fn is_there(target: &Path, force: bool) -> Result<bool, StoreError> {
    let not_ours = |why| Err(StoreError::NotOurs { path: target.to_path_buf(), why });
    let metadata = match fs::symlink_metadata(target) {
        Ok(metadata) => metadata,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(false),
        Err(e) => return Err(StoreError::io("look at", target)(e)),
    };
    if !force {
        return Err(StoreError::Exists { path: target.to_path_buf() });
    }
    if metadata.is_symlink() {
        return not_ours("it is a symbolic link; name the store itself");
    }
    if !metadata.is_dir() {
        return not_ours("it is no directory");
    }
    Ok(true)
}

/// An error where `folder`, called `name` in it, is no store, or holds anything that no store has there.
fn foreign_in(folder: &Path, name: &Path) -> Result<(), StoreError> {
    let Some(shape) = StoreShape::in_folder(folder) else {
        return Err(StoreError::NotOurs { path: name.to_path_buf(), why: "it has no manifest of one" });
    };
    match Found::below(folder, &shape)?.not_ours() {
        Some(what) => Err(StoreError::Foreign { path: name.to_path_buf(), what }),
        None => Ok(()),
    }
}

/// An error where no store can be put at `target` in the end, as far as that is known already.
pub(crate) fn check_target(target: &Path, force: bool) -> Result<(), StoreError> {
    match is_there(target, force)? {
        true => foreign_in(target, target),
        false => Ok(()),
    }
}

/// An error where one of `inputs` lies in the folder at `target`, which would go with it.
pub(crate) fn check_inputs(target: &Path, inputs: &[PathBuf]) -> Result<(), StoreError> {
    // Where nothing is there yet, nothing is in it.
    let Ok(folder) = target.canonicalize() else { return Ok(()) };
    let inside = |input: &&PathBuf| input.canonicalize().is_ok_and(|place| place.starts_with(&folder));
    match inputs.iter().find(inside) {
        Some(input) => Err(StoreError::InputInside { input: input.clone(), target: target.to_path_buf() }),
        None => Ok(()),
    }
}

/// A folder for files that live no longer than this, beside `target`; what a killed process left of one goes as a
/// working directory does.
#[derive(Debug)]
pub struct ScratchFolder(WorkDir);

impl ScratchFolder {
    /// # Errors
    /// A folder that is missing or cannot be written.
    pub fn beside(target: &Path) -> Result<Self, StoreError> {
        WorkDir::create(target, true).map(Self)
    }

    #[must_use]
    pub fn path(&self) -> PathBuf {
        self.0.scratch()
    }
}

/// Writes a file of a store and brings it to the disk.
pub(crate) fn write_synced(path: &Path, content: &[u8]) -> Result<(), StoreError> {
    if let Some(dir) = path.parent() {
        leftovers::create_dir_all(dir).map_err(StoreError::io("create", dir))?;
    }
    let written = File::create_new(path).and_then(|mut file| {
        file.write_all(content)?;
        file.sync_all()
    });
    written.map_err(StoreError::io("write", path))
}

/// Brings a directory's entries to the disk.
fn sync_directory(path: &Path) -> Result<(), StoreError> {
    if cfg!(unix) {
        #[expect(clippy::disallowed_methods, reason = "a folder, to bring its entries to the disk")]
        let synced = File::open(path).and_then(|dir| dir.sync_all());
        synced.map_err(StoreError::io("sync", path))?;
    }
    Ok(())
}

/// [`sync_directory`] for `root` and every directory below; at most eight of them on a way, as a series has.
fn sync_directories(root: &Path) -> Result<(), StoreError> {
    let mut open = vec![root.to_path_buf()];
    while let Some(dir) = open.pop() {
        for entry in fs::read_dir(&dir).map_err(StoreError::io("list", &dir))? {
            let entry = entry.map_err(StoreError::io("list", &dir))?;
            if entry.file_type().map_err(StoreError::io("look at", &entry.path()))?.is_dir() {
                open.push(entry.path());
            }
        }
        sync_directory(&dir)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::profile::MANIFEST_FILE;

    const OURS: &str = r#"{ "format": "brickcast-store", "version": 1 }"#;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_abandoned_writer_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let work = WorkDir::create(&dir.path().join("s"), false).unwrap();
        fs::write(work.store().join("zarr.json"), b"half").unwrap();
        assert_eq!(names(dir.path()).len(), 1);
        drop(work);
        assert!(names(dir.path()).is_empty());
    }

    #[test]
    fn a_killed_writer_is_cleaned_up_and_its_old_store_put_back() {
        let dir = tempfile::tempdir().unwrap();
        let dead = dir.path().join(".s.brickcast-tmp-1-0");
        fs::create_dir_all(dead.join("old")).unwrap();
        fs::write(dead.join("old").join(MANIFEST_FILE), OURS).unwrap();
        fs::write(dead.join("lock"), b"").unwrap();
        let target = dir.path().join("s");
        assert!(matches!(WorkDir::create(&target, false), Err(StoreError::Exists { .. })));
        assert_eq!(names(dir.path()), ["s"]);
        assert_eq!(fs::read_to_string(target.join(MANIFEST_FILE)).unwrap(), OURS);
    }

    #[test]
    fn a_scratch_folder_goes_with_all_that_is_in_it() {
        let dir = tempfile::tempdir().unwrap();
        let scratch = ScratchFolder::beside(&dir.path().join("x")).unwrap();
        fs::write(scratch.path().join("phantom.nrrd"), b"voxels").unwrap();
        drop(scratch);
        assert!(names(dir.path()).is_empty());
    }

    #[test]
    fn a_living_writer_is_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s");
        let first = WorkDir::create(&target, false).unwrap();
        let second = WorkDir::create(&target, false).unwrap();
        assert!(first.store().is_dir() && second.store().is_dir());
        first.publish().unwrap();
        assert!(matches!(second.publish(), Err(StoreError::Exists { .. })));
        assert_eq!(names(dir.path()), ["s"]);
    }

    #[test]
    fn force_replaces_only_stores() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("thesis.tex"), b"years of work").unwrap();
        assert!(matches!(WorkDir::create(&target, false), Err(StoreError::Exists { .. })));
        assert!(matches!(WorkDir::create(&target, true), Err(StoreError::NotOurs { .. })));
        fs::write(target.join(MANIFEST_FILE), OURS).unwrap();
        let Err(StoreError::Foreign { what, .. }) = WorkDir::create(&target, true) else { panic!("thesis lost") };
        assert_eq!(what, "thesis.tex");
        fs::rename(target.join("thesis.tex"), dir.path().join("thesis.tex")).unwrap();
        fs::create_dir_all(target.join("0/c/1/2")).unwrap();
        fs::write(target.join("0/c/1/2/3"), b"shard").unwrap();
        let work = WorkDir::create(&target, true).unwrap();
        assert_eq!(names(&target), ["0", MANIFEST_FILE], "the old store stays until the end");
        fs::write(work.store().join("zarr.json"), b"").unwrap();
        work.publish().unwrap();
        assert_eq!(names(&target), ["zarr.json"]);
        assert_eq!(names(dir.path()), ["s", "thesis.tex"]);
    }

    #[test]
    fn what_is_put_into_the_old_store_while_the_new_one_is_made_is_not_lost() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s");
        fs::create_dir(&target).unwrap();
        fs::write(target.join(MANIFEST_FILE), OURS).unwrap();
        let work = WorkDir::create(&target, true).unwrap();
        fs::write(target.join("thesis.tex"), b"years of work").unwrap();
        assert!(matches!(work.publish(), Err(StoreError::Foreign { .. })));
        assert_eq!(names(&target), [MANIFEST_FILE, "thesis.tex"]);
        assert_eq!(names(dir.path()), ["s"]);
    }

    #[test]
    fn what_lies_with_a_dead_writers_old_store_stays_there() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s");
        let dead = dir.path().join(".s.brickcast-tmp-1-0");
        fs::create_dir_all(dead.join("old/notes")).unwrap();
        fs::write(dead.join("old").join(MANIFEST_FILE), OURS).unwrap();
        fs::write(dead.join("old/notes/thesis.tex"), b"years of work").unwrap();
        fs::write(dead.join("voxels"), b"scratch").unwrap();
        fs::write(dead.join("lock"), b"").unwrap();
        fs::create_dir(&target).unwrap();
        fs::write(target.join(MANIFEST_FILE), OURS).unwrap();
        WorkDir::create(&target, true).unwrap().publish().unwrap();
        assert_eq!(names(&dead), ["lock", "old"]);
        assert_eq!(names(&dead.join("old")), [MANIFEST_FILE, "notes"]);
        fs::remove_dir_all(dead.join("old/notes")).unwrap();
        drop(WorkDir::create(&target, true));
        assert_eq!(names(dir.path()), ["s"]);
    }

    #[test]
    fn an_input_in_the_folder_to_be_replaced_is_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("s");
        let (inside, beside) = (target.join("scan.raw"), dir.path().join("s.raw"));
        fs::create_dir(&target).unwrap();
        fs::write(&inside, b"").unwrap();
        fs::write(&beside, b"").unwrap();
        check_inputs(&target, std::slice::from_ref(&beside)).unwrap();
        check_inputs(&dir.path().join("new"), &[beside.clone(), inside.clone()]).unwrap();
        let error = check_inputs(&target, &[beside, dir.path().join("s/../s/scan.raw")]).unwrap_err().to_string();
        assert!(error.contains("s/../s/scan.raw lies in"), "{error}");
    }

    #[test]
    fn targets_without_name_or_parent_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        for bad in [dir.path().join(".."), dir.path().join("a/b"), PathBuf::from("/")] {
            assert!(matches!(WorkDir::create(&bad, true), Err(StoreError::Target { .. })), "{bad:?}");
        }
    }
}

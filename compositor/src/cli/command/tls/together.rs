//! Files that are of use only together: all of them are there, or what was there before is.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use brickcast_volume::leftovers::Listed;
use brickcast_volume::unfinished::is_settled;

/// Before a writer's number in the name of the folder where files wait.
const STAGE: &str = ".brickcast-new-";
/// Held in it while its writer lives.
const LOCK: &str = "lock";
/// There from when the first file is about to take its place.
const MOVING: &str = "moving";

/// A file to be.
#[derive(Debug)]
pub(crate) struct NewFile {
    pub(crate) name: &'static str,
    pub(crate) content: String,
    /// Who may read it, as the system has it.
    pub(crate) mode: u32,
}

/// Writes all files into a folder beside the old ones, never readable by others on the way; then they change places.
/// `dir` is made where it is missing, and goes again where this fails.
///
/// # Errors
/// A folder that cannot be made or written, a full disk, a folder in a file's place.
pub(crate) fn write_together(dir: &Path, files: &[NewFile]) -> anyhow::Result<()> {
    let is_new = !dir.exists();
    fs::create_dir_all(dir).with_context(|| format!("{}: cannot make the folder", dir.display()))?;
    let written = staged(dir, files);
    if is_new && written.is_err() {
        // Only where it is empty; what others have put there meanwhile stays.
        let _ = fs::remove_dir(dir);
    }
    written
}

fn staged(dir: &Path, files: &[NewFile]) -> anyhow::Result<()> {
    if let Some(folder) = files.iter().map(|file| dir.join(file.name)).find(|path| path.is_dir()) {
        return Err(anyhow!("{}: is a folder, where a file is to be; move it away", folder.display()));
    }
    // In the folder itself: it may be a mount of its own, and the one above it not writable.
    let stage = dir.join(format!("{STAGE}{}", std::process::id()));
    let making = Listed::making(&stage, || fs::create_dir(&stage).and_then(|()| File::create_new(stage.join(LOCK))));
    let (lock, listed) = making.with_context(|| format!("{}: cannot be made", stage.display()))?;
    // File systems without locks: the folder is then never taken for a dead one's either.
    let _ = lock.try_lock();
    let written = files.iter().try_for_each(|file| write(&stage, file));
    // A signal in the middle of this would leave some of each.
    let moved = listed.settle(|| {
        let moved = written.and_then(|()| change_places(dir, &stage, files));
        let _ = fs::remove_dir_all(&stage);
        moved
    });
    sync(dir);
    moved
}

fn write(stage: &Path, file: &NewFile) -> anyhow::Result<()> {
    let path = stage.join(file.name);
    let mut options = File::options();
    options.write(true).create_new(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt as _;
        options.mode(file.mode);
    }
    let written = options.open(&path).and_then(|mut out| {
        out.write_all(file.content.as_bytes())?;
        out.sync_all()
    });
    written.with_context(|| format!("{}: cannot be written", path.display()))
}

/// Where an old file waits.
fn aside(stage: &Path, name: &str) -> PathBuf {
    stage.join(format!("{name}.old"))
}

/// Finishes what a killed process left in `dir`, or takes it back: the files called `names` are all of one time then,
/// or were never there. What cannot be put right stays as it is.
pub(crate) fn recover(dir: &Path, names: &[&str]) {
    for entry in fs::read_dir(dir).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some(process) = name.to_str().and_then(|name| name.strip_prefix(STAGE)?.parse::<u32>().ok()) else {
            continue;
        };
        let stage = entry.path();
        let lock = File::options().write(true).open(stage.join(LOCK));
        // The lock of one that lives is held, by whichever machine. One that has just begun may not have it yet.
        if !is_settled(&stage, process) || !lock.is_ok_and(|lock| lock.try_lock().is_ok()) {
            continue;
        }
        if stage.join(MOVING).exists() && names.iter().any(|name| stage.join(name).exists()) {
            names.iter().for_each(|name| take_back(dir, &stage, name));
        }
        let _ = fs::remove_dir_all(&stage);
    }
}

/// Gives one of some files that were about to change places its old content, or none.
fn take_back(dir: &Path, stage: &Path, name: &str) {
    let (path, old) = (dir.join(name), aside(stage, name));
    let is_moved = !stage.join(name).exists();
    if fs::rename(&old, &path).is_err_and(|error| error.kind() == io::ErrorKind::NotFound) && is_moved {
        let _ = fs::remove_file(&path);
    }
}

fn change_places(dir: &Path, stage: &Path, files: &[NewFile]) -> anyhow::Result<()> {
    File::create_new(stage.join(MOVING)).with_context(|| format!("{}: cannot be written", stage.display()))?;
    sync(stage);
    for (done, file) in files.iter().enumerate() {
        let (path, old) = (dir.join(file.name), aside(stage, file.name));
        let kept = match fs::rename(&path, &old) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        };
        if let Err(error) = kept.and_then(|()| fs::rename(stage.join(file.name), &path)) {
            // Of the one that failed, perhaps neither was moved.
            files[..=done].iter().for_each(|file| take_back(dir, stage, file.name));
            return Err(error).with_context(|| format!("{}: cannot be replaced", path.display()));
        }
    }
    Ok(())
}

/// Names to the disk; where that fails, they are there all the same.
fn sync(dir: &Path) {
    #[cfg(unix)]
    if let Ok(dir) = File::options().read(true).open(dir) {
        let _ = dir.sync_all();
    }
    #[cfg(not(unix))]
    let _ = dir;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(content: &str) -> Vec<NewFile> {
        ["a", "b", "c"].map(|name| NewFile { name, content: content.to_owned(), mode: 0o600 }).into()
    }

    fn there(dir: &Path) -> Vec<(String, String)> {
        let entries = fs::read_dir(dir).unwrap().map(|e| e.unwrap());
        let mut found: Vec<_> = entries
            .map(|e| (e.file_name().into_string().unwrap(), fs::read_to_string(e.path()).unwrap_or_default()))
            .collect();
        found.sort();
        found
    }

    fn all(content: &str) -> Vec<(String, String)> {
        ["a", "b", "c"].map(|name| (name.to_owned(), content.to_owned())).into()
    }

    #[test]
    fn all_files_are_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path().join("x/tls");
        write_together(&dir, &files("one")).unwrap();
        assert_eq!(there(&dir), all("one"));
        write_together(&dir, &files("two")).unwrap();
        assert_eq!(there(&dir), all("two"));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            assert_eq!(fs::metadata(dir.join("a")).unwrap().permissions().mode() & 0o777, 0o600);
        }
    }

    /// Keys of one authority beside certificates of another fit nothing.
    #[test]
    fn a_write_that_fails_leaves_the_old_files_or_none() {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path().join("tls");
        write_together(&dir, &files("one")).unwrap();
        let mut broken = files("two");
        broken[2].name = "no/such";
        assert!(write_together(&dir, &broken).is_err());
        assert_eq!(there(&dir), all("one"));
        let fresh = folder.path().join("fresh");
        assert!(write_together(&fresh, &broken).is_err());
        assert!(!fresh.exists());
    }

    #[cfg(unix)]
    fn killed(dir: &Path, moving: bool) -> PathBuf {
        let mut gone = std::process::Command::new("true").spawn().unwrap();
        gone.wait().unwrap();
        let stage = dir.join(format!("{STAGE}{}", gone.id()));
        fs::create_dir(&stage).unwrap();
        fs::write(stage.join(LOCK), "").unwrap();
        if moving {
            fs::write(stage.join(MOVING), "").unwrap();
        }
        stage
    }

    /// Killed while the files were written, while they changed places (over old ones, and over none), and after that.
    #[cfg(unix)]
    #[test]
    fn what_a_killed_one_left_is_taken_back_or_was_finished() {
        let names = ["a", "b", "c"];
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path();
        write_together(dir, &files("one")).unwrap();
        let fill = |stage: &Path, names: &[&str], content: &str| {
            names.iter().for_each(|name| fs::write(stage.join(name), content).unwrap());
        };
        fill(&killed(dir, false), &["a"], "two");
        recover(dir, &names);
        assert_eq!(there(dir), all("one"));

        let stage = killed(dir, true);
        fill(&stage, &["a.old", "b.old"], "one");
        fill(&stage, &["b", "c"], "two");
        fs::write(dir.join("a"), "two").unwrap();
        fs::remove_file(dir.join("b")).unwrap();
        recover(dir, &names);
        assert_eq!(there(dir), all("one"));

        let stage = killed(dir, true);
        fill(&stage, &["a.old", "b.old", "c.old"], "zero");
        recover(dir, &names);
        assert_eq!(there(dir), all("one"), "all had changed places");

        let fresh = dir.join("fresh");
        fs::create_dir(&fresh).unwrap();
        let stage = killed(&fresh, true);
        fill(&fresh, &["a"], "two");
        fill(&stage, &["b", "c"], "two");
        recover(&fresh, &names);
        assert!(there(&fresh).is_empty(), "{:?}", there(&fresh));

        // One that lives elsewhere holds its lock.
        let stage = killed(&fresh, false);
        let lock = File::options().write(true).open(stage.join(LOCK)).unwrap();
        lock.try_lock().unwrap();
        recover(&fresh, &names);
        assert!(stage.is_dir());
    }

    /// The last rename fails, after the others were done.
    #[test]
    fn what_was_replaced_already_is_put_back() {
        let folder = tempfile::tempdir().unwrap();
        let (dir, stage) = (folder.path().join("tls"), folder.path().join("tls/stage"));
        fs::create_dir_all(&stage).unwrap();
        fs::write(dir.join("a"), "one").unwrap();
        for name in ["a", "b"] {
            fs::write(stage.join(name), "two").unwrap();
        }
        assert!(change_places(&dir, &stage, &files("two")).is_err(), "there is no c");
        fs::remove_dir_all(&stage).unwrap();
        assert_eq!(there(&dir), [("a".to_owned(), "one".to_owned())]);
    }
}

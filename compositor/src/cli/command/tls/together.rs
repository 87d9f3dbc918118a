//! Files that are of use only together: all of them are there, or what was there before is.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use brickcast_volume::leftovers::Listed;

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
    let stage = dir.join(format!(".brickcast-new-{}", std::process::id()));
    let making = Listed::making(&stage, || fs::create_dir(&stage));
    let ((), listed) = making.with_context(|| format!("{}: cannot be made", stage.display()))?;
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

fn change_places(dir: &Path, stage: &Path, files: &[NewFile]) -> anyhow::Result<()> {
    for (done, file) in files.iter().enumerate() {
        let (path, old) = (dir.join(file.name), aside(stage, file.name));
        let kept = match fs::rename(&path, &old) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        };
        if let Err(error) = kept.and_then(|()| fs::rename(stage.join(file.name), &path)) {
            for file in &files[..=done] {
                let (path, old) = (dir.join(file.name), aside(stage, file.name));
                // Of the one that failed, perhaps neither was moved.
                if fs::rename(&old, &path).is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
                    let _ = if stage.join(file.name).exists() { Ok(()) } else { fs::remove_file(&path) };
                }
            }
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

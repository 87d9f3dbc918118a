//! What a prepared store depends on, written out: two inputs with the same key give the same store.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;

/// The longest part of an entry's name that is the input's: file systems end at 255 bytes, and working folders need
/// some of them.
const MAX_STEM: usize = 100;

/// Changes whenever the prepared store would.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Key {
    /// Of the entry.
    pub(super) name: String,
    /// A line for each file, and one for all options.
    pub(super) text: String,
}

impl Key {
    /// Of `input`, which is read from `files`: place, size, times and identity of each, and `options` in words. Of a
    /// folder, those of all that lies in it, as one number.
    ///
    /// # Errors
    /// One of the files is not there, or cannot be looked at.
    pub(crate) fn new(input: &Path, files: &[PathBuf], options: &str) -> anyhow::Result<Self> {
        let mut text = format!("options {options:?}\n");
        for file in files {
            let place = file.canonicalize().with_context(|| format!("{}: cannot be found", file.display()))?;
            let data = place.metadata().with_context(|| format!("{}: cannot be read", file.display()))?;
            if data.is_dir() {
                let (count, sum) = folder(&place).with_context(|| format!("{}: cannot be listed", file.display()))?;
                writeln!(text, "file {place:?}, {count} files in it, modified as {sum:016x}")
                    .map_err(anyhow::Error::new)?;
                continue;
            }
            // In quotes, with what is special escaped: a line is a line, whatever a file is called.
            let (bytes, modified, identity) = (data.len(), data.modified().ok(), identity(&data));
            writeln!(text, "file {place:?}, {bytes} bytes, modified {modified:?}, {identity}")
                .map_err(anyhow::Error::new)?;
        }
        let stem: String = input.file_stem().and_then(|s| s.to_str()).unwrap_or("volume").to_owned();
        let end = (0..=stem.len().min(MAX_STEM)).rev().find(|end| stem.is_char_boundary(*end)).unwrap_or(0);
        let name = format!("{}-{:016x}", &stem[..end], xxhash_rust::xxh3::xxh3_64(text.as_bytes()));
        Ok(Self { name, text })
    }
}

/// How many files a folder holds, in folders at any depth, and a number that changes with each of them. Links to
/// folders are not followed.
fn folder(folder: &Path) -> std::io::Result<(u64, u64)> {
    let (mut open, mut count, mut sum) = (vec![folder.to_path_buf()], 0, 0u64);
    while let Some(at) = open.pop() {
        for entry in at.read_dir()? {
            let path = entry?.path();
            let mut data = path.symlink_metadata()?;
            if data.is_symlink() {
                // One that leads nowhere is nothing that could be read.
                match path.metadata() {
                    Ok(target) if !target.is_dir() => data = target,
                    _ => continue,
                }
            }
            if data.is_dir() {
                open.push(path);
                continue;
            }
            let (bytes, modified, identity) = (data.len(), data.modified().ok(), identity(&data));
            let line = format!("{path:?}, {bytes} bytes, modified {modified:?}, {identity}");
            // A sum, since folders are listed in any order.
            (count, sum) = (count + 1, sum.wrapping_add(xxhash_rust::xxh3::xxh3_64(line.as_bytes())));
        }
    }
    Ok((count, sum))
}

/// Which file it is and when anything of it changed last, in seconds and nanoseconds: tells apart what was put in its
/// place or given the old time.
#[cfg(unix)]
fn identity(data: &std::fs::Metadata) -> String {
    use std::os::unix::fs::MetadataExt as _;
    format!("file {} of device {}, changed {}.{:09}", data.ino(), data.dev(), data.ctime(), data.ctime_nsec())
}

#[cfg(not(unix))]
fn identity(_: &std::fs::Metadata) -> String {
    String::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_change_with_every_file_and_option_and_with_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let (header, data) = (dir.path().join("v.nhdr"), dir.path().join("d.raw"));
        std::fs::write(&header, b"header").unwrap();
        std::fs::write(&data, b"data").unwrap();
        let files = [header.clone(), data.clone()];
        let key = |options| Key::new(&header, &files, options).unwrap();
        let first = key("a");
        assert_eq!(key("a"), first);
        assert!(first.name.starts_with("v-") && first.name.len() == 18, "{}", first.name);
        assert_ne!(key("b").name, first.name);
        std::thread::sleep(std::time::Duration::from_millis(20));
        std::fs::write(&data, b"DATA").unwrap();
        assert_ne!(key("a").name, first.name);
        std::fs::remove_file(&data).unwrap();
        assert!(Key::new(&header, &files, "a").is_err());
    }

    #[test]
    fn of_a_folder_every_file_counts() {
        let dir = tempfile::tempdir().unwrap();
        let deep = dir.path().join("c/0");
        std::fs::create_dir_all(&deep).unwrap();
        std::fs::write(deep.join("0"), b"chunk").unwrap();
        std::fs::write(deep.join("1"), b"chunk").unwrap();
        let key = || Key::new(Path::new("v"), &[dir.path().into()], "").unwrap().name;
        let first = key();
        assert_eq!(key(), first);
        std::thread::sleep(std::time::Duration::from_millis(20));
        std::fs::write(deep.join("1"), b"CHUNK").unwrap();
        let changed = key();
        assert_ne!(changed, first);
        // As the list of entries looks for it.
        let text = Key::new(Path::new("v"), &[dir.path().into()], "").unwrap().text;
        let named = format!("file {:?}, 2 files in it, modified as ", dir.path().canonicalize().unwrap());
        assert!(text.contains(&named), "{text}");
        std::fs::remove_file(deep.join("0")).unwrap();
        assert_ne!(key(), changed);
    }

    #[test]
    fn a_name_of_any_length_makes_the_name_of_an_entry() {
        let name = |stem: &str| Key::new(Path::new(&format!("{stem}.nrrd")), &[], "").unwrap().name;
        assert!(name(&"é".repeat(120)).len() <= MAX_STEM + 17);
        assert!(name("part").starts_with("part-"));
    }
}

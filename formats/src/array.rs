//! One array of a file that holds several: `FILE:/NAME`.
//!
//! The invariant: *an existing file of the whole name wins, and only then does the last `:/` split*; so nothing that
//! could be named before means something else now.

use std::path::{Path, PathBuf};

use brickcast_volume::format::{FormatError, excerpt};

use crate::input::Input;
use crate::wrong::Wrong;
use crate::{amira, hdf5, vtk};

const MARK: &str = ":/";

/// The file, and the array's name with the slash before it, where one is named.
pub(crate) fn split(path: &Path) -> (&Path, Option<&str>) {
    let whole = (path, None);
    let Some(text) = path.to_str().filter(|_| path.symlink_metadata().is_err()) else { return whole };
    match text.rfind(MARK) {
        Some(at) if at > 0 && Path::new(&text[..at]).is_file() => (Path::new(&text[..at]), Some(&text[at + 1..])),
        _ => whole,
    }
}

/// `array` of `file`, as [`split`] takes them apart.
pub(crate) fn within(file: &Path, array: Option<&str>) -> PathBuf {
    match array {
        Some(array) => {
            let mut name = file.as_os_str().to_owned();
            name.push(":");
            name.push(array);
            name.into()
        }
        None => file.into(),
    }
}

/// What lies on the disk of what `path` names: itself, or the file before the array's name.
#[must_use]
pub fn file_of(path: &Path) -> &Path {
    split(path).0
}

/// The array that `path` names in a file that is there.
#[must_use]
pub fn array_of(path: &Path) -> Option<&str> {
    split(path).1
}

/// Refuses an array's name where the format, `None` an unknown one, has none.
pub(crate) fn check(input: &Input, format: Option<&'static str>) -> Result<(), FormatError> {
    let with_names = [hdf5::FORMAT, vtk::LEGACY, vtk::XML, amira::FORMAT];
    let Some(array) = &input.array else { return Ok(()) };
    match format {
        Some(format) if with_names.contains(&format) => Ok(()),
        // What it is packed in is taken off first.
        None if input.is_packed() => Ok(()),
        format => {
            let why = format!("`{}` names an array, but the file holds one volume", excerpt(array));
            Err(Wrong::new("name", why, "leave the part from `:/` on out").of(&input.path, format.unwrap_or("file")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_mark_splits_and_a_file_of_the_whole_name_wins() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.h5"), "x").unwrap();
        assert_eq!(split(&at("a.h5:/x/y")), (at("a.h5").as_path(), Some("/x/y")));
        assert_eq!(split(&at("a.h5")), (at("a.h5").as_path(), None));
        assert_eq!(split(&at("b.h5:/x")), (at("b.h5:/x").as_path(), None), "no such file");
        assert_eq!(within(&at("a.h5"), Some("/x/y")), at("a.h5:/x/y"));
        std::fs::create_dir_all(at("a.h5:")).unwrap();
        std::fs::write(at("a.h5:/x"), "x").unwrap();
        assert_eq!(split(&at("a.h5:/x")), (at("a.h5:/x").as_path(), None));
        assert_eq!(split(&at("a.h5:/x:/z")), (at("a.h5:/x").as_path(), Some("/z")));
        assert_eq!((array_of(&at("a.h5:/nothing")), array_of(&at("b.h5:/x"))), (Some("/nothing"), None));
        assert_eq!(file_of(&at("a.h5:/x:/z")), at("a.h5:/x"));
    }
}

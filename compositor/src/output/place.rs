//! Where animations go that end early.

use std::path::{Path, PathBuf};

/// Where a part of what is to be at `path` goes: there, or beside what is there, as `x.partial.apng` for `x.apng`.
pub(super) fn place_of_part(path: &Path) -> PathBuf {
    if !path.exists() {
        return path.to_owned();
    }
    let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_extension(format!("partial.{ending}"))
}

//! The manifest beside a picture: what it shows, by whom, and whether it is complete.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::atomic::AtomicFile;
use super::error::OutputError;

/// `out.png.json` for `out.png`.
#[must_use]
pub fn manifest_path(picture: &Path) -> PathBuf {
    let mut name = picture.as_os_str().to_owned();
    name.push(".json");
    PathBuf::from(name)
}

/// Writes `value` beside `picture`, indented, and returns where.
///
/// # Errors
/// A missing folder, a full disk.
pub fn write_manifest(picture: &Path, value: &serde_json::Value) -> Result<PathBuf, OutputError> {
    write_json(&manifest_path(picture), value)
}

/// Writes `value` to `path`, indented, and returns it.
///
/// # Errors
/// A missing folder, a full disk.
pub fn write_json(path: &Path, value: &serde_json::Value) -> Result<PathBuf, OutputError> {
    write_text(path, &format!("{value:#}\n"))
}

/// Writes `text` to `path`, and returns it.
///
/// # Errors
/// A missing folder, a full disk.
pub fn write_text(path: &Path, text: &str) -> Result<PathBuf, OutputError> {
    let file = AtomicFile::create(path)?;
    let mut writer = file.writer()?;
    writer.write_all(text.as_bytes()).and_then(|()| writer.flush()).map_err(|e| file.error(e))?;
    drop(writer);
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manifest_stands_beside_the_picture() {
        let folder = tempfile::tempdir().unwrap();
        let value = serde_json::json!({"complete": true, "frame_ms": [1.5]});
        let path = write_manifest(&folder.path().join("out.png"), &value).unwrap();
        assert_eq!(path, folder.path().join("out.png.json"));
        let text = std::fs::read_to_string(path).unwrap();
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}

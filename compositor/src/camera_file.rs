//! The file of `--camera`.

use std::path::Path;

use brickcast_volume::{Camera, camera_file};

use crate::bounded_file;
use crate::failure::Failure;

/// The camera; `notes` tell what of the file is left aside.
///
/// # Errors
/// A file that cannot be read, or holds no camera.
pub(crate) fn read(path: &Path, notes: &mut Vec<String>) -> Result<Camera, Failure> {
    let file = path.display().to_string();
    let text = bounded_file::read("camera file", path)?;
    let (camera, said) = camera_file::read(&file, &text)?;
    notes.extend(said.into_iter().map(|note| format!("{file}: {note}")));
    Ok(camera)
}

//! The file of `--camera`.

use std::path::Path;

use brickcast_volume::small_file::read_text;
use brickcast_volume::{Camera, camera_file};

use crate::cli::failure::Failure;

/// The longest that is read, bytes: a picture's manifest may be one, that of a long animation too.
const MAX_FILE_BYTES: u64 = 64 << 20;

/// The camera; `notes` tell what of the file is left aside.
///
/// # Errors
/// A file that cannot be read, or holds no camera.
pub(crate) fn read(path: &Path, notes: &mut Vec<String>) -> Result<Camera, Failure> {
    let file = path.display().to_string();
    let text = read_text("camera file", path, MAX_FILE_BYTES)?;
    let (camera, said) = camera_file::read(&file, &text)?;
    notes.extend(said.into_iter().map(|note| format!("{file}: {note}")));
    Ok(camera)
}

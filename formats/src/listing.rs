//! Which files of a folder may be slices.

use std::path::{Path, PathBuf};

use brickcast_volume::format::FormatError;

use crate::dicom;
use crate::natural;
use crate::wrong::Wrong;

/// Files that slices are looked for under, in folders.
const EXTENSIONS: [&str; 6] = ["tif", "tiff", "png", "jpg", "jpeg", "bmp"];
/// More files than a volume has planes.
pub(crate) const MOST_FILES: usize = 1 << 20;

pub(crate) fn has_extension(path: &Path) -> Option<&'static str> {
    let name = path.file_name()?.to_str()?;
    let extension = Path::new(name).extension()?.to_str()?.to_ascii_lowercase();
    (!name.starts_with('.')).then(|| EXTENSIONS.into_iter().find(|e| *e == extension)).flatten()
}

/// True where a folder holds slices: pictures by their names, DICOM by what is in it.
#[must_use]
pub fn is_stack(folder: &Path) -> bool {
    let any = |is: fn(&Path) -> bool| {
        folder.read_dir().is_ok_and(|mut entries| entries.any(|e| e.is_ok_and(|e| is(&e.path()))))
    };
    any(|path| has_extension(path).is_some()) || any(dicom::is_dicom)
}

/// The files of a folder that `wanted` takes, in natural order, and how many others there are.
pub(crate) fn listed(folder: &Path, wanted: impl Fn(&Path) -> bool) -> Result<(Vec<PathBuf>, usize), FormatError> {
    let at = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let failed = |reason| FormatError::Io { path: at.into(), action: "list", reason };
    let (mut files, mut others) = (Vec::new(), 0);
    for entry in at.read_dir().map_err(failed)? {
        let path = folder.join(entry.map_err(failed)?.file_name());
        match wanted(&path) && !path.is_dir() {
            true => files.push(path),
            false => others += 1,
        }
        if files.len() > MOST_FILES {
            let why = format!("more than {MOST_FILES} slices");
            return Err(Wrong::new("names", why, "name fewer by a pattern").of(at, "stack"));
        }
    }
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    files.sort_by(|a, b| natural::compare(&name(a), &name(b)));
    Ok((files, others))
}

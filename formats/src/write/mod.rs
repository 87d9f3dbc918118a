//! Volumes written as files that other programs read, one after the other as they come.
//!
//! The invariant: *what is written holds every value that is read, exactly where the format has the type, and a file of
//! the name is there whole or not at all*. What a format has no place for (units, axes) is told.

mod meta_image;
mod nifti;
mod nrrd;
mod numbers;
mod numpy;
mod out;
mod rational;
mod tiff;

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use brickcast_volume::format::{Rescale, VolumeSource, VoxelType};
use brickcast_volume::store::free_bytes;
use brickcast_volume::unfinished::Unfinished;

use numbers::Numbers;
use out::{Header, Voxels, failed};

pub use out::WriteError;

/// The formats by the ends of names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Nrrd,
    Tiff,
    /// With the voxels in the same file, or beside it.
    MetaImage {
        is_one_file: bool,
    },
    Nifti {
        is_packed: bool,
    },
    Numpy,
}

const NAMES: [(&str, Format); 8] = [
    ("nrrd", Format::Nrrd),
    ("tif", Format::Tiff),
    ("tiff", Format::Tiff),
    ("mhd", Format::MetaImage { is_one_file: false }),
    ("mha", Format::MetaImage { is_one_file: true }),
    ("nii.gz", Format::Nifti { is_packed: true }),
    ("nii", Format::Nifti { is_packed: false }),
    ("npy", Format::Numpy),
];

/// What was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    pub format: &'static str,
    pub voxel_type: VoxelType,
    /// Of all its files.
    pub bytes: u64,
    /// The files.
    pub paths: Vec<PathBuf>,
    /// What the format has no place for.
    pub notes: Vec<String>,
}

fn format_of(path: &Path) -> Option<Format> {
    let name = path.file_name()?.to_str()?.to_ascii_lowercase();
    NAMES
        .iter()
        .find(|(end, _)| name.strip_suffix(end).is_some_and(|stem| stem.len() > 1 && stem.ends_with('.')))
        .map(|(_, f)| *f)
}

/// The names that files can be written under, for people.
#[must_use]
pub fn writable() -> String {
    NAMES.map(|(end, _)| format!(".{end}")).join(", ")
}

/// Writes the volume of `source`, which stands at its first voxel, to `out`, whose name says the format. `values`: the
/// smallest and the largest value, where they are known; whole ones are then written as the smallest type that has
/// them.
///
/// # Errors
/// A name of no format, a file that is there without `force`, no room, what a format cannot hold; a source that cannot
/// be read.
pub fn write(
    source: &mut dyn VolumeSource,
    values: Option<(f64, f64)>,
    (out, force): (&Path, bool),
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Written, WriteError> {
    let format = format_of(out).ok_or_else(|| WriteError::Name { path: out.into(), endings: writable() })?;
    let of = source.header().clone();
    let is_nifti = matches!(format, Format::Nifti { .. });
    let numbers = if is_nifti { None } else { Numbers::of(&of, values) };
    let mut header = Header {
        voxel_type: numbers.as_ref().map_or(of.voxel_type, Numbers::voxel_type),
        rescale: if is_nifti { of.rescale } else { Rescale::IDENTITY },
        notes: numbers.as_ref().map(|n| n.note(of.rescale)).into_iter().collect(),
        of: &of,
    };
    let raw = out.with_extension("raw");
    let is_pair = format == Format::MetaImage { is_one_file: false };
    let paths: Vec<PathBuf> = std::iter::once(out.to_path_buf()).chain(is_pair.then_some(raw)).collect();
    for path in &paths {
        if !force && path.symlink_metadata().is_ok() {
            return Err(WriteError::Exists { path: path.clone() });
        }
    }
    let total = header.voxel_bytes();
    let is_packed = format == Format::Nifti { is_packed: true };
    if let Some(free) = free_bytes(out).filter(|free| !is_packed && *free < total) {
        return Err(WriteError::TooLittleDisk { path: out.into(), bytes: total, free });
    }
    let unfinished: Result<Vec<Unfinished>, WriteError> =
        paths.iter().map(|path| Unfinished::create(path).map_err(failed(path))).collect();
    let unfinished = unfinished?;
    let file = |i: usize| {
        unfinished[i].handle().map(|file: File| BufWriter::with_capacity(1 << 20, file)).map_err(failed(&paths[i]))
    };
    let mut voxels = Voxels { source, numbers, raw: Vec::new(), done: 0, total, progress };
    let name = match format {
        Format::Nrrd => nrrd::write(&mut header, &mut voxels, (file(0)?, out))?,
        Format::Tiff => tiff::write(&mut header, &mut voxels, (file(0)?, out))?,
        Format::MetaImage { .. } => {
            let voxels_file = if is_pair { Some((file(1)?, paths[1].as_path())) } else { None };
            meta_image::write(&mut header, &mut voxels, (file(0)?, out), voxels_file)?
        }
        Format::Nifti { is_packed } => nifti::write(&mut header, &mut voxels, (file(0)?, out), is_packed)?,
        Format::Numpy => numpy::write(&mut header, &mut voxels, (file(0)?, out))?,
    };
    let (voxel_type, mut notes) = (header.voxel_type, header.notes);
    notes.dedup();
    let mut bytes = 0;
    // The voxels before the header that names them.
    for (file, path) in unfinished.into_iter().zip(&paths).rev() {
        bytes += file.handle().and_then(|f| f.metadata()).map_err(failed(path))?.len();
        file.finish().map_err(failed(path))?;
    }
    Ok(Written { format: name, voxel_type, bytes, paths, notes })
}

//! Volumes as scanners, solvers and other programs write them, and the one opener of files.
//!
//! The invariant: *what is read is what the file says lies there, voxel by voxel and at its place in the world, or an
//! error that names the file and the field; and nothing a file says costs more memory than its own bytes can be made
//! into*. Readers end in one of two sources: [`ordered`], voxels in file order, and [`slices`], planes side by side.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they have written"))]

mod affine;
mod amira;
mod array;
mod coding;
mod dicom;
mod grey;
mod hdf5;
mod input;
mod lines;
mod listing;
mod mended;
mod meta_image;
mod natural;
mod nifti;
mod number;
mod numpy;
mod ordered;
mod packed;
mod parts;
mod pattern;
mod picture;
mod slice;
mod slices;
mod space;
mod stack;
mod tiff;
mod txm;
mod units;
mod unpacked;
mod valued;
mod vgi;
mod vtk;
mod write;
mod wrong;

use std::path::Path;

use brickcast_volume::format::{self, FormatError, Opener, RawHints, VolumeSource, hinted};

use input::Input;

pub use array::{array_of, file_of};
pub use listing::is_stack;
pub use write::{WriteError, Written, writable, write};

/// One line of the table of formats.
struct Format {
    name: &'static str,
    /// Lower case, without the dot; what people look for.
    extensions: &'static str,
    reads: &'static str,
    /// Knows a file by its first bytes, [`input::START_BYTES`] where there are so many.
    recognises: fn(&[u8]) -> bool,
    /// Read from its first byte to its last, so that what is packed is unpacked on the way.
    is_in_order: bool,
    open: OpenFormat,
}

type OpenFormat = fn(Input, &RawHints) -> Result<Box<dyn VolumeSource>, FormatError>;

static FORMATS: [Format; 14] = [
    // Before TIFF: slides are both, and say so at their start.
    Format {
        name: "DICOM",
        extensions: ".dcm, or none",
        reads: "a series as a folder in any order, one file, frames",
        recognises: dicom::has_magic,
        is_in_order: false,
        open: dicom::open_one,
    },
    Format {
        name: "TIFF",
        extensions: ".tif, .tiff",
        reads: "one file of many pages or a stack of files, ImageJ's and OME's too",
        recognises: tiff::has_magic,
        is_in_order: false,
        open: stack::open_one,
    },
    Format {
        name: "PNG",
        extensions: ".png",
        reads: "a stack of files, grey",
        recognises: picture::is_png,
        is_in_order: false,
        open: stack::open_one,
    },
    Format {
        name: "JPEG",
        extensions: ".jpg, .jpeg",
        reads: "a stack of files, grey",
        recognises: picture::is_jpeg,
        is_in_order: false,
        open: stack::open_one,
    },
    Format {
        name: "BMP",
        extensions: ".bmp",
        reads: "a stack of files, grey",
        recognises: picture::is_bmp,
        is_in_order: false,
        open: stack::open_one,
    },
    Format {
        name: "MetaImage",
        extensions: ".mha, .mhd",
        reads: "raw or zlib, in the file or in others",
        recognises: meta_image::recognises,
        is_in_order: true,
        open: meta_image::open,
    },
    Format {
        name: "NIfTI and Analyze",
        extensions: ".nii, .hdr with .img",
        reads: "NIfTI-1 and -2, Analyze 7.5",
        recognises: nifti::recognises,
        is_in_order: true,
        open: nifti::open,
    },
    Format {
        name: "NumPy",
        extensions: ".npy",
        reads: "arrays of numbers with two or three axes",
        recognises: numpy::has_magic,
        is_in_order: true,
        open: numpy::open,
    },
    Format {
        name: hdf5::FORMAT,
        extensions: ".h5, .hdf5, .nxs",
        reads: "NeXus, DXchange, or FILE:/path/of/dataset",
        recognises: hdf5::has_magic,
        is_in_order: false,
        open: hdf5::open,
    },
    Format {
        name: amira::FORMAT,
        extensions: ".am",
        reads: "uniform lattices, binary, text, runs or zlib",
        recognises: amira::recognises,
        is_in_order: true,
        open: amira::open,
    },
    Format {
        name: vgi::FORMAT,
        extensions: ".vgi with .vol",
        reads: "one raw file beside the header",
        recognises: vgi::recognises,
        is_in_order: true,
        open: vgi::open,
    },
    Format {
        name: "VTK legacy",
        extensions: ".vtk",
        reads: "structured points, text or binary",
        recognises: vtk::is_legacy,
        is_in_order: true,
        open: vtk::open_legacy,
    },
    Format {
        name: "VTK image data",
        extensions: ".vti",
        reads: "text, base64 or appended, zlib or LZ4",
        recognises: vtk::is_xml,
        is_in_order: true,
        open: vtk::open_xml,
    },
    Format {
        name: "Zeiss",
        extensions: ".txm",
        reads: "volumes of X-ray microscopes",
        recognises: txm::has_magic,
        is_in_order: false,
        open: txm::open,
    },
];

/// The formats that are read, for people.
#[must_use]
pub fn supported() -> String {
    let ours: Vec<String> = FORMATS.iter().map(|f| format!("{} ({}: {})", f.name, f.extensions, f.reads)).collect();
    format!(
        "{}; {}; a stack as a folder, a quoted pattern or a list; any of them in .gz or .zst",
        ours.join("; "),
        format::supported()
    )
}

/// Opens an input volume: a file, a folder of slices, a pattern that stands for files, or a list of their names. What
/// is in the file decides, then its suffix. `FILE:/NAME` names one of several arrays, see [`array`].
///
/// # Errors
/// Nothing there, an unknown format, or what the format's own reader finds wrong.
pub fn open(path: &Path, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    opened(path, hints).and_then(|source| hinted(source, path, hints)).map_err(|error| match error {
        FormatError::Unknown { path, start, .. } => FormatError::Unknown { path, start, supported: supported() },
        FormatError::Directory { path, .. } => FormatError::Directory { path, supported: supported() },
        error => error,
    })
}

fn opened(path: &Path, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    if is_pattern(path) {
        return stack::open_pattern(path, hints);
    }
    if path.is_dir() {
        return stack::open_folder(path, hints);
    }
    let (path, array) = array::split(path);
    let path = &nifti::header_of_pair(path);
    // What cannot be opened is told of by the one below.
    let Some(mut input) = Input::open(path)? else { return format::open(path, hints) };
    input.array = array.map(str::to_owned);
    let format = FORMATS.iter().find(|f| (f.recognises)(&input.start));
    array::check(&input, format.map(|format| format.name))?;
    if let Some(format) = format {
        return match input.is_packed() && !format.is_in_order {
            true => unpacked::open(&input, hints, Opener(opened)),
            false => (format.open)(input, hints),
        };
    }
    if numpy::is_archive(&input.start) && hints.dims.is_none() {
        return Err(numpy::no_archive(path));
    }
    if input.is_packed() {
        return unpacked::open(&input, hints, Opener(opened));
    }
    // Whose dims are given is raw, whatever it is called.
    let list = if hints.dims.is_some() { None } else { pattern::list(&input)? };
    match list {
        Some(files) => stack::open_list(path, files, hints),
        None => format::open(path, hints),
    }
}

/// True where `path` is no file, but stands for files: `*`, `?` and `[...]` in its last part.
#[must_use]
pub fn is_pattern(path: &Path) -> bool {
    pattern::is_pattern(path)
}

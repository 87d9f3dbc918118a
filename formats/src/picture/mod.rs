//! Slices as pictures: PNG, JPEG and BMP, grey.

mod bmp;
mod jpeg;
mod png;

use std::path::Path;

use brickcast_volume::format::FormatError;

use crate::packed;
use crate::slice::Shape;
use crate::wrong::Wrong;

/// A picture's file is read as a whole: one of 32,768 x 32,768 pixels of 16 bits that did not shrink is larger.
const LONGEST: u64 = 1 << 30;
/// Where size and type mostly stand.
const HEADER: u64 = 64 << 10;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Png,
    Jpeg,
    Bmp,
}

impl Kind {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Bmp => "BMP",
        }
    }
}

pub(crate) fn is_png(start: &[u8]) -> bool {
    start.starts_with(b"\x89PNG\r\n\x1a\n")
}

pub(crate) fn is_jpeg(start: &[u8]) -> bool {
    start.starts_with(b"\xff\xd8\xff")
}

pub(crate) fn is_bmp(start: &[u8]) -> bool {
    bmp::recognises(start)
}

pub(crate) fn kind(start: &[u8]) -> Option<Kind> {
    match start {
        _ if is_png(start) => Some(Kind::Png),
        _ if is_jpeg(start) => Some(Kind::Jpeg),
        _ if is_bmp(start) => Some(Kind::Bmp),
        _ => None,
    }
}

/// Size and type, from the file's header.
pub(crate) fn shape(path: &Path, kind: Kind) -> Result<Shape, FormatError> {
    let of_bytes = |bytes: &[u8]| match kind {
        Kind::Png => png::shape(bytes),
        Kind::Jpeg => jpeg::shape(bytes),
        Kind::Bmp => bmp::shape(bytes),
    };
    // Stacks have thousands of files, and few a header that is longer.
    let (head, is_all) = packed::head(path, HEADER)?;
    let shape = match of_bytes(&head) {
        Err(_) if !is_all => of_bytes(&packed::whole(path, LONGEST)?),
        shape => shape,
    };
    shape.map_err(|wrong| wrong.of(path, kind.name()))
}

/// A JPEG of 8 bits.
pub(crate) fn decoded_jpeg(bytes: &[u8]) -> Result<(Shape, Vec<u8>), Wrong> {
    jpeg::decoded(bytes)
}

pub(crate) fn plane(path: &Path, kind: Kind, want: Shape) -> Result<Vec<u8>, FormatError> {
    let bytes = packed::whole(path, LONGEST)?;
    let decoded = match kind {
        Kind::Png => png::decoded(&bytes),
        Kind::Jpeg => jpeg::decoded(&bytes),
        Kind::Bmp => bmp::decoded(&bytes),
    };
    let (shape, data) = decoded.map_err(|wrong| wrong.of(path, kind.name()))?;
    let [x, y] = want.size;
    if shape == want && data.len() as u64 == u64::from(x) * u64::from(y) * want.voxel_type.bytes() as u64 {
        return Ok(data);
    }
    Err(Wrong::new("size and type", "it changed while it was read", "run it again").of(path, kind.name()))
}

//! NumPy's .npy: arrays of two or three axes. An array of axes z, y, x has x last, as whoever stacks slices has it.
//! One in Fortran's order lies in memory the other way round: its axes are taken as they lie, and turned in the world.

use std::path::Path;

use brickcast_volume::format::{
    Endian, FormatError, Placement, RawHints, SourceHeader, VolumeSource, VoxelType, excerpt,
};
use glam::DVec3;

use crate::input::Input;
use crate::ordered::{Block, Coding, OrderedSource};
use crate::packed::Packing;
use crate::space::{Place, noted};
use crate::wrong::Wrong;

const FORMAT: &str = "NumPy array";
const MAGIC: &[u8] = b"\x93NUMPY";
const LONGEST_HEADER: u64 = 1 << 20;

pub(crate) fn has_magic(start: &[u8]) -> bool {
    start.starts_with(MAGIC)
}

/// Of .npz, and of other archives of ZIP.
pub(crate) fn is_archive(start: &[u8]) -> bool {
    start.starts_with(b"PK\x03\x04")
}

pub(crate) fn no_archive(path: &Path) -> FormatError {
    let is_npz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz"));
    let remedy = match is_npz {
        true => "take one array out: numpy.save('volume.npy', numpy.load('FILE.npz')['NAME'])",
        false => "unpack it, and name what is in it",
    };
    Wrong::new("content", "an archive of several files (ZIP)", remedy).of(path, if is_npz { FORMAT } else { "archive" })
}

#[derive(Debug, PartialEq)]
struct Header {
    voxel_type: VoxelType,
    is_half: bool,
    endian: Endian,
    is_fortran: bool,
    shape: Vec<u64>,
    /// First byte of the numbers.
    start: u64,
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path.clone();
    let wrong = |wrong: Wrong| wrong.of(&path, FORMAT);
    let head = input.head(LONGEST_HEADER)?;
    let header = parse(&head).map_err(wrong)?;
    let mut notes = Vec::new();
    let dims = dims(&header, &mut notes).map_err(wrong)?;
    let mut place = Place::unknown();
    if header.is_fortran && dims[2] > 1 {
        // The axis that goes fastest is z.
        place = Place {
            vectors: [DVec3::Z, DVec3::Y, DVec3::X],
            said: Placement { directions: true, ..place.said },
            ..place
        };
        notes.push("in Fortran's order: its axes were taken as they lie in the file, and turned in the world".into());
    }
    let geometry = place.geometry(dims, &mut notes).map_err(wrong)?;
    let about =
        SourceHeader { placement: place.said, notes, ..SourceHeader::new("NumPy", geometry, header.voxel_type) };
    let block = Block {
        path: path.clone(),
        outer: input.packing,
        start: header.start,
        inner: Packing::None,
        endian: header.endian,
        is_half: header.is_half,
        coding: Coding::Plain,
    };
    Ok(Box::new(OrderedSource::new(noted(about, hints, false), block, vec![path.clone()])?))
}

/// The axis that goes fastest first.
fn dims(header: &Header, notes: &mut Vec<String>) -> Result<[u32; 3], Wrong> {
    let remedy = "save one volume of axes z, y, x";
    let edge = |n: u64| u32::try_from(n).map_err(|_| Wrong::new("shape", format!("an axis of {n}"), remedy));
    let mut shape = header.shape.clone();
    while shape.len() > 3 && shape[0] == 1 {
        shape.remove(0);
        notes.push("a first axis of length 1 was left out".into());
    }
    match (shape[..].iter().copied().map(edge).collect::<Result<Vec<_>, _>>()?.as_slice(), header.is_fortran) {
        (&[y, x], false) => Ok([x, y, 1]),
        // y goes fastest: one plane of the other axes.
        (&[y, x], true) => Ok([y, 1, x]),
        (&[z, y, x], false) => Ok([x, y, z]),
        (&[z, y, x], true) => Ok([z, y, x]),
        (axes, _) => Err(Wrong::new("shape", format!("{} axes", axes.len()), remedy)),
    }
}

fn parse(head: &[u8]) -> Result<Header, Wrong> {
    let cut = || Wrong::broken("header", "the file ends in it, or it is longer than 1 MiB");
    let (length, at) = match (head.get(6), head.get(8..12)) {
        (Some(1), Some(&[a, b, ..])) => (u64::from(u16::from_le_bytes([a, b])), 10),
        (Some(2 | 3), Some(&[a, b, c, d])) => (u64::from(u32::from_le_bytes([a, b, c, d])), 12),
        (Some(version), Some(_)) => return Err(Wrong::broken("version", version)),
        _ => return Err(cut()),
    };
    let end = at + length;
    let text = head.get(at as usize..usize::try_from(end).unwrap_or(usize::MAX)).ok_or_else(cut)?;
    let text = String::from_utf8_lossy(text);
    let get = |key: &str| {
        let found = [format!("'{key}':"), format!("\"{key}\":")]
            .iter()
            .find_map(|k| text.split_once(k.as_str()).map(|(_, v)| v.trim_start()));
        found.ok_or_else(|| Wrong::broken(key, "it is not said"))
    };
    let descr = get("descr")?;
    let quote = descr.chars().next().filter(|c| "'\"".contains(*c));
    let Some(descr) = quote.and_then(|q| descr[1..].split(q).next()) else {
        return Err(Wrong::new("descr", format!("`{}`: fields, not numbers", excerpt(descr)), "save one field of it"));
    };
    let (order, kind) = match descr.chars().next() {
        Some(order @ ('<' | '>' | '|' | '=')) => (order, &descr[1..]),
        _ => ('=', descr),
    };
    let endian = if order == '>' { Endian::Big } else { Endian::Little };
    let voxel_type = match kind {
        "b1" | "u1" | "?" => VoxelType::U8,
        "i1" => VoxelType::I8,
        "u2" => VoxelType::U16,
        "i2" => VoxelType::I16,
        "u4" => VoxelType::U32,
        "i4" => VoxelType::I32,
        "u8" => VoxelType::U64,
        "i8" => VoxelType::I64,
        "f2" | "f4" => VoxelType::F32,
        "f8" => VoxelType::F64,
        _ => {
            let why = format!(
                "`{}` is not supported; supported are bool, int8 to int64, uint8 to uint64 and float16 to float64",
                excerpt(descr)
            );
            return Err(Wrong::new("descr", why, "convert it, e.g. with .astype('f4')"));
        }
    };
    let is_fortran = match get("fortran_order")? {
        v if v.starts_with("True") => true,
        v if v.starts_with("False") => false,
        v => return Err(Wrong::broken("fortran_order", format!("`{}`", excerpt(v)))),
    };
    let shape = get("shape")?.strip_prefix('(').and_then(|s| s.split_once(')')).map(|(inside, _)| inside);
    let numbers = shape.map(|s| {
        let parts = s.split(',').map(str::trim).filter(|s| !s.is_empty()).take(17);
        parts.map(|s| s.trim_end_matches('L').parse::<u64>()).collect::<Result<Vec<_>, _>>()
    });
    match numbers {
        Some(Ok(shape)) => Ok(Header { voxel_type, is_half: kind == "f2", endian, is_fortran, shape, start: end }),
        _ => Err(Wrong::broken("shape", format!("`{}`", excerpt(shape.unwrap_or_default())))),
    }
}

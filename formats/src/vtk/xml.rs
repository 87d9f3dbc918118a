//! VTK's XML image data: arrays on points or in cells, as text, in base64, or appended behind the XML.

use std::path::Path;

use brickcast_volume::format::{
    Endian, FormatError, Placement, RawHints, SourceHeader, VolumeSource, VoxelType, excerpt,
};
use glam::DVec3;

use super::tags::{Tag, Tags};
use crate::coding::{Blocks, Compressor};
use crate::input::Input;
use crate::ordered::{Block, Coding, OrderedSource};
use crate::packed::Packing;
use crate::space::{Place, noted};
use crate::wrong::{EXPORT_AGAIN, Wrong};

pub(crate) const FORMAT: &str = "VTK image data";

pub(crate) fn recognises(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    text.trim_start_matches('\u{feff}').trim_start().starts_with('<') && text.contains("<VTKFile")
}

/// What the tags up to the array say.
#[derive(Debug, Default)]
struct Found {
    file: Tag,
    image: Tag,
    pieces: u32,
    array: Tag,
    is_of_cells: bool,
    /// Names of other arrays.
    others: Vec<String>,
    /// Of what is appended: its encoding, and its first byte.
    appended: Option<(String, u64)>,
}

fn find(input: &Input) -> Result<Found, Wrong> {
    let broken = |e| Wrong::broken("XML", e);
    let stream = input.stream().map_err(broken)?;
    let mut tags = Tags::new(std::io::BufReader::with_capacity(1 << 16, stream));
    let mut found = Found::default();
    // The array that is to be shown by default.
    let (mut group, mut wanted) = (None, None::<String>);
    let named = input.array.as_ref().map(|name| &name[1..]);
    while let Some(tag) = tags.next().map_err(broken)? {
        match tag.name.as_str() {
            "VTKFile" => found.file = tag,
            "ImageData" => found.image = tag,
            "Piece" => found.pieces += 1,
            "PointData" | "CellData" => {
                group = Some(tag.name == "CellData");
                wanted = tag.get("Scalars").map(str::to_owned);
            }
            "/PointData" | "/CellData" => group = None,
            "DataArray" if group.is_some() => {
                let name = tag.get("Name").unwrap_or_default();
                let is_wanted = named.or(wanted.as_deref()).is_none_or(|wanted| wanted == name);
                let have_points = !found.array.name.is_empty() && !found.is_of_cells;
                let better = group == Some(false) && found.is_of_cells;
                if (found.array.name.is_empty() || better) && is_wanted && !have_points {
                    found.is_of_cells = group == Some(true);
                    let old = std::mem::replace(&mut found.array, tag);
                    found.others.extend(old.get("Name").map(excerpt));
                    if found.array.get("format") != Some("appended") && !found.is_of_cells {
                        // What follows may be gigabytes.
                        return Ok(found);
                    }
                } else if found.others.len() < 16 {
                    found.others.push(excerpt(name));
                }
            }
            "AppendedData" => {
                let encoding = tag.get("encoding").unwrap_or("base64").to_owned();
                if !tags.skip_to(b'_').map_err(broken)? {
                    return Err(Wrong::broken("AppendedData", "no `_` begins it"));
                }
                found.appended = Some((encoding, tags.at()));
                return Ok(found);
            }
            _ => {}
        }
    }
    Ok(found)
}

fn voxel_type(name: &str) -> Option<VoxelType> {
    Some(match name {
        "UInt8" => VoxelType::U8,
        "Int8" => VoxelType::I8,
        "UInt16" => VoxelType::U16,
        "Int16" => VoxelType::I16,
        "UInt32" => VoxelType::U32,
        "Int32" => VoxelType::I32,
        "UInt64" => VoxelType::U64,
        "Int64" => VoxelType::I64,
        "Float32" => VoxelType::F32,
        "Float64" => VoxelType::F64,
        _ => return None,
    })
}

fn numbers<const N: usize>(tag: &Tag, name: &str) -> Result<Option<[f64; N]>, Wrong> {
    let Some(text) = tag.get(name) else { return Ok(None) };
    let all: Option<Vec<f64>> = text.split_whitespace().take(N + 1).map(|word| word.parse().ok()).collect();
    let all = all.and_then(|all| all.try_into().ok());
    all.map(Some).ok_or_else(|| Wrong::broken(name, format!("`{}` must be {N} numbers", excerpt(text))))
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path.clone();
    let found = find(&input).map_err(|wrong| wrong.of(&path, FORMAT))?;
    let named = input.array.as_ref().map(|name| &name[1..]);
    let (about, block) = parsed(&found, &input.path, input.packing, named).map_err(|wrong| wrong.of(&path, FORMAT))?;
    Ok(Box::new(OrderedSource::new(noted(about, hints, false), block, vec![path.clone()])?))
}

fn parsed(found: &Found, path: &Path, outer: Packing, named: Option<&str>) -> Result<(SourceHeader, Block), Wrong> {
    let kind = found.file.get("type").unwrap_or_default();
    if kind != "ImageData" {
        let why = format!("`{}` is no ImageData", excerpt(kind));
        return Err(Wrong::new("type", why, "resample it to image data, e.g. with ParaView's Resample To Image"));
    }
    let extent: [f64; 6] =
        numbers(&found.image, "WholeExtent")?.ok_or_else(|| Wrong::broken("WholeExtent", "it is not said"))?;
    if found.pieces != 1 {
        let why = format!("{} of them; one is read", found.pieces);
        return Err(Wrong::new("Piece", why, "save it as one piece"));
    }
    if found.array.name.is_empty() {
        return match named {
            Some(name) if !found.others.is_empty() => {
                let why = format!("there is none called `{}`; there are: {}", excerpt(name), found.others.join(", "));
                Err(Wrong::new("DataArray", why, "name one of these"))
            }
            _ => Err(Wrong::broken("DataArray", "there is none on points or in cells")),
        };
    }
    let name = excerpt(found.array.get("Name").unwrap_or_default());
    let components = found.array.get("NumberOfComponents").unwrap_or("1");
    if components != "1" {
        let why = format!("`{name}` has {} values a voxel", excerpt(components));
        return Err(Wrong::new("NumberOfComponents", why, "name one of one value: FILE:/NAME"));
    }
    let word = found.array.get("type").unwrap_or_default();
    let voxel_type = voxel_type(word).ok_or_else(|| {
        Wrong::new("type", format!("`{}` of `{name}`", excerpt(word)), "save it as integers or floats")
    })?;
    let points = if found.is_of_cells { 0.0 } else { 1.0 };
    let count = |lo: f64, hi: f64| (hi - lo + points).clamp(0.0, f64::from(u32::MAX)) as u32;
    let dims = [count(extent[0], extent[1]), count(extent[2], extent[3]), count(extent[4], extent[5])];
    let spacing = numbers::<3>(&found.image, "Spacing")?;
    let origin = numbers::<3>(&found.image, "Origin")?;
    let direction = numbers::<9>(&found.image, "Direction")?;
    let said = Placement { spacing: spacing.is_some(), origin: origin.is_some(), directions: direction.is_some() };
    let spacing = spacing.unwrap_or([1.0; 3]);
    // Rows of the matrix are the world's axes.
    let d = direction.unwrap_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let vectors = [0, 1, 2].map(|i| DVec3::new(d[i], d[i + 3], d[i + 6]) * spacing[i]);
    // The origin is that of index 0; a cell's centre lies half a step on.
    let half = if found.is_of_cells { 0.5 } else { 0.0 };
    let first = [extent[0] + half, extent[2] + half, extent[4] + half];
    let origin = DVec3::from(origin.unwrap_or([0.0; 3])) + (0..3).map(|i| vectors[i] * first[i]).sum::<DVec3>();
    let how = if named.is_some() { "taken, as named" } else { "taken" };
    let mut notes =
        vec![format!("array `{name}` {} was {how}", if found.is_of_cells { "in cells" } else { "on points" })];
    if !found.others.is_empty() {
        notes.push(format!("others are left aside: {}", found.others.join(", ")));
    }
    let geometry = Place { vectors, origin, said }.geometry(dims, &mut notes)?;
    let about = SourceHeader { placement: said, notes, ..SourceHeader::new(FORMAT, geometry, voxel_type) };
    let block = block(found, path, outer, voxel_type, geometry.voxel_count() * voxel_type.bytes() as u64)?;
    Ok((about, block))
}

fn block(found: &Found, path: &Path, outer: Packing, voxel_type: VoxelType, expected: u64) -> Result<Block, Wrong> {
    let endian = match found.file.get("byte_order") {
        Some("BigEndian") => Endian::Big,
        _ => Endian::Little,
    };
    let count_bytes = match found.file.get("header_type").unwrap_or("UInt32") {
        "UInt64" => 8,
        "UInt32" => 4,
        other => return Err(Wrong::broken("header_type", excerpt(other))),
    };
    let compressor = match found.file.get("compressor") {
        None | Some("") => None,
        Some("vtkZLibDataCompressor") => Some(Compressor::Zlib),
        Some("vtkLZ4DataCompressor") => Some(Compressor::Lz4),
        Some(other) => {
            return Err(Wrong::new(
                "compressor",
                format!("`{}` is not read", excerpt(other)),
                "save it with zlib or LZ4",
            ));
        }
    };
    let blocks = |is_base64| Blocks { is_base64, compressor, count_bytes, endian, expected };
    let at = |start, coding, endian| Block {
        path: path.into(),
        outer,
        start,
        inner: Packing::None,
        endian,
        is_half: false,
        coding,
    };
    match found.array.get("format") {
        Some("ascii") => Ok(at(found.array.end, Coding::Text(voxel_type), Endian::Little)),
        Some("binary") => Ok(at(found.array.end, Coding::Blocks(blocks(true)), endian)),
        Some("appended") => {
            let (encoding, first) =
                found.appended.as_ref().ok_or_else(|| Wrong::broken("AppendedData", "there is none"))?;
            let offset = found.array.get("offset").and_then(|o| o.trim().parse::<u64>().ok());
            let start = offset.and_then(|offset| first.checked_add(offset));
            let start = start.ok_or_else(|| Wrong::broken("offset", "it is no place in the file"))?;
            match encoding.as_str() {
                // The count before them is left out, and the file's length says whether they are there.
                "raw" if compressor.is_none() && outer == Packing::None => {
                    Ok(at(start.saturating_add(count_bytes as u64), Coding::Plain, endian))
                }
                "raw" => Ok(at(start, Coding::Blocks(blocks(false)), endian)),
                "base64" => Ok(at(start, Coding::Blocks(blocks(true)), endian)),
                other => Err(Wrong::new("encoding", format!("`{}` is not read", excerpt(other)), EXPORT_AGAIN)),
            }
        }
        other => Err(Wrong::broken("format", format!("`{}`", excerpt(other.unwrap_or_default())))),
    }
}

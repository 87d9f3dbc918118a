//! MetaImage, as ITK writes it: lines of `Key = value`, the last of which says where the voxels are. Its world is
//! LPS, as ours.

use std::path::{Path, PathBuf};

use brickcast_volume::format::{
    Endian, FormatError, Placement, RawHints, SourceHeader, VolumeSource, VoxelType, excerpt,
};
use glam::DVec3;

use crate::input::Input;
use crate::ordered::{Block, Coding, OrderedSource};
use crate::packed::{Packing, opened};
use crate::parts::{Parts, numbered};
use crate::slices::SliceSource;
use crate::space::{Place, noted};
use crate::units;
use crate::wrong::{EXPORT_AGAIN, Wrong};

const FORMAT: &str = "MetaImage";
/// The longest header, with a list of files.
const LONGEST_HEADER: u64 = 16 << 20;

/// `NDims` or `ObjectType` among lines of `Key = value`.
pub(crate) fn recognises(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let mut lines = text.lines().map(str::trim).filter(|l| !l.is_empty());
    let key = |line: &str| line.split_once('=').map(|(key, _)| key.trim().to_owned());
    let first = lines.next().and_then(key);
    let known = ["ObjectType", "NDims", "Comment", "ObjectSubType", "TransformType", "Name", "ID"];
    first.is_some_and(|first| known.contains(&first.as_str()))
        && text.lines().filter_map(key).any(|key| key == "NDims" || key == "DimSize" || key == "ElementDataFile")
}

struct Fields<'a> {
    lines: Vec<(&'a str, &'a str)>,
    /// Behind the last line.
    end: usize,
}

impl<'a> Fields<'a> {
    fn parse(head: &'a [u8]) -> Result<Self, Wrong> {
        let (mut lines, mut at) = (Vec::new(), 0);
        while at < head.len() {
            let length = head[at..].iter().position(|b| *b == b'\n').unwrap_or(head.len() - at);
            let line = std::str::from_utf8(&head[at..at + length])
                .map_err(|_| Wrong::broken("ElementDataFile", "it is not said before what is no text any more"))?;
            at = (at + length + 1).min(head.len());
            let line = line.trim();
            if line.is_empty() {
                continue;
            }
            let (key, value) = line
                .split_once('=')
                .ok_or_else(|| Wrong::broken("header", format!("the line `{}` is no `Key = value`", excerpt(line))))?;
            lines.push((key.trim(), value.trim()));
            if key.trim() == "ElementDataFile" {
                return Ok(Self { lines, end: at });
            }
        }
        Err(Wrong::broken("ElementDataFile", "it is not said"))
    }

    fn get(&self, keys: &[&str]) -> Option<&'a str> {
        self.lines.iter().find(|(key, _)| keys.contains(key)).map(|(_, value)| *value)
    }

    fn numbers<T: std::str::FromStr>(&self, keys: &[&str], count: usize) -> Result<Option<Vec<T>>, Wrong> {
        let Some(value) = self.get(keys) else { return Ok(None) };
        let parsed: Option<Vec<T>> = value.split_whitespace().take(count + 1).map(|word| word.parse().ok()).collect();
        match parsed.filter(|p| p.len() == count) {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(Wrong::broken(keys[0], format!("`{}` must be {count} numbers", excerpt(value)))),
        }
    }

    fn is_true(&self, keys: &[&str]) -> Option<bool> {
        self.get(keys).map(|v| v.starts_with(['T', 't', '1', 'Y', 'y']))
    }
}

fn voxel_type(name: &str) -> Result<VoxelType, Wrong> {
    Ok(match name {
        "MET_UCHAR" => VoxelType::U8,
        "MET_CHAR" | "MET_ASCII_CHAR" => VoxelType::I8,
        "MET_USHORT" => VoxelType::U16,
        "MET_SHORT" => VoxelType::I16,
        "MET_UINT" | "MET_ULONG" => VoxelType::U32,
        "MET_INT" | "MET_LONG" => VoxelType::I32,
        "MET_ULONG_LONG" => VoxelType::U64,
        "MET_LONG_LONG" => VoxelType::I64,
        "MET_FLOAT" => VoxelType::F32,
        "MET_DOUBLE" => VoxelType::F64,
        _ => {
            let why = format!("`{}` is not supported", excerpt(name));
            return Err(Wrong::new("ElementType", why, "convert it to integers or floats"));
        }
    })
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path.clone();
    let wrong = |wrong: Wrong| wrong.of(&path, FORMAT);
    let head = input.head(LONGEST_HEADER)?;
    let fields = Fields::parse(&head).map_err(wrong)?;
    let about = header(&fields).map_err(wrong)?;
    let is_packed = fields.is_true(&["CompressedData"]).unwrap_or(false);
    if fields.is_true(&["BinaryData"]) == Some(false) {
        return Err(wrong(Wrong::new("BinaryData", "False: numbers as text", "save it with BinaryData = True")));
    }
    let is_big = fields.is_true(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"]).unwrap_or(false);
    let endian = if is_big { Endian::Big } else { Endian::Little };
    let skip = fields.get(&["HeaderSize"]).map_or(Ok(0), |v| {
        v.parse::<i64>().map_err(|_| wrong(Wrong::broken("HeaderSize", format!("`{}`", excerpt(v)))))
    })?;
    let inner = if is_packed { Packing::Zlib } else { Packing::None };
    let block = |path: PathBuf, outer, start| Block {
        path,
        outer,
        start,
        inner,
        endian,
        is_half: false,
        coding: Coding::Plain,
    };
    let data_file = fields.get(&["ElementDataFile"]).unwrap_or_default();
    let expected = about.geometry.voxel_count() * about.voxel_type.bytes() as u64;
    if data_file.eq_ignore_ascii_case("LOCAL") {
        let start = match (skip, input.is_packed() || is_packed) {
            (0.., _) => fields.end as u64 + skip.unsigned_abs(),
            (_, false) => input.file_bytes.saturating_sub(expected).max(fields.end as u64),
            (_, true) => fields.end as u64,
        };
        let block = with_mark(block(path.clone(), input.packing, start), &head).map_err(wrong)?;
        return Ok(Box::new(OrderedSource::new(noted(about, hints, false), block, vec![path.clone()])?));
    }
    let depth = about.geometry.dims().z;
    let names = names(data_file, &head[fields.end..], depth).map_err(wrong)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    if let Some(missing) = files.iter().find(|file| !file.is_file()) {
        let why = format!("{} is not there", missing.display());
        return Err(wrong(Wrong::new("ElementDataFile", why, "put it there or correct the header")));
    }
    if let [file] = &files[..] {
        let data = Input::open(file)?.ok_or_else(|| FormatError::Empty { path: file.clone() })?;
        let outer = if is_packed { Packing::None } else { data.packing };
        let start = match (skip, outer == Packing::None && !is_packed) {
            (0.., _) => skip.unsigned_abs(),
            (_, true) => data.file_bytes.saturating_sub(expected),
            (_, false) => 0,
        };
        let block = with_mark(block(file.clone(), outer, start), &[]).map_err(wrong)?;
        let all = vec![path.clone(), file.clone()];
        return Ok(Box::new(OrderedSource::new(noted(about, hints, false), block, all)?));
    }
    if is_packed {
        let why = "several files that are compressed each by itself";
        return Err(wrong(Wrong::new("CompressedData", why, "save it as one file")));
    }
    let parts = Parts::new(files.clone(), skip, &about, endian)?;
    files.insert(0, path.clone());
    Ok(Box::new(SliceSource::new(noted(about, hints, false), files, parts)))
}

/// Compressed data may be gzip as well as zlib.
fn with_mark(block: Block, head: &[u8]) -> Result<Block, Wrong> {
    if block.inner != Packing::Zlib {
        return Ok(block);
    }
    let is_gzip = match block.outer {
        Packing::None => {
            use std::io::{Read as _, Seek as _};
            let mut mark = Vec::new();
            let read = opened(&block.path).and_then(|mut file| {
                file.seek(std::io::SeekFrom::Start(block.start))?;
                file.take(3).read_to_end(&mut mark)
            });
            read.map_err(|e| Wrong::broken("ElementDataFile", e))?;
            Packing::of(&mark) == Packing::Gzip
        }
        _ => head.get(block.start as usize..).is_some_and(|rest| Packing::of(rest) == Packing::Gzip),
    };
    Ok(Block { inner: if is_gzip { Packing::Gzip } else { Packing::Zlib }, ..block })
}

/// The names of the data files; those of a list follow the header.
fn names(value: &str, rest: &[u8], depth: u32) -> Result<Vec<String>, Wrong> {
    let mut words = value.split_whitespace();
    if words.next() == Some("LIST") {
        if let Some(dimension) = words.next().filter(|d| !["2", "2D", "3", "3D"].contains(d)) {
            return Err(Wrong::new(
                "ElementDataFile",
                format!("LIST of files of {} axes", excerpt(dimension)),
                EXPORT_AGAIN,
            ));
        }
        let text = std::str::from_utf8(rest).map_err(|_| Wrong::broken("ElementDataFile", "its LIST is no text"))?;
        let names: Vec<String> = text.lines().map(|l| l.trim().to_owned()).filter(|l| !l.is_empty()).collect();
        return check_count(names, depth);
    }
    if value.contains('%') && value.split_whitespace().count() >= 4 {
        return check_count(numbered(value)?, depth);
    }
    match value.is_empty() {
        true => Err(Wrong::broken("ElementDataFile", "the name is missing")),
        false => Ok(vec![value.to_owned()]),
    }
}

fn check_count(names: Vec<String>, depth: u32) -> Result<Vec<String>, Wrong> {
    match names.len() as u64 {
        0 => Err(Wrong::broken("ElementDataFile", "it names no files")),
        n if u64::from(depth).is_multiple_of(n) => Ok(names),
        n => {
            let why = format!("{n} files for {depth} slices; each must hold as many as the others");
            Err(Wrong::broken("ElementDataFile", why))
        }
    }
}

fn header(fields: &Fields<'_>) -> Result<SourceHeader, Wrong> {
    let mut notes = Vec::new();
    let axes: usize = fields
        .numbers(&["NDims"], 1)?
        .map(|n| n[0])
        .filter(|n| [2, 3].contains(n))
        .ok_or_else(|| Wrong::new("NDims", "it must be 2 or 3", "take one volume out of it"))?;
    let missing = |field: &str| Wrong::broken(field, "it is not said");
    let mut dims: Vec<u32> = fields.numbers(&["DimSize"], axes)?.ok_or_else(|| missing("DimSize"))?;
    dims.resize(3, 1);
    if let Some(channels) = fields.get(&["ElementNumberOfChannels"]).filter(|n| n.trim() != "1") {
        let why = format!("{} values a voxel", excerpt(channels));
        return Err(Wrong::new("ElementNumberOfChannels", why, "take one of them out as a volume of its own"));
    }
    let voxel_type = voxel_type(fields.get(&["ElementType"]).ok_or_else(|| missing("ElementType"))?)?;
    let spacing: Option<Vec<f64>> = fields.numbers(&["ElementSpacing", "ElementSize"], axes)?;
    let origin: Option<Vec<f64>> = fields.numbers(&["Offset", "Position", "Origin"], axes)?;
    let matrix: Option<Vec<f64>> = fields.numbers(&["TransformMatrix", "Rotation", "Orientation"], axes * axes)?;
    let said = Placement { spacing: spacing.is_some(), origin: origin.is_some(), directions: matrix.is_some() };
    let at = |all: &Option<Vec<f64>>, i: usize, default: f64| {
        all.as_ref().and_then(|v| v.get(i)).copied().unwrap_or(default)
    };
    // A row of the matrix is an axis in the world.
    let axis = |i: usize| match &matrix {
        Some(m) if i < axes => DVec3::from(std::array::from_fn(|j| if j < axes { m[i * axes + j] } else { 0.0 })),
        _ => DVec3::AXES[i],
    };
    let vectors = [0, 1, 2].map(|i| axis(i) * at(&spacing, i, 1.0));
    let place = Place { vectors, origin: DVec3::from([0, 1, 2].map(|i| at(&origin, i, 0.0))), said };
    let geometry = place.geometry([dims[0], dims[1], dims[2]], &mut notes).map_err(|w| match matrix {
        Some(_) => w.in_field("TransformMatrix, ElementSpacing, DimSize or Offset"),
        None => w.in_field("ElementSpacing, DimSize or Offset"),
    })?;
    let unit = fields.get(&["DistanceUnits"]).and_then(units::length).map(|(name, _)| name.to_owned());
    Ok(SourceHeader { placement: said, space_unit: unit, notes, ..SourceHeader::new(FORMAT, geometry, voxel_type) })
}

//! An NRRD header with valid values.

use super::NrrdError;
use super::fields::{Field, Fields};
use super::space;
use crate::format::error::excerpt;
use crate::format::{Endian, VoxelType};
use crate::space::Geometry;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    Raw,
    Gzip,
}

/// Bytes between the skipped lines and the first voxel; of the decompressed stream for gzip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteSkip {
    Bytes(u64),
    /// `byte skip: -1`: the voxels are the file's last bytes.
    FromEnd,
}

#[derive(Debug, Clone, PartialEq)]
pub struct NrrdHeader {
    pub geometry: Geometry,
    pub voxel_type: VoxelType,
    pub encoding: Encoding,
    /// Little where the voxels are of one byte.
    pub endian: Endian,
    /// As the header names it; `None` where the data follow the header.
    pub data_file: Option<String>,
    /// Lines to leave out at the beginning of the data, before `byte_skip`.
    pub line_skip: u64,
    pub byte_skip: ByteSkip,
    /// Unit of spacing and origin.
    pub space_unit: Option<String>,
    /// Fill values that the header's keys declare.
    pub no_data: Vec<f64>,
    /// What was left aside, for people.
    pub notes: Vec<String>,
    /// Bytes of the header, the blank line included.
    pub length: usize,
}

impl NrrdHeader {
    /// Parses the beginning of a file, of which [`super::MAX_HEADER_BYTES`] are enough.
    ///
    /// # Errors
    /// Anything that is not a header of a volume that can be read, with its line.
    pub fn parse(start: &[u8]) -> Result<Self, NrrdError> {
        let fields = Fields::parse(start)?;
        let voxel_type = voxel_type(fields.require("type", "uint16")?)?;
        let dimension = fields.require("dimension", "3")?;
        match dimension.integer::<u64>()? {
            3 => {}
            value => return Err(NrrdError::Dimension { line: dimension.line, value }),
        }
        let sizes = sizes(fields.require("sizes", "512 512 400")?)?;
        if let Some(kinds) = fields.get("kinds") {
            check_kinds(kinds)?;
        }
        let encoding = encoding(fields.require("encoding", "raw")?)?;
        let endian = if voxel_type.bytes() > 1 { endian(fields.require("endian", "little")?)? } else { Endian::Little };
        let data_file = fields.get("data file").map(data_file).transpose()?;
        if data_file.is_none() && !fields.ended {
            return Err(NrrdError::NoEnd { bytes: start.len() });
        }
        let line_skip = fields.get("line skip").map_or(Ok(0), Field::integer)?;
        let byte_skip = fields.get("byte skip").map_or(Ok(ByteSkip::Bytes(0)), |field| byte_skip(field, encoding))?;

        let mut notes: Vec<String> =
            fields.unknown.iter().map(|name| format!("NRRD field `{name}` is unknown and was left aside")).collect();
        let (spacing, origin) = space::spacing_and_origin(&fields, &mut notes)?;
        let geometry = Geometry::new(sizes, spacing, origin).map_err(NrrdError::Geometry)?;
        let space_unit = space::unit(&fields, &mut notes);
        let no_data = super::no_data::declared(&fields.keys, &mut notes);
        let length = fields.length;
        Ok(Self {
            geometry,
            voxel_type,
            encoding,
            endian,
            data_file,
            line_skip,
            byte_skip,
            space_unit,
            no_data,
            notes,
            length,
        })
    }
}

/// The spellings of the NRRD specification. A bare `char` is none of them, since its sign depends on the machine.
fn voxel_type(field: &Field) -> Result<VoxelType, NrrdError> {
    let words: Vec<String> = field.value.split_whitespace().take(5).map(str::to_ascii_lowercase).collect();
    Ok(match words.join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => VoxelType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => VoxelType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => VoxelType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => VoxelType::U16,
        "int" | "signed int" | "int32" | "int32_t" => VoxelType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => VoxelType::U32,
        "float" | "float32" => VoxelType::F32,
        _ => return Err(NrrdError::Type { line: field.line, value: excerpt(&field.value) }),
    })
}

fn sizes(field: &Field) -> Result<[u32; 3], NrrdError> {
    let sizes: Option<Vec<u32>> = field.value.split_whitespace().take(4).map(|word| word.parse().ok()).collect();
    sizes
        .and_then(|sizes| <[u32; 3]>::try_from(sizes).ok())
        .ok_or_else(|| field.wrong("this must be three whole numbers, one an axis"))
}

/// Three axes of which one is a vector's are a 2-D picture, not a volume.
fn check_kinds(field: &Field) -> Result<(), NrrdError> {
    const SPATIAL: [&str; 7] = ["domain", "space", "time", "list", "stub", "none", "???"];
    let kinds = field.words();
    match kinds.iter().find(|kind| !SPATIAL.contains(&kind.to_ascii_lowercase().as_str())) {
        None => Ok(()),
        Some(kind) => Err(field.wrong(format!(
            "an axis of kind `{}` holds the components of vectors or colours; only one value a voxel is supported",
            excerpt(kind)
        ))),
    }
}

fn encoding(field: &Field) -> Result<Encoding, NrrdError> {
    match field.value.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gzip" | "gz" => Ok(Encoding::Gzip),
        _ => Err(NrrdError::Encoding { line: field.line, value: excerpt(&field.value) }),
    }
}

fn endian(field: &Field) -> Result<Endian, NrrdError> {
    match field.value.to_ascii_lowercase().as_str() {
        "little" => Ok(Endian::Little),
        "big" => Ok(Endian::Big),
        _ => Err(field.wrong("this must be little or big")),
    }
}

fn byte_skip(field: &Field, encoding: Encoding) -> Result<ByteSkip, NrrdError> {
    match field.integer::<i64>()? {
        -1 if encoding == Encoding::Raw => Ok(ByteSkip::FromEnd),
        -1 => Err(field.wrong("-1 needs encoding raw")),
        n => match u64::try_from(n) {
            Ok(n) => Ok(ByteSkip::Bytes(n)),
            Err(_) => Err(field.wrong("this must be -1, 0 or more")),
        },
    }
}

fn data_file(field: &Field) -> Result<String, NrrdError> {
    let several = |what| Err(NrrdError::SeveralFiles { line: field.line, value: excerpt(&field.value), what });
    let words: Vec<&str> = field.value.split_whitespace().take(6).collect();
    match words.as_slice() {
        [] => Err(field.wrong("the name of the data file is missing")),
        ["LIST"] | ["LIST", _] => several("LIST"),
        // `slice%03d.raw 1 100 1 [2]`
        [first, numbers @ ..]
            if first.contains('%') && numbers.len() >= 3 && numbers.iter().all(|n| n.parse::<i64>().is_ok()) =>
        {
            several("a numbered series")
        }
        // Such a name is broken, and would reach the terminal.
        _ if field.value.chars().any(char::is_control) => Err(field.wrong("a file's name has no control characters")),
        _ if field.value.len() > 4096 => Err(field.wrong("a file's name is at most 4096 bytes long")),
        _ => Ok(field.value.clone()),
    }
}

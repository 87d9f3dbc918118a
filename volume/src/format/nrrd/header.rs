//! An NRRD header with valid values.

use super::error::NrrdError;
use super::fields::{Field, Fields};
use super::files::{self, DataFiles};
use super::{axes, space};
use crate::format::excerpt::excerpt;
use crate::format::source::Placement;
use crate::format::voxel_type::{Endian, VoxelType};
use crate::space::Geometry;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    Raw,
    Gzip,
    Bzip2,
    Ascii,
    Hex,
}

/// Bytes between the skipped lines and the first voxel; of the decompressed stream for gzip and bzip2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteSkip {
    Bytes(u64),
    /// `byte skip: -1`: the voxels are the file's last bytes.
    FromEnd,
}

#[derive(Debug, Clone, PartialEq)]
pub struct NrrdHeader {
    pub geometry: Geometry,
    /// What of the geometry the header says.
    pub placement: Placement,
    pub voxel_type: VoxelType,
    pub encoding: Encoding,
    /// Little where the voxels are of one byte or written as numbers.
    pub endian: Endian,
    pub data_files: DataFiles,
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
        let mut fields = Fields::parse(start)?;
        let voxel_type = voxel_type(fields.require("type", "uint16")?)?;
        let dimension = fields.require("dimension", "3")?;
        let mut notes = Vec::new();
        let all_sizes = match dimension.integer::<u64>()? {
            3 => sizes(fields.require("sizes", "512 512 400")?)?.to_vec(),
            value @ ..4 => return Err(NrrdError::Dimension { line: dimension.line, value }),
            value => {
                let all = all_sizes(fields.require("sizes", "512 512 400 1")?, value)?;
                axes::leave_out(&mut fields, &all, &mut notes)?;
                all
            }
        };
        let sizes = sizes(fields.require("sizes", "512 512 400")?)?;
        if let Some(kinds) = fields.get("kinds") {
            check_kinds(kinds)?;
        }
        let encoding = encoding(fields.require("encoding", "raw")?)?;
        let has_order = voxel_type.bytes() > 1 && encoding != Encoding::Ascii;
        let endian = if has_order { endian(fields.require("endian", "little")?)? } else { Endian::Little };
        let data_files = match (files::named(&fields)?, fields.get("data file")) {
            (Some(named), Some(field)) => files::shared(field, named, &all_sizes, sizes[2])?,
            _ if fields.ended => DataFiles::Attached,
            _ => return Err(NrrdError::NoEnd { bytes: start.len() }),
        };
        let line_skip = fields.get("line skip").map_or(Ok(0), Field::integer)?;
        let byte_skip = fields.get("byte skip").map_or(Ok(ByteSkip::Bytes(0)), |field| byte_skip(field, encoding))?;

        notes.extend(fields.unknown.iter().map(|name| format!("NRRD field `{name}` is unknown and was left aside")));
        let (geometry, placement) = space::geometry(&fields, sizes, &mut notes)?;
        let space_unit = space::unit(&fields, &mut notes);
        let no_data = super::no_data::declared(&fields.keys, &mut notes);
        let length = fields.length;
        Ok(Self {
            geometry,
            placement,
            voxel_type,
            encoding,
            endian,
            data_files,
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
        "double" | "float64" => VoxelType::F64,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => VoxelType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => VoxelType::U64,
        _ => return Err(NrrdError::Type { line: field.line, value: excerpt(&field.value) }),
    })
}

/// Of a header of `dimension` axes, of which at most three may be longer than 1.
fn all_sizes(field: &Field, dimension: u64) -> Result<Vec<u32>, NrrdError> {
    let most = usize::try_from(dimension).unwrap_or(usize::MAX).min(17);
    let sizes: Option<Vec<u32>> = field.value.split_whitespace().take(most + 1).map(|word| word.parse().ok()).collect();
    sizes
        .filter(|sizes| sizes.len() == most)
        .ok_or_else(|| field.wrong(format!("this must be {dimension} whole numbers, one an axis")))
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
        "bzip2" | "bz2" => Ok(Encoding::Bzip2),
        "ascii" | "text" | "txt" => Ok(Encoding::Ascii),
        "hex" => Ok(Encoding::Hex),
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

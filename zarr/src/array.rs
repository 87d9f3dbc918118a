//! An array: its shape, how it is cut into chunks, where those lie and what was done to their bytes.

use brickcast_volume::format::VoxelType;
use brickcast_volume::json_fields::{FieldError, Fields};
use brickcast_volume::shown::shown;
use serde_json::Value;

use crate::codec::{self, Codec};
use crate::error::{MAX_CHUNK_BYTES, OmeZarrError};
use crate::json::{Json, below};
use crate::node::{Node, Version};
use crate::shards::Sharding;

/// OME-Zarr has up to five.
const MOST_AXES: usize = 8;
/// Of a shape: products of two stay within 64 bits.
const MOST_ALONG_AXIS: u64 = 1 << 31;
const BYTE_ORDERS: &str = "`little` and `big`";

#[derive(Debug, Clone)]
pub(crate) struct Array {
    /// Of its folder.
    pub(crate) path: String,
    /// What describes it.
    pub(crate) json: Json,
    pub(crate) shape: Vec<u64>,
    /// Of what is decoded at once: a chunk, or an inner chunk of a shard.
    pub(crate) chunk: Vec<u64>,
    /// From an element of a decoded chunk to the next along each axis, elements.
    pub(crate) strides: Vec<usize>,
    pub(crate) sharding: Option<Sharding>,
    pub(crate) voxel_type: VoxelType,
    pub(crate) is_big_endian: bool,
    /// A voxel of a chunk that is not there, little endian.
    pub(crate) fill: Vec<u8>,
    pub(crate) codecs: Vec<Codec>,
    keys: Keys,
}

/// How the places of chunks are written.
#[derive(Debug, Clone)]
struct Keys {
    prefix: &'static str,
    separator: char,
}

/// What a version of Zarr says of the bytes of a chunk.
struct Coded {
    is_big_endian: bool,
    codecs: Vec<Codec>,
    /// The axes in the order in which they were written, the slowest first.
    order: Vec<usize>,
    sharding: Option<(Vec<u64>, Sharding)>,
}

impl Array {
    /// Of a node that is one.
    pub(crate) fn of(node: &Node, json: &Json) -> Result<Self, OmeZarrError> {
        let fields = json.fields();
        let field = |error: FieldError| json.wrong(error);
        let shape: Vec<u64> = fields.get("shape").map_err(field)?;
        if !(1..=MOST_AXES).contains(&shape.len()) || shape.iter().any(|n| !(1..=MOST_ALONG_AXIS).contains(n)) {
            let why = format!("1 to {MOST_AXES} axes of 1 to {MOST_ALONG_AXIS} are read");
            return Err(field(fields.refused("shape", why)));
        }
        let (written, keys, voxel_type, coded) = match node.version {
            Version::V2 => v2(json, shape.len())?,
            Version::V3 => v3(json, shape.len())?,
        };
        if written.len() != shape.len() || written.iter().any(|n| !(1..=MOST_ALONG_AXIS).contains(n)) {
            let axes = shape.len();
            return Err(json
                .problem(format!("chunks of {written:?}, of which {axes} axes of 1 to {MOST_ALONG_AXIS} are needed")));
        }
        let Coded { is_big_endian, codecs, order, sharding } = coded;
        let (chunk, sharding) = match sharding {
            Some((inner, sharding)) => {
                let sharding = sharding.cut(json, &written, &inner)?;
                (inner, Some(sharding))
            }
            None => (written, None),
        };
        let voxel_bytes = voxel_type.bytes();
        let bytes = chunk.iter().try_fold(voxel_bytes as u64, |bytes, n| bytes.checked_mul(*n));
        if bytes.is_none_or(|bytes| bytes > MAX_CHUNK_BYTES as u64) {
            return Err(OmeZarrError::LargeChunk { file: json.file.clone(), shape: chunk, voxel_bytes });
        }
        let mut strides = vec![0; chunk.len()];
        let mut stride = 1;
        for axis in order.iter().rev() {
            strides[*axis] = stride;
            stride *= chunk[*axis] as usize;
        }
        let fill = fill(json, voxel_type)?;
        let (path, json) = (node.path.clone(), json.clone());
        Ok(Self { path, json, shape, chunk, strides, sharding, voxel_type, is_big_endian, fill, codecs, keys })
    }

    /// Bytes of a decoded chunk.
    pub(crate) fn chunk_bytes(&self) -> usize {
        self.chunk.iter().product::<u64>() as usize * self.voxel_type.bytes()
    }

    /// Where the chunk or shard lies that is the `at`th along each axis.
    pub(crate) fn key(&self, at: &[u64]) -> String {
        let mut key = self.keys.prefix.to_owned();
        for (axis, at) in at.iter().enumerate() {
            if axis > 0 || !key.is_empty() {
                key.push(self.keys.separator);
            }
            key += &at.to_string();
        }
        below(&self.path, &key)
    }
}

type Described = (Vec<u64>, Keys, VoxelType, Coded);

fn v2(json: &Json, axes: usize) -> Result<Described, OmeZarrError> {
    let fields = json.fields();
    let field = |error: FieldError| json.wrong(error);
    if fields.value("zarr_format").map_err(field)? != 2 {
        return Err(field(fields.refused("zarr_format", ".zarray is of version 2")));
    }
    let (voxel_type, is_big_endian) = match fields.value("dtype").map_err(field)? {
        Value::String(name) => v2_type(json, name)?,
        _ => return Err(field(fields.refused("dtype", "one number a voxel is read, such as \"<u2\""))),
    };
    let separator = separator(json, &fields, "dimension_separator", '.')?;
    let order = match fields.get_optional::<&str>("order").map_err(field)?.unwrap_or("C") {
        "C" => (0..axes).collect(),
        "F" => (0..axes).rev().collect(),
        _ => return Err(field(fields.refused("order", "`C` and `F` are read"))),
    };
    let filters = fields.optional("filters").map_or(Ok(&[][..]), |filters| {
        filters.as_array().map(Vec::as_slice).ok_or_else(|| field(fields.refused("filters", "a list is needed")))
    })?;
    let mut codecs = Vec::new();
    for codec in filters.iter().chain(fields.optional("compressor")) {
        let name = codec.get("id").and_then(Value::as_str).unwrap_or_default();
        codecs.push(Codec::of(name).ok_or_else(|| unknown(json, "codec", name, codec::READ))?);
    }
    let chunks = fields.get("chunks").map_err(field)?;
    let coded = Coded { is_big_endian, codecs, order, sharding: None };
    Ok((chunks, Keys { prefix: "", separator }, voxel_type, coded))
}

/// Byte order, kind and bytes: `<u2`, `|u1`, `>f4`.
fn v2_type(json: &Json, name: &str) -> Result<(VoxelType, bool), OmeZarrError> {
    let bytes = name.as_bytes();
    let kind = bytes.get(1..).and_then(|kind| {
        Some(match kind {
            b"u1" => VoxelType::U8,
            b"i1" => VoxelType::I8,
            b"u2" => VoxelType::U16,
            b"i2" => VoxelType::I16,
            b"u4" => VoxelType::U32,
            b"i4" => VoxelType::I32,
            b"u8" => VoxelType::U64,
            b"i8" => VoxelType::I64,
            b"f4" => VoxelType::F32,
            b"f8" => VoxelType::F64,
            _ => return None,
        })
    });
    match (bytes.first(), kind) {
        (Some(b'<' | b'|'), Some(kind)) => Ok((kind, false)),
        (Some(b'>'), Some(kind)) => Ok((kind, true)),
        _ => Err(unknown(json, "voxel type", name, VoxelType::NAMES)),
    }
}

fn v3(json: &Json, axes: usize) -> Result<Described, OmeZarrError> {
    let fields = json.fields();
    let field = |error: FieldError| json.wrong(error);
    let name = fields.value("data_type").map_err(field)?;
    let name = name.as_str().or_else(|| name.get("name")?.as_str()).unwrap_or_default();
    let voxel_type = name.parse().ok().filter(|voxel_type: &VoxelType| voxel_type.name() == name);
    let voxel_type = voxel_type.ok_or_else(|| unknown(json, "voxel type", name, VoxelType::NAMES))?;
    if let Some(Value::Array(list)) = fields.optional("storage_transformers")
        && !list.is_empty()
    {
        return Err(field(fields.refused("storage_transformers", "none is known")));
    }
    let grid = fields.object("chunk_grid").map_err(field)?;
    let kind: &str = grid.get("name").map_err(field)?;
    if kind != "regular" {
        return Err(unknown(json, "chunk grid", kind, "regular"));
    }
    let chunks = grid.object("configuration").and_then(|c| c.get("chunk_shape")).map_err(field)?;
    let keys = fields.object("chunk_key_encoding").map_err(field)?;
    let (prefix, usual) = match keys.get::<&str>("name").map_err(field)? {
        "default" => ("c", '/'),
        "v2" => ("", '.'),
        name => return Err(unknown(json, "chunk key encoding", name, "default, v2")),
    };
    let separator = match keys.object_optional("configuration").map_err(field)? {
        Some(configuration) => separator(json, &configuration, "separator", usual)?,
        None => usual,
    };
    let codecs = fields.objects("codecs").map_err(field)?;
    let coded = v3_codecs(json, &codecs, axes)?;
    Ok((chunks, Keys { prefix, separator }, voxel_type, coded))
}

/// From array to bytes: `transpose` any times, then `bytes` or, first of all and at the outer level, shards.
fn v3_codecs(json: &Json, list: &[Fields<'_>], axes: usize) -> Result<Coded, OmeZarrError> {
    let field = |error: FieldError| json.wrong(error);
    let mut order: Vec<usize> = (0..axes).collect();
    let mut coded: Option<Coded> = None;
    for (place, codec) in list.iter().enumerate() {
        let name: &str = codec.get("name").map_err(field)?;
        let configuration = codec.object_optional("configuration").map_err(field)?;
        match (name, &mut coded) {
            ("transpose", None) => {
                let by: Vec<usize> = needed(json, configuration, name)?.get("order").map_err(field)?;
                let mut sorted = by.clone();
                sorted.sort_unstable();
                if !sorted.into_iter().eq(0..axes) {
                    return Err(json.problem(format!("transpose by {by:?}: each of {axes} axes is needed once")));
                }
                order = by.iter().map(|axis| order[*axis]).collect();
            }
            ("bytes", None) => {
                let endian = configuration.map_or(Ok(None), |c| c.get_optional("endian")).map_err(field)?;
                let is_big_endian = match endian {
                    None | Some("little") => false,
                    Some("big") => true,
                    Some(other) => return Err(unknown(json, "byte order", other, BYTE_ORDERS)),
                };
                coded = Some(Coded { is_big_endian, codecs: Vec::new(), order: order.clone(), sharding: None });
            }
            ("sharding_indexed", None) if place == 0 && list.len() == 1 => {
                let configuration = needed(json, configuration, name)?;
                let inner: Vec<u64> = configuration.get("chunk_shape").map_err(field)?;
                let within = v3_codecs(json, &configuration.objects("codecs").map_err(field)?, axes)?;
                if within.sharding.is_some() {
                    return Err(json.problem("shards in shards are not read; write them once"));
                }
                coded = Some(Coded { sharding: Some((inner, Sharding::of(json, &configuration)?)), ..within });
            }
            ("sharding_indexed", _) => {
                return Err(json.problem("sharding_indexed beside other codecs is not read; it must be the only one"));
            }
            (_, Some(coded)) => {
                let codec = Codec::of(name).ok_or_else(|| unknown(json, "codec", name, codec::READ))?;
                coded.codecs.push(codec);
            }
            (name, None) => return Err(unknown(json, "codec", name, codec::READ)),
        }
    }
    coded.ok_or_else(|| json.problem("its codecs lack `bytes`, which makes bytes of an array"))
}

fn needed<'a>(json: &Json, configuration: Option<Fields<'a>>, codec: &str) -> Result<Fields<'a>, OmeZarrError> {
    configuration.ok_or_else(|| json.problem(format!("the codec {codec} has no configuration")))
}

fn separator(json: &Json, fields: &Fields<'_>, key: &str, usual: char) -> Result<char, OmeZarrError> {
    match fields.get_optional::<&str>(key).map_err(|error| json.wrong(error))? {
        None => Ok(usual),
        Some("/") => Ok('/'),
        Some(".") => Ok('.'),
        Some(_) => Err(json.wrong(fields.refused(key, "`/` and `.` are read"))),
    }
}

fn unknown(json: &Json, what: &'static str, name: &str, read: &'static str) -> OmeZarrError {
    let name = shown(name).chars().take(60).collect();
    OmeZarrError::Unsupported { file: json.file.clone(), what, name, read }
}

/// The fill value as a voxel: a number, or what JSON has no number for, in words or as bits (`0x7fc00000`).
fn fill(json: &Json, voxel_type: VoxelType) -> Result<Vec<u8>, OmeZarrError> {
    let fields = json.fields();
    let refused = || json.wrong(fields.refused("fill_value", format!("a voxel of {voxel_type} cannot be that")));
    let value = fields.optional("fill_value").cloned().unwrap_or(Value::from(0));
    let float = match &value {
        Value::String(text) => match text.as_str() {
            "NaN" => Some(f64::NAN),
            "Infinity" => Some(f64::INFINITY),
            "-Infinity" => Some(f64::NEG_INFINITY),
            _ => None,
        },
        value => value.as_f64(),
    };
    let bits = value.as_str().and_then(|text| u64::from_str_radix(text.strip_prefix("0x")?, 16).ok());
    let bytes = match voxel_type {
        VoxelType::F32 => match bits {
            Some(bits) => u32::try_from(bits).ok().map(|bits| bits.to_le_bytes().to_vec()),
            None => float.map(|value| (value as f32).to_le_bytes().to_vec()),
        },
        VoxelType::F64 => match bits {
            Some(bits) => Some(bits.to_le_bytes().to_vec()),
            None => float.map(|value| value.to_le_bytes().to_vec()),
        },
        integer => {
            // Python writes 0.0 for integers, too.
            let whole = float.filter(|value| value.fract() == 0.0 && value.abs() < 2f64.powi(53));
            let number = match &value {
                Value::Number(number) => number.as_i128().or(whole.map(|value| value as i128)),
                _ => None,
            };
            let size = integer.bytes();
            let (least, most) = match integer {
                VoxelType::I8 | VoxelType::I16 | VoxelType::I32 | VoxelType::I64 => {
                    (-(1i128 << (8 * size - 1)), (1i128 << (8 * size - 1)) - 1)
                }
                _ => (0, (1i128 << (8 * size)) - 1),
            };
            let number = number.filter(|number| (least..=most).contains(number));
            number.map(|number| number.to_le_bytes()[..size].to_vec())
        }
    };
    bytes.ok_or_else(refused)
}

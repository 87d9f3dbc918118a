//! What can be wrong with an OME-Zarr image, with its operands and the way out.

use std::path::PathBuf;

use brickcast_volume::format::FormatError;
use brickcast_volume::json_fields::FieldError;
use brickcast_volume::space::GeometryError;
use brickcast_volume::store::{Objects, StoreError};

/// The most bytes that a chunk, or the inner chunk of a shard, may be decoded.
pub const MAX_CHUNK_BYTES: usize = 1 << 30;

/// Why an image was not opened, or its voxels not read. Files are keys below the place that was named.
#[derive(Debug, thiserror::Error)]
pub enum OmeZarrError {
    #[error(transparent)]
    Read(#[from] StoreError),
    #[error("no Zarr lies here: there is neither zarr.json nor .zattrs, .zarray or .zgroup; name an image's folder")]
    Nothing,
    #[error("{file} is no JSON: {reason}; copy or export it again")]
    Json { file: String, reason: String },
    #[error("{file}: {reason}")]
    Field { file: String, reason: FieldError },
    #[error("{file}: {problem}")]
    Metadata { file: String, problem: String },
    #[error("{file}: the {what} `{name}` is not read; read are: {read}")]
    Unsupported { file: String, what: &'static str, name: String, read: &'static str },
    #[error("it holds {} images: {}; name one, such as PATH/{}", .0.len(), listed(.0), .0.first().map_or("0", |n| n))]
    SeveralImages(Vec<String>),
    #[error("it is a plate of wells, which hold the images; name one, such as PATH/{example}")]
    Plate { example: String },
    #[error("{group} has no `multiscales`, which say what is an image, and no images `0`, `1`, ... below it")]
    NoImage { group: String },
    #[error("{flag} {asked}: there are {count}, counted from 0")]
    Index { flag: &'static str, asked: u64, count: u64 },
    #[error("{flag} {asked}: it has no axis for it; leave the flag out")]
    NoAxis { flag: &'static str, asked: u64 },
    #[error(
        "{file}: its chunks are {shape:?} voxels of {voxel_bytes} bytes, more than the {MAX_CHUNK_BYTES} bytes that \
         are decoded at once; write it in smaller chunks"
    )]
    LargeChunk { file: String, shape: Vec<u64>, voxel_bytes: usize },
    #[error("the geometry of its metadata: {0}")]
    Geometry(#[from] GeometryError),
    #[error("chunk {key}: {reason}; copy or export it again")]
    Chunk { key: String, reason: ChunkFault },
    #[error(
        "of array {array} not one chunk is there ({example} is where the first would be), so every voxel would be its \
         fill value; copy its chunks, too"
    )]
    NoChunks { array: String, example: String },
    #[error("{bytes} bytes of voxels do not fit into memory; use a machine with more")]
    Memory { bytes: u64 },
}

/// What is wrong with the bytes of a chunk.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ChunkFault {
    #[error("{got} bytes came of it, {want} are due")]
    Length { got: usize, want: usize },
    #[error("broken {codec} data: {reason}")]
    Broken { codec: &'static str, reason: String },
    #[error("its {codec} data goes on after the {most} bytes that can be in it")]
    TooLong { codec: &'static str, most: usize },
    #[error("its checksum is {got:08x}, {want:08x} is written behind it")]
    Checksum { got: u32, want: u32 },
    #[error("it has {got} bytes, no chunk of {decoded} bytes has more than {most}")]
    Encoded { got: u64, decoded: usize, most: u64 },
    #[error("its shard says that it lies at bytes {start} to {end}, where the shard has {bytes}")]
    Beyond { start: u64, end: u128, bytes: u64 },
    #[error("its shard has {got} bytes, its index alone needs {index}")]
    ShardLength { got: u64, index: u64 },
}

/// An error of the image at `objects`, as one of a file.
pub(crate) fn failed(objects: &dyn Objects, reason: OmeZarrError) -> FormatError {
    FormatError::Header { path: PathBuf::from(objects.place()), reason: Box::new(reason) }
}

/// The first few of names.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 8;
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ") + more
}

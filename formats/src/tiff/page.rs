//! A page: what its tags say of its pixels.

use brickcast_volume::format::VoxelType;

use super::file::{Directory, Entry, TiffFile};
use crate::packed::Packing;
use crate::slice::Shape;
use crate::wrong::Wrong;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compression {
    Packed(Packing),
    Lzw,
    PackBits,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Predictor {
    None,
    Horizontal,
    Float,
}

/// Strips are tiles as wide as the page.
#[derive(Debug)]
pub(super) struct Page {
    pub(super) shape: Shape,
    pub(super) samples: u32,
    pub(super) compression: Compression,
    pub(super) predictor: Predictor,
    pub(super) tile: [u32; 2],
    /// Strips end with the page, tiles with themselves.
    pub(super) is_tiled: bool,
    pub(super) offsets: Entry,
    pub(super) counts: Option<Entry>,
    /// Of one value; what colours mean is left aside.
    pub(super) note: Option<&'static str>,
}

const WIDTH: u16 = 256;
const HEIGHT: u16 = 257;
const BITS: u16 = 258;
const COMPRESSION: u16 = 259;
const PHOTOMETRIC: u16 = 262;
const FILL_ORDER: u16 = 266;
const STRIP_OFFSETS: u16 = 273;
const SAMPLES: u16 = 277;
const ROWS: u16 = 278;
const STRIP_COUNTS: u16 = 279;
const PLANAR: u16 = 284;
const PREDICTOR: u16 = 317;
const TILE_WIDTH: u16 = 322;
const TILE_LENGTH: u16 = 323;
const TILE_OFFSETS: u16 = 324;
const TILE_COUNTS: u16 = 325;
const SAMPLE_FORMAT: u16 = 339;

const CONVERT: &str = "convert the slices to grey of 8, 16 or 32 bits";
const RECOMPRESS: &str = "save it uncompressed, or with LZW, deflate, PackBits or zstd";

impl Page {
    pub(super) fn of(tiff: &mut TiffFile, directory: &Directory) -> Result<Self, Wrong> {
        let edge = |n: Option<u64>, what: &str| {
            let edge = n.and_then(|n| u32::try_from(n).ok()).filter(|n| (1..=1 << 20).contains(n));
            edge.ok_or_else(|| Wrong::broken(what, n.map_or("it is not said".into(), |n| n.to_string())))
        };
        let size =
            [edge(tiff.one(directory, WIDTH)?, "ImageWidth")?, edge(tiff.one(directory, HEIGHT)?, "ImageLength")?];
        let samples = tiff.one(directory, SAMPLES)?.unwrap_or(1);
        let bits = tiff.all(directory, BITS)?;
        let formats = tiff.all(directory, SAMPLE_FORMAT)?;
        let same = |all: &[u64], default| match all.first() {
            None => Some(default),
            Some(first) => all.iter().all(|n| n == first).then_some(*first),
        };
        let (bits, format) = (same(&bits, 1).unwrap_or(0), same(&formats, 1).unwrap_or(0));
        let voxel_type = match (format, bits) {
            (1 | 4, 8) => VoxelType::U8,
            (1 | 4, 16) => VoxelType::U16,
            (1 | 4, 32) => VoxelType::U32,
            (1 | 4, 64) => VoxelType::U64,
            (2, 8) => VoxelType::I8,
            (2, 16) => VoxelType::I16,
            (2, 32) => VoxelType::I32,
            (2, 64) => VoxelType::I64,
            (3, 32) => VoxelType::F32,
            (3, 64) => VoxelType::F64,
            _ => return Err(Wrong::new("BitsPerSample", format!("{bits} bits of format {format}"), CONVERT)),
        };
        let note = match tiff.one(directory, PHOTOMETRIC)?.unwrap_or(1) {
            1 | 32844 => None,
            0 => Some("white is 0 there: the numbers were taken as they are"),
            2 => None,
            3 => Some("its colours are of a palette: the numbers were taken as they are"),
            other => return Err(Wrong::new("PhotometricInterpretation", format!("{other}: no grey"), CONVERT)),
        };
        if !(1..=4).contains(&samples) {
            return Err(Wrong::new("SamplesPerPixel", samples.to_string(), CONVERT));
        }
        if samples > 1 && tiff.one(directory, PLANAR)? == Some(2) {
            return Err(Wrong::new("PlanarConfiguration", "2: several values a pixel, each by itself", CONVERT));
        }
        if tiff.one(directory, FILL_ORDER)?.unwrap_or(1) != 1 {
            return Err(Wrong::new("FillOrder", "bits are the other way round", RECOMPRESS));
        }
        let compression = match tiff.one(directory, COMPRESSION)?.unwrap_or(1) {
            1 => Compression::Packed(Packing::None),
            5 => Compression::Lzw,
            8 | 32946 => Compression::Packed(Packing::Zlib),
            32773 => Compression::PackBits,
            50000 | 34926 => Compression::Packed(Packing::Zstd),
            other => {
                let name = match other {
                    6 | 7 | 33007 => " (JPEG)",
                    34712 | 33003 | 33005 => " (JPEG 2000)",
                    34887 => " (LERC)",
                    34925 => " (LZMA)",
                    50001 => " (WebP)",
                    50002 => " (JPEG XL)",
                    2..=4 => " (fax)",
                    _ => "",
                };
                return Err(Wrong::new("Compression", format!("{other}{name} is not read"), RECOMPRESS));
            }
        };
        let predictor = match (tiff.one(directory, PREDICTOR)?.unwrap_or(1), voxel_type) {
            (1, _) => Predictor::None,
            _ if compression == Compression::Packed(Packing::None) => Predictor::None,
            (2, _) => Predictor::Horizontal,
            (3, VoxelType::F32 | VoxelType::F64) => Predictor::Float,
            (other, _) => return Err(Wrong::new("Predictor", format!("{other} of {voxel_type}"), RECOMPRESS)),
        };
        let tile_size = (tiff.one(directory, TILE_WIDTH)?, tiff.one(directory, TILE_LENGTH)?);
        let (tile, is_tiled, offsets, counts) = match tile_size {
            (None, None) => {
                let rows = tiff.one(directory, ROWS)?.unwrap_or(u64::MAX).clamp(1, size[1].into()) as u32;
                ([size[0], rows], false, STRIP_OFFSETS, STRIP_COUNTS)
            }
            (width, length) => {
                let tile = [edge(width, "TileWidth")?, edge(length, "TileLength")?];
                // ITK and others write the tiles' list under the name of the strips'.
                let list = |tiles, strips| if directory.get(tiles).is_some() { tiles } else { strips };
                (tile, true, list(TILE_OFFSETS, STRIP_OFFSETS), list(TILE_COUNTS, STRIP_COUNTS))
            }
        };
        let offsets = directory.get(offsets).ok_or_else(|| Wrong::broken("StripOffsets", "they are not said"))?;
        Ok(Self {
            shape: Shape { size, voxel_type },
            samples: samples as u32,
            compression,
            predictor,
            tile,
            is_tiled,
            offsets,
            counts: directory.get(counts),
            note,
        })
    }

    /// Bytes of a pixel, with all its samples.
    pub(super) fn pixel(&self) -> u64 {
        u64::from(self.samples) * self.shape.voxel_type.bytes() as u64
    }

    /// Is the plane one run of bytes as they are?
    pub(super) fn is_plain(&self) -> bool {
        self.compression == Compression::Packed(Packing::None) && !self.is_tiled && self.samples == 1
    }
}

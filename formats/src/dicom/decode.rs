//! Coded frames, and numbers that fill a part of their words.

use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image as Jpeg2000};

use super::bits::Bits;
use super::rle;
use super::syntax::{Codec, REWRITE};
use crate::picture;
use crate::slice::Shape;
use crate::wrong::Wrong;

/// Lossless JPEG has a bit a pixel at least.
const PIXELS_OF_JPEG: u64 = 8;
/// JPEG-LS and JPEG 2000 write flat planes in next to nothing; what is larger than this must have some bytes.
const PIXELS_OF_ANY: u64 = 1 << 24;
const PIXELS_A_BYTE: u64 = 64;

/// Numbers little endian; that there are as many as wanted, the caller checks.
pub(super) fn decoded(codec: Codec, coded: Vec<u8>, shape: Shape, bits: Bits) -> Result<Vec<u8>, Wrong> {
    let pixels = u64::from(shape.size[0]) * u64::from(shape.size[1]);
    let bytes = shape.voxel_type.bytes();
    let most = match codec {
        Codec::Raw | Codec::Rle | Codec::Jpeg => u64::MAX,
        Codec::JpegLossless => PIXELS_OF_JPEG * coded.len() as u64,
        Codec::JpegLs | Codec::Jpeg2000 => PIXELS_OF_ANY.max(PIXELS_A_BYTE * coded.len() as u64),
    };
    if pixels > most {
        return Err(Wrong::broken("PixelData", format!("{} bytes hold no {pixels} pixels", coded.len())));
    }
    match codec {
        Codec::Raw => Ok(pieces(coded, pixels, bytes)),
        Codec::Rle => rle::unpacked(&coded, pixels as usize, bytes),
        Codec::Jpeg => jpeg(&coded, shape),
        Codec::JpegLossless => jpeg_lossless(&coded, shape),
        Codec::JpegLs => jpeg_ls(&coded, shape),
        Codec::Jpeg2000 => jpeg_2000(&coded, shape, bits),
    }
}

/// Without the byte that makes a fragment's length even.
fn pieces(mut coded: Vec<u8>, pixels: u64, bytes: usize) -> Vec<u8> {
    if coded.len() as u64 == pixels * bytes as u64 + 1 {
        coded.pop();
    }
    coded
}

fn broken(what: &str, why: impl std::fmt::Display) -> Wrong {
    Wrong::new("PixelData", format!("{what}: {why}"), REWRITE)
}

fn other_size(what: &str, [x, y]: [u32; 2], shape: Shape) -> Wrong {
    let [columns, rows] = shape.size;
    broken(what, format!("{x} x {y} pixels, but Columns and Rows say {columns} x {rows}"))
}

/// Numbers of 16 bits as the file's words have them.
fn words(numbers: impl ExactSizeIterator<Item = u32>, bytes: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(numbers.len() * bytes);
    numbers.for_each(|n| out.extend_from_slice(&u64::from(n).to_le_bytes()[..bytes]));
    out
}

fn jpeg(coded: &[u8], shape: Shape) -> Result<Vec<u8>, Wrong> {
    let what = "JPEG";
    let (found, data) =
        picture::decoded_jpeg(coded).map_err(|wrong| wrong.in_field("PixelData").with_remedy(REWRITE))?;
    if found.size != shape.size {
        return Err(other_size(what, found.size, shape));
    }
    Ok(words(data.iter().map(|n| u32::from(*n)), shape.voxel_type.bytes()))
}

fn jpeg_lossless(coded: &[u8], shape: Shape) -> Result<Vec<u8>, Wrong> {
    let what = "lossless JPEG";
    let mut decoder = jpeg_decoder::Decoder::new(coded);
    decoder.read_info().map_err(|e| broken(what, e))?;
    let info = decoder.info().ok_or_else(|| broken(what, "it says no size"))?;
    let size = [info.width.into(), info.height.into()];
    if size != shape.size {
        return Err(other_size(what, size, shape));
    }
    let (is_short, is_grey) = match info.pixel_format {
        jpeg_decoder::PixelFormat::L8 => (false, true),
        jpeg_decoder::PixelFormat::L16 => (true, true),
        _ => (false, false),
    };
    if !is_grey || info.coding_process != jpeg_decoder::CodingProcess::Lossless {
        return Err(broken(what, "several values a pixel, or none of lossless JPEG"));
    }
    let data = decoder.decode().map_err(|e| broken(what, e))?;
    let bytes = shape.voxel_type.bytes();
    Ok(match is_short {
        true => words(data.as_chunks::<2>().0.iter().map(|n| u16::from_ne_bytes(*n).into()), bytes),
        false => words(data.iter().map(|n| u32::from(*n)), bytes),
    })
}

fn jpeg_ls(coded: &[u8], shape: Shape) -> Result<Vec<u8>, Wrong> {
    let [x, y] = shape.size;
    let (numbers, ..) = jpegls::decode(coded, x, y).map_err(|e| broken("JPEG-LS", e))?;
    Ok(words(numbers.iter().map(|n| u32::from(*n)), shape.voxel_type.bytes()))
}

/// What the codestream begins with.
const START: &[u8] = b"\xff\x4f\xff\x51";
/// Where it says how many values a pixel has.
const VALUES: usize = 40;
/// Of the first component's bits: the highest bit says that numbers are signed.
const SIZE: usize = 42;

fn jpeg_2000(coded: &[u8], shape: Shape, bits: Bits) -> Result<Vec<u8>, Wrong> {
    let what = "JPEG 2000";
    // Some lie in the boxes of a file, which say of colours what DICOM says better.
    let at = coded.windows(START.len()).position(|w| w == START).ok_or_else(|| broken(what, "it has no start"))?;
    let coded = &coded[at..];
    // All would be decoded before they are counted.
    match coded.get(VALUES..VALUES + 2) {
        Some([0, 1]) => {}
        Some(&[high, low]) => {
            return Err(broken(what, format!("{} values a pixel", u16::from_be_bytes([high, low]))));
        }
        _ => return Err(broken(what, "its header is cut")),
    }
    let is_signed = coded.get(SIZE).is_some_and(|bits| bits & 0x80 != 0);
    let settings = DecodeSettings { strict: true, ..DecodeSettings::default() };
    let image = Jpeg2000::new(coded, &settings).map_err(|e| broken(what, e))?;
    let size = [image.width(), image.height()];
    if size != shape.size {
        return Err(other_size(what, size, shape));
    }
    let depth = image.original_bit_depth();
    if depth > 16 || u32::from(depth) > bits.allocated || shape.voxel_type.bytes() > 4 {
        return Err(broken(what, format!("{depth} bits in words of {}", bits.allocated)));
    }
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(|e| broken(what, e))?;
    let [component] = decoded.components() else { return Err(broken(what, "several values a pixel")) };
    let shift = if is_signed { 1_i32 << (depth - 1) } else { 0 };
    let numbers = component.samples().iter().map(|n| (n.round() as i32 - shift) as u32);
    Ok(words(numbers, shape.voxel_type.bytes()))
}

#[cfg(test)]
mod tests {
    use brickcast_volume::format::VoxelType;

    use super::*;

    #[test]
    fn what_would_be_large_is_refused_before_it_is_decoded() {
        let bits = Bits { allocated: 16, stored: 16, shift: 0, is_signed: false };
        let shape = |edge| Shape { size: [edge, edge], voxel_type: VoxelType::U16 };
        let mut many = [START, &[0; 60]].concat();
        (many[VALUES], many[VALUES + 1]) = (0x40, 0);
        let why = decoded(Codec::Jpeg2000, many.clone(), shape(16), bits).unwrap_err();
        assert!(format!("{why:?}").contains("16384 values a pixel"), "{why:?}");
        for codec in [Codec::Jpeg2000, Codec::JpegLs, Codec::JpegLossless] {
            let why = decoded(codec, many.clone(), shape(1 << 14), bits).unwrap_err();
            assert!(format!("{why:?}").contains("hold no"), "{codec:?}: {why:?}");
        }
    }
}

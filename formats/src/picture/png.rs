//! PNG: grey of 1 to 16 bits, and colour whose samples are equal. Numbers as they stand there, without gamma.

use brickcast_volume::format::VoxelType;
use png::{BitDepth, ColorType, Decoder, Limits, Transformations};

use crate::grey::grey;
use crate::slice::Shape;
use crate::wrong::Wrong;

/// The most bytes of a decoded slice.
const MOST: u64 = 1 << 30;

fn reader(bytes: &[u8]) -> Result<png::Reader<std::io::Cursor<&[u8]>>, Wrong> {
    let limits = Limits { bytes: 64 << 20 };
    let mut decoder = Decoder::new_with_limits(std::io::Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::IDENTITY);
    decoder.ignore_checksums(false);
    decoder.read_info().map_err(|e| Wrong::broken("header", e))
}

fn shape_of(info: &png::Info<'_>) -> Result<Shape, Wrong> {
    let voxel_type = if info.bit_depth == BitDepth::Sixteen { VoxelType::U16 } else { VoxelType::U8 };
    if info.color_type == ColorType::Indexed {
        let why = "its pixels are numbers of a palette's colours";
        return Err(Wrong::new("colour", why, "convert the slices to grey"));
    }
    Ok(Shape { size: [info.width, info.height], voxel_type })
}

pub(super) fn shape(bytes: &[u8]) -> Result<Shape, Wrong> {
    shape_of(reader(bytes)?.info())
}

pub(super) fn decoded(bytes: &[u8]) -> Result<(Shape, Vec<u8>), Wrong> {
    let mut reader = reader(bytes)?;
    let shape = shape_of(reader.info())?;
    let (color, depth) = (reader.info().color_type, reader.info().bit_depth);
    let size = reader.output_buffer_size().map(|n| n as u64);
    // Deflate shrinks at most 1032 times.
    let most = MOST.min((bytes.len() as u64).saturating_mul(1032));
    let Some(size) = size.filter(|size| *size <= most) else {
        return Err(Wrong::broken("size", format!("{} bytes hold no {:?} pixels", bytes.len(), shape.size)));
    };
    let mut data = vec![0; size as usize];
    reader.next_frame(&mut data).map_err(|e| Wrong::broken("pixels", e))?;
    let (row, width) = (reader.output_line_size(shape.size[0]).unwrap_or(0), shape.size[0] as usize);
    let bits = depth as usize;
    if bits < 8 {
        let pixels = data.chunks_exact(row.max(1)).flat_map(|row| {
            (0..width).map(move |x| row[x * bits / 8] >> (8 - bits - x * bits % 8) & ((1 << bits) - 1) as u8)
        });
        return Ok((shape, pixels.collect()));
    }
    let mut data = grey(data, color.samples(), bits / 8)?;
    if bits == 16 {
        crate::ordered::swap(&mut data, 2);
    }
    Ok((shape, data))
}

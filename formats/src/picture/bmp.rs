//! BMP: 8 bits with a palette of greys, 24 and 32 bits whose samples are equal; not compressed.

use brickcast_volume::format::VoxelType;

use crate::grey::grey;
use crate::slice::Shape;
use crate::wrong::Wrong;

const FILE_HEADER: usize = 14;

/// Two letters are a weak mark: the size of the second header counts too.
pub(super) fn recognises(start: &[u8]) -> bool {
    start.starts_with(b"BM") && number(start, 14, 4).is_some_and(|n| [12, 40, 52, 56, 108, 124].contains(&n))
}

fn number(bytes: &[u8], at: usize, length: usize) -> Option<u64> {
    let part = bytes.get(at..at.checked_add(length)?)?;
    Some(part.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b)))
}

struct Header {
    shape: Shape,
    bits: u64,
    pixels: usize,
    is_upside_down: bool,
    palette: usize,
    colours: usize,
}

fn header(bytes: &[u8]) -> Result<Header, Wrong> {
    let get = |at, length, what: &str| {
        number(bytes, at, length).ok_or_else(|| Wrong::broken(what, "the file ends before it"))
    };
    let length = get(14, 4, "header")? as usize;
    if length < 40 {
        return Err(Wrong::new("header", "of OS/2, from before 1990", "save the slices as PNG"));
    }
    let signed = |n: u64| i64::from(n as u32 as i32);
    let (width, height) = (signed(get(18, 4, "width")?), signed(get(22, 4, "height")?));
    let (bits, compression) = (get(28, 2, "bits")?, get(30, 4, "compression")?);
    let edge = |n: i64| u32::try_from(n.unsigned_abs()).ok().filter(|n| (1..=1 << 20).contains(n));
    let (Some(x), Some(y), true) = (edge(width), edge(height), width > 0) else {
        return Err(Wrong::broken("size", format!("{width} x {height} pixels")));
    };
    if compression != 0 && !(compression == 3 && bits == 32) {
        return Err(Wrong::new("compression", format!("of kind {compression}"), "save the slices as PNG"));
    }
    if ![8, 24, 32].contains(&bits) {
        return Err(Wrong::new("bits a pixel", bits.to_string(), "save the slices as grey of 8 bits"));
    }
    let colours = match get(46, 4, "colours")? as usize {
        0 => 256,
        n => n.min(256),
    };
    Ok(Header {
        shape: Shape { size: [x, y], voxel_type: VoxelType::U8 },
        bits,
        pixels: get(10, 4, "start of pixels")? as usize,
        is_upside_down: height > 0,
        palette: FILE_HEADER + length,
        colours,
    })
}

pub(super) fn shape(bytes: &[u8]) -> Result<Shape, Wrong> {
    header(bytes).map(|header| header.shape)
}

pub(super) fn decoded(bytes: &[u8]) -> Result<(Shape, Vec<u8>), Wrong> {
    let header = header(bytes)?;
    let [width, height] = header.shape.size.map(|n| n as usize);
    let used = width * header.bits as usize / 8;
    let stride = used.div_ceil(4) * 4;
    let pixels = bytes.get(header.pixels..).and_then(|p| p.get(..stride.checked_mul(height)?));
    let pixels = pixels.ok_or_else(|| Wrong::broken("pixels", "the file ends before they do"))?;
    let mut data = Vec::with_capacity(used * height);
    for y in 0..height {
        let row = if header.is_upside_down { height - 1 - y } else { y };
        data.extend_from_slice(&pixels[row * stride..][..used]);
    }
    if header.bits > 8 {
        return Ok((header.shape, grey(data, header.bits as usize / 8, 1)?));
    }
    let palette = bytes.get(header.palette..).unwrap_or_default();
    let mut values = [0; 256];
    for (i, (value, entry)) in values.iter_mut().zip(palette.chunks_exact(4)).take(header.colours).enumerate() {
        if entry[0] != entry[1] || entry[1] != entry[2] {
            let why = format!("colour {i} of its palette is no grey");
            return Err(Wrong::new("colour", why, "convert the slices to grey"));
        }
        *value = entry[0];
    }
    data.iter_mut().for_each(|v| *v = values[usize::from(*v)]);
    Ok((header.shape, data))
}

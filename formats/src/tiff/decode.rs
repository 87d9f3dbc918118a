//! Pixels out of strips and tiles. Memory grows as bytes come out, whatever a header says there are.

use std::io::{self, Read};

use brickcast_volume::format::Endian;
use weezl::{BitOrder, LzwStatus};

use super::file::TiffFile;
use super::page::{Compression, Page, Predictor};
use crate::grey::grey;
use crate::ordered::swap;
use crate::packed::Packing;
use crate::wrong::Wrong;

/// A row of tiles at most: pixels of a row of tiles are held before they are put in order.
const MOST_TILE_ROW: u64 = 256 << 20;

/// The page's voxels, little endian.
pub(super) fn plane(tiff: &mut TiffFile, page: &Page) -> Result<Vec<u8>, Wrong> {
    let offsets = tiff.numbers(page.offsets)?;
    let [width, height] = page.shape.size;
    let [across, down] = [width.div_ceil(page.tile[0]), height.div_ceil(page.tile[1])];
    let tiles = u64::from(across) * u64::from(down);
    let mut counts = page.counts.map_or(Ok(Vec::new()), |entry| tiff.numbers(entry))?;
    if page.is_plain() && offsets.len() as u64 == tiles {
        // What is not packed is as long as its pixels, whatever is said: ImageJ says less of more than 4 GiB.
        let row = u64::from(width) * page.pixel();
        counts = (0..down).map(|y| row * u64::from(page.tile[1].min(height - y * page.tile[1]))).collect();
    }
    if offsets.len() as u64 != tiles || counts.len() as u64 != tiles {
        let why = format!("{} of them and {} lengths, but {tiles} parts make the page", offsets.len(), counts.len());
        return Err(Wrong::broken("StripOffsets", why));
    }
    let tile_row = u64::from(page.tile[0]) * page.pixel() * u64::from(page.tile[1]) * u64::from(across);
    if page.is_tiled && tile_row > MOST_TILE_ROW {
        return Err(Wrong::new("TileLength", format!("a row of tiles has {tile_row} bytes"), "save it in strips"));
    }
    let mut out = Vec::new();
    let row_bytes = (u64::from(width) * page.pixel()) as usize;
    for y in 0..down {
        let rows = page.tile[1].min(height - y * page.tile[1]) as usize;
        let parts = (y * across) as usize..((y + 1) * across) as usize;
        let mut decoded = Vec::with_capacity(across as usize);
        for part in parts {
            let bytes = tiff.bytes(offsets[part], counts[part], "strip")?;
            let rows = if page.is_tiled { page.tile[1] } else { rows as u32 };
            decoded
                .push(segment(page, bytes, rows, tiff.endian).map_err(|e| Wrong::broken(format!("strip {part}"), e))?);
        }
        if let [strip] = &mut decoded[..]
            && !page.is_tiled
        {
            strip.truncate(rows * row_bytes);
            out.try_reserve(strip.len()).map_err(|e| Wrong::broken("ImageLength", e))?;
            out.append(strip);
            continue;
        }
        let tile_bytes = (u64::from(page.tile[0]) * page.pixel()) as usize;
        for row in 0..rows {
            let end = out.len() + row_bytes;
            for tile in &decoded {
                let take = tile_bytes.min(end - out.len());
                out.extend_from_slice(&tile[row * tile_bytes..][..take]);
            }
        }
    }
    grey(out, page.samples as usize, page.shape.voxel_type.bytes())
}

/// The pixels of one strip or tile of so many rows, little endian.
fn segment(page: &Page, bytes: Vec<u8>, rows: u32, endian: Endian) -> io::Result<Vec<u8>> {
    let want = u64::from(page.tile[0]) * page.pixel() * u64::from(rows);
    let mut data = match page.compression {
        Compression::Packed(Packing::None) => bytes,
        Compression::Packed(packing) => {
            let mut data = Vec::new();
            packing.unpacked(io::Cursor::new(bytes))?.take(want).read_to_end(&mut data)?;
            data
        }
        Compression::Lzw => lzw(&bytes, want)?,
        Compression::PackBits => pack_bits(&bytes, want),
    };
    if (data.len() as u64) < want {
        return Err(io::Error::other(format!("{} bytes came out of it, {want} are its pixels", data.len())));
    }
    data.truncate(want as usize);
    let (samples, voxel) = (page.samples as usize, page.shape.voxel_type.bytes());
    let row = page.tile[0] as usize * samples * voxel;
    if page.predictor == Predictor::Float {
        data.chunks_exact_mut(row).for_each(|row| undo_float(row, samples, voxel));
        return Ok(data);
    }
    if endian == Endian::Big {
        swap(&mut data, voxel);
    }
    if page.predictor == Predictor::Horizontal {
        data.chunks_exact_mut(row).for_each(|row| undo_horizontal(row, samples, voxel));
    }
    Ok(data)
}

fn lzw(bytes: &[u8], want: u64) -> io::Result<Vec<u8>> {
    let mut decoder = weezl::decode::Decoder::with_tiff_size_switch(BitOrder::Msb, 8);
    let (mut data, mut buffer, mut rest) = (Vec::new(), vec![0; 1 << 16], bytes);
    while (data.len() as u64) < want {
        let done = decoder.decode_bytes(rest, &mut buffer);
        data.extend_from_slice(&buffer[..done.consumed_out]);
        rest = &rest[done.consumed_in..];
        match done.status.map_err(io::Error::other)? {
            LzwStatus::Ok if done.consumed_in > 0 || done.consumed_out > 0 => {}
            _ => break,
        }
    }
    Ok(data)
}

fn pack_bits(bytes: &[u8], want: u64) -> Vec<u8> {
    let (mut data, mut rest) = (Vec::new(), bytes);
    while let [head, tail @ ..] = rest
        && (data.len() as u64) < want
    {
        match (head.cast_signed(), tail) {
            (-128, _) => rest = tail,
            (n @ 0.., _) => {
                let (run, left) = tail.split_at(tail.len().min(n as usize + 1));
                data.extend_from_slice(run);
                rest = left;
            }
            (n, [value, left @ ..]) => {
                data.extend(std::iter::repeat_n(*value, usize::from(n.unsigned_abs()) + 1));
                rest = left;
            }
            (_, []) => break,
        }
    }
    data
}

/// Each sample is the difference to the one before.
fn undo_horizontal(row: &mut [u8], samples: usize, voxel: usize) {
    macro_rules! sums {
        ($number:ty) => {{
            let all = row.as_chunks_mut::<{ size_of::<$number>() }>().0;
            for i in samples..all.len() {
                let before = <$number>::from_le_bytes(all[i - samples]);
                all[i] = <$number>::from_le_bytes(all[i]).wrapping_add(before).to_le_bytes();
            }
        }};
    }
    match voxel {
        1 => sums!(u8),
        2 => sums!(u16),
        4 => sums!(u32),
        _ => sums!(u64),
    }
}

/// Bytes of floats, the most significant of all first, each the difference to the one before.
fn undo_float(row: &mut [u8], samples: usize, voxel: usize) {
    for i in samples..row.len() {
        row[i] = row[i].wrapping_add(row[i - samples]);
    }
    let (count, planes) = (row.len() / voxel, row.to_vec());
    for (i, value) in row.chunks_exact_mut(voxel).enumerate() {
        for (byte, to) in value.iter_mut().rev().enumerate() {
            *to = planes[byte * count + i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::pack_bits;

    #[test]
    fn runs_of_packed_bits() {
        let packed = [0xfe, 0xaa, 0x02, 0x80, 0x00, 0x2a, 0xfd, 0xaa, 0x80, 0x03, 1, 2, 3, 4, 0x81, 7];
        let mut want = vec![0xaa, 0xaa, 0xaa, 0x80, 0x00, 0x2a, 0xaa, 0xaa, 0xaa, 0xaa, 1, 2, 3, 4];
        assert_eq!(pack_bits(&packed, 14), want);
        want.extend([7; 128]);
        assert_eq!(pack_bits(&packed, 1000), want);
        assert_eq!(pack_bits(&[5, 1], 6), [1]);
        assert!(pack_bits(&[0x90], 6).is_empty());
    }
}

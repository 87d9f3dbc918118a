//! One frame's pixels: read from the file, decoded, and made numbers of whole bytes.

use std::ops::Range;
use std::path::Path;

use super::bits::{Bits, keep_bits, single_bits};
use super::bytes::Bytes;
use super::decode;
use super::header::Header;
use super::syntax::{Codec, REWRITE};
use super::tags;
use crate::ordered::swap;
use crate::slice::Shape;
use crate::wrong::{EXPORT_AGAIN, Wrong};

/// More no frame has: 32,768 x 32,768 pixels of 16 bits that did not shrink.
const LONGEST_CODED: u64 = 1 << 31;

#[derive(Debug)]
pub(super) struct Frames {
    codec: Codec,
    place: Place,
    is_big: bool,
    /// Bytes of a pair are swapped as if they were a number of 16 bits.
    is_swapped: bool,
    is_single_bits: bool,
}

#[derive(Debug)]
enum Place {
    /// One behind the other in the file, from this byte on.
    Plain(u64),
    /// The same in what is deflated from the first of these bytes on.
    Deflated(u64, u64),
    /// First bytes and lengths, and the first fragment of each frame and of what would follow.
    Fragments(Vec<(u64, u32)>, Vec<u32>),
}

impl Frames {
    pub(super) fn new(header: &Header, shape: Shape, bits: Bits, count: u32) -> Result<Self, Wrong> {
        let Some(pixels) = &header.pixels else { return Err(Wrong::broken("PixelData", "there is none")) };
        let Some(codec) = header.syntax.codec else {
            let why = format!("{} is not decoded here", header.syntax.name);
            return Err(Wrong::new("TransferSyntaxUID", why, REWRITE));
        };
        let place = match pixels.length {
            None => {
                let starts = frame_starts(&pixels.fragments, &pixels.frame_starts, count)?;
                Place::Fragments(pixels.fragments.clone(), starts)
            }
            Some(_) if codec != Codec::Raw => {
                let why = format!("{}, but its pixels are in one piece", header.syntax.name);
                return Err(Wrong::broken("PixelData", why));
            }
            Some(length) => {
                let frame = frame_bytes(shape);
                let want = match bits.allocated {
                    1 => (frame * u64::from(count)).div_ceil(8),
                    _ => frame * u64::from(count),
                };
                if length < want {
                    let words = format!("{length} bytes for {count} frames of {frame}");
                    return Err(Wrong::broken("PixelData", words));
                }
                if !header.syntax.is_deflated && header.end.saturating_sub(pixels.start) < want {
                    let present = header.end.saturating_sub(pixels.start);
                    let words = format!("the file ends after {present} of its {want} bytes");
                    return Err(Wrong::broken("PixelData", words));
                }
                match header.syntax.is_deflated {
                    true => Place::Deflated(header.start, pixels.start),
                    false => Place::Plain(pixels.start),
                }
            }
        };
        let is_big = header.syntax.is_big;
        let is_swapped = is_big && pixels.is_words && pixels.tag == tags::PIXELS && bits.allocated <= 8;
        let is_single_bits = bits.allocated == 1;
        if is_single_bits && (codec != Codec::Raw || matches!(place, Place::Fragments(..))) {
            let why = format!("single bits as {}", header.syntax.name);
            return Err(Wrong::new("PixelData", why, REWRITE));
        }
        Ok(Self { codec, place, is_big, is_swapped, is_single_bits })
    }

    /// Numbers little endian, of the bits that count.
    pub(super) fn plane(&self, path: &Path, frame: u32, shape: Shape, bits: Bits) -> Result<Vec<u8>, Wrong> {
        let failed = |reason| Wrong::new("PixelData", format!("{reason}"), EXPORT_AGAIN);
        let bytes = frame_bytes(shape);
        let mut data = match &self.place {
            Place::Plain(start) => {
                let mut from = Bytes::plain(path, 0, self.is_big).map_err(failed)?;
                self.raw(&mut from, *start, frame, bytes).map_err(failed)?
            }
            Place::Deflated(data_set, start) => {
                let mut from = Bytes::deflated(path, *data_set).map_err(failed)?;
                self.raw(&mut from, *start, frame, bytes).map_err(failed)?
            }
            Place::Fragments(fragments, starts) => {
                let which = starts[frame as usize] as usize..starts[frame as usize + 1] as usize;
                let coded = coded(path, &fragments[which]).map_err(failed)?;
                decode::decoded(self.codec, coded, shape, bits)?
            }
        };
        if self.is_big && !self.is_swapped {
            swap(&mut data, shape.voxel_type.bytes());
        }
        if data.len() as u64 != bytes {
            return Err(Wrong::broken("PixelData", format!("{} bytes in a frame of {bytes}", data.len())));
        }
        keep_bits(&mut data, bits);
        Ok(data)
    }

    fn raw(&self, from: &mut Bytes, start: u64, frame: u32, bytes: u64) -> std::io::Result<Vec<u8>> {
        let offset = bytes * u64::from(frame);
        match self.is_single_bits {
            // Frames follow each other without a gap.
            true => {
                let packed = self.bytes(from, start, offset / 8..(offset + bytes).div_ceil(8))?;
                Ok(single_bits(&packed, (offset % 8) as usize, bytes as usize))
            }
            false => self.bytes(from, start, offset..offset + bytes),
        }
    }

    fn bytes(&self, from: &mut Bytes, start: u64, range: Range<u64>) -> std::io::Result<Vec<u8>> {
        if !self.is_swapped {
            from.skip(start + range.start)?;
            return from.take(range.end - range.start);
        }
        // Pairs do not care where frames begin; some writers leave out the byte that would make the last one whole.
        let first = range.start & !1;
        let end = range.end.next_multiple_of(2).min(from.end().saturating_sub(start).max(range.end));
        from.skip(start + first)?;
        let mut data = from.take(end - first)?;
        swap(&mut data, 2);
        data.drain(..(range.start - first) as usize);
        data.truncate((range.end - range.start) as usize);
        Ok(data)
    }
}

fn frame_bytes(shape: Shape) -> u64 {
    u64::from(shape.size[0]) * u64::from(shape.size[1]) * shape.voxel_type.bytes() as u64
}

fn coded(path: &Path, fragments: &[(u64, u32)]) -> std::io::Result<Vec<u8>> {
    let all: u64 = fragments.iter().map(|(_, length)| u64::from(*length)).sum();
    if all > LONGEST_CODED {
        return Err(std::io::Error::other(format!("a frame of {all} bytes")));
    }
    let mut out = Vec::new();
    for (start, length) in fragments {
        let mut from = Bytes::plain(path, *start, false)?;
        match out.is_empty() {
            true => out = from.take((*length).into())?,
            false => out.extend(from.take((*length).into())?),
        }
    }
    Ok(out)
}

/// The first fragment of each frame, and of what would follow the last.
fn frame_starts(fragments: &[(u64, u32)], table: &[u64], count: u32) -> Result<Vec<u32>, Wrong> {
    let all = fragments.len() as u32;
    if count == 1 {
        return Ok(vec![0, all]);
    }
    if all == count {
        return Ok((0..=all).collect());
    }
    if table.len() != count as usize || all < count {
        let why = format!("{all} fragments for {count} frames, and no table that says which is whose");
        return Err(Wrong::new("PixelData", why, REWRITE));
    }
    // Offsets count from the first fragment's item, whose head has 8 bytes.
    let first = fragments[0].0;
    let starts: Option<Vec<u32>> = table
        .iter()
        .map(|offset| {
            let at = first.checked_add(*offset)?;
            fragments.binary_search_by_key(&at, |(start, _)| *start).ok().map(|i| i as u32)
        })
        .chain([Some(all)])
        .collect();
    starts
        .filter(|starts| starts[0] == 0 && starts.is_sorted_by(|a, b| a < b))
        .ok_or_else(|| Wrong::broken("PixelData", "its table of frames does not fit the fragments"))
}

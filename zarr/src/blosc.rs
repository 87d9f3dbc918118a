//! Blosc's format of compressed chunks, version 2 (that of c-blosc 1.x): blocks, which are split into a stream for each
//! byte of an element, shuffled, and compressed by one of several compressors.
//!
//! No memory is taken for what a header promises before bytes for it have come.

use std::io::Read as _;

use flate2::read::ZlibDecoder;

use crate::blosclz;

const HEADER: usize = 16;
/// Blocks of elements that are larger, or of fewer elements, are one stream.
const MOST_STREAMS: usize = 16;
const LEAST_ELEMENTS: usize = 128;
/// One block that is longer is decompressed as its bytes come, and not at once.
const AT_ONCE: usize = 16 << 20;
/// LZ4 and BloscLZ make no more bytes of one.
const MOST_OF_ONE: usize = 255;

const SHUFFLED: u8 = 0x1;
const COPIED: u8 = 0x2;
const BITS_SHUFFLED: u8 = 0x4;
const NOT_SPLIT: u8 = 0x10;

struct Chunk<'a> {
    data: &'a [u8],
    flags: u8,
    element: usize,
    bytes: usize,
    block: usize,
}

/// All of a chunk of at most `most` bytes.
pub(crate) fn decompressed(data: &[u8], most: usize) -> Result<Vec<u8>, String> {
    let chunk = Chunk::new(data, most)?;
    if chunk.flags & COPIED != 0 {
        let end = HEADER + chunk.bytes;
        let copied = data.get(HEADER..end).ok_or_else(|| format!("it ends before its {end} bytes"))?;
        return Ok(copied.to_vec());
    }
    let (mut out, mut block) = (Vec::new(), Vec::new());
    for index in 0..chunk.bytes.div_ceil(chunk.block.max(1)) {
        chunk.block(index, &mut block).ok_or_else(|| format!("block {index} is broken, {}", chunk.words()))?;
        chunk.unshuffle(&block, &mut out);
    }
    Ok(out)
}

impl<'a> Chunk<'a> {
    fn new(data: &'a [u8], most: usize) -> Result<Self, String> {
        let Some(&[version, _, flags, element, ..]) = data.get(..HEADER) else {
            return Err(format!("{} bytes are less than its header", data.len()));
        };
        if version != 2 {
            return Err(format!("it is of version {version} of the format; 2 is read"));
        }
        let number = |at: usize| int(data, at).unwrap_or_default();
        let (bytes, block, length) = (number(4), number(8), number(12));
        if bytes > most {
            return Err(format!("its header promises {bytes} bytes, {most} are due"));
        }
        if length != data.len() {
            return Err(format!("its header says {length} bytes, it has {}", data.len()));
        }
        let blocks = if block == 0 { 0 } else { bytes.div_ceil(block) };
        if (block == 0 && bytes > 0) || element == 0 || (flags & COPIED == 0 && HEADER + blocks * 4 > length) {
            return Err(format!("{bytes} bytes in blocks of {block}, elements of {element}, cannot be in {length}"));
        }
        let chunk = Self { data, flags, element: usize::from(element), bytes, block };
        match chunk.flags >> 5 {
            0 | 1 | 3 | 4 => Ok(chunk),
            _ => Err(format!("its compressor, {}, is not read; write it with lz4 or zstd", chunk.words())),
        }
    }

    /// Its compressor.
    fn words(&self) -> String {
        match self.flags >> 5 {
            0 => "blosclz".to_owned(),
            1 => "lz4".to_owned(),
            2 => "snappy".to_owned(),
            3 => "zlib".to_owned(),
            4 => "zstd".to_owned(),
            other => format!("number {other}"),
        }
    }

    /// Replaces `out` by a block, as it was compressed.
    fn block(&self, index: usize, out: &mut Vec<u8>) -> Option<()> {
        out.clear();
        let size = self.block.min(self.bytes - index * self.block);
        let is_split = self.flags & NOT_SPLIT == 0
            && self.element <= MOST_STREAMS
            && size / self.element >= LEAST_ELEMENTS
            && size == self.block;
        let streams = if is_split { self.element } else { 1 };
        let part = size / streams;
        let mut at = int(self.data, HEADER + index * 4)?;
        for _ in 0..streams {
            let length = int(self.data, at)?;
            let stream = self.data.get(at + 4..)?.get(..length)?;
            at += 4 + length;
            match length == part {
                true => out.extend_from_slice(stream),
                false => self.decompress(stream, part, out)?,
            }
        }
        (out.len() == size).then_some(())
    }

    /// Appends exactly `want` bytes.
    fn decompress(&self, stream: &[u8], want: usize, out: &mut Vec<u8>) -> Option<()> {
        let begin = out.len();
        match self.flags >> 5 {
            0 | 1 if want > stream.len().saturating_mul(MOST_OF_ONE) + 64 => return None,
            0 => blosclz::decompress(stream, want, out)?,
            1 => {
                out.resize(begin + want, 0);
                let got = lz4_flex::block::decompress_into(stream, &mut out[begin..]).ok()?;
                out.truncate(begin + got);
            }
            3 => drop(ZlibDecoder::new(stream).take(want as u64 + 1).read_to_end(out).ok()?),
            _ if want <= AT_ONCE => {
                out.resize(begin + want, 0);
                let got = zstd::bulk::decompress_to_buffer(stream, &mut out[begin..]).ok()?;
                out.truncate(begin + got);
            }
            _ => {
                let decoder = zstd::stream::read::Decoder::with_buffer(stream).ok()?;
                decoder.take(want as u64 + 1).read_to_end(out).ok()?;
            }
        }
        (out.len() - begin == want).then_some(())
    }

    /// Appends a block in the order that it had before it was shuffled.
    fn unshuffle(&self, block: &[u8], out: &mut Vec<u8>) {
        let (element, begin) = (self.element, out.len());
        let elements = block.len() / element;
        let whole = elements * element;
        out.extend_from_slice(block);
        let out = &mut out[begin..][..whole];
        if self.flags & SHUFFLED != 0 && element > 1 {
            for (byte, plane) in block[..whole].chunks_exact(elements.max(1)).enumerate() {
                out.iter_mut().skip(byte).step_by(element).zip(plane).for_each(|(out, b)| *out = *b);
            }
        } else if self.flags & BITS_SHUFFLED != 0 && self.flags & SHUFFLED == 0 && elements.is_multiple_of(8) {
            out.fill(0);
            // A row holds one bit of all elements, eight to a byte, the first lowest.
            for (bit, row) in block[..whole].chunks_exact((elements / 8).max(1)).enumerate() {
                let (byte, shift) = (bit / 8, bit % 8);
                for (eight, bits) in out.chunks_exact_mut(8 * element).zip(row) {
                    for i in 0..8 {
                        eight[i * element + byte] |= (bits >> i & 1) << shift;
                    }
                }
            }
        }
    }
}

/// A number that is not negative.
fn int(data: &[u8], at: usize) -> Option<usize> {
    let bytes = data.get(at..)?.first_chunk::<4>()?;
    usize::try_from(i32::from_le_bytes(*bytes)).ok()
}

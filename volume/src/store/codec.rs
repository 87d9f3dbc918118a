//! An inner chunk's bytes: a zstd frame and its crc32c. Records of halos: such a frame alone, its crc32c in their
//! index.

use std::cell::RefCell;
use std::io;

use zstd::bulk::{Compressor, Decompressor};
use zstd::zstd_safe::{compress_bound, get_frame_content_size};

use super::error::{ChunkFault, StoreError};
use super::profile::ZSTD_LEVEL;

thread_local! {
    // A context costs some hundred KiB and is made once a thread.
    static COMPRESSOR: RefCell<Option<Compressor<'static>>> = const { RefCell::new(None) };
    static DECOMPRESSOR: RefCell<Option<Decompressor<'static>>> = const { RefCell::new(None) };
}

/// The longest that [`encode`] makes of `raw` bytes.
pub(super) fn encoded_bound(raw: usize) -> usize {
    compressed_bound(raw) + 4
}

/// The longest that [`compress`] makes of `raw` bytes.
pub(super) fn compressed_bound(raw: usize) -> usize {
    compress_bound(raw)
}

/// A zstd frame that says how long its content is; no checksum.
pub(super) fn compress(raw: &[u8]) -> Result<Vec<u8>, StoreError> {
    let compressed: io::Result<Vec<u8>> = COMPRESSOR.with_borrow_mut(|slot| {
        let compressor = match slot {
            Some(compressor) => compressor,
            None => slot.insert(Compressor::new(ZSTD_LEVEL)?),
        };
        compressor.compress(raw)
    });
    compressed.map_err(StoreError::Compress)
}

pub(super) fn encode(raw: &[u8]) -> Result<Vec<u8>, StoreError> {
    let mut bytes = compress(raw)?;
    bytes.extend(crc32c::crc32c(&bytes).to_le_bytes());
    Ok(bytes)
}

/// Splits off and checks a crc32c at the end; `Err((got, want))` where it differs.
pub(super) fn checked(bytes: &[u8]) -> Result<Option<&[u8]>, (u32, u32)> {
    let Some((data, crc)) = bytes.split_last_chunk::<4>() else { return Ok(None) };
    match (crc32c::crc32c(data), u32::from_le_bytes(*crc)) {
        (got, want) if got == want => Ok(Some(data)),
        differing => Err(differing),
    }
}

/// The checksum at the end of what [`encode`] made.
pub(super) fn stated_sum(encoded: &[u8]) -> Option<u32> {
    encoded.last_chunk::<4>().map(|sum| u32::from_le_bytes(*sum))
}

/// The inverse of [`encode`]; `raw` is how many bytes must come out, and all that is ever allocated.
pub(super) fn decode(encoded: &[u8], raw: usize) -> Result<Vec<u8>, ChunkFault> {
    let data = checked(encoded)
        .map_err(|(got, want)| ChunkFault::Crc { got, want })?
        .ok_or(ChunkFault::Short(encoded.len()))?;
    decompress(data, raw)
}

/// How many bytes a zstd frame says that it decodes to.
pub(super) fn decompressed_length(data: &[u8]) -> Result<u64, ChunkFault> {
    let length = get_frame_content_size(data).map_err(|e| ChunkFault::Zstd(e.to_string()))?;
    length.ok_or_else(|| ChunkFault::Zstd("the frame does not say how long its content is".to_owned()))
}

/// The inverse of [`compress`]; `raw` as in [`decode`].
pub(super) fn decompress(data: &[u8], raw: usize) -> Result<Vec<u8>, ChunkFault> {
    let mut out = vec![0; raw];
    let decoded: io::Result<usize> = DECOMPRESSOR.with_borrow_mut(|slot| {
        let decompressor = match slot {
            Some(decompressor) => decompressor,
            None => slot.insert(Decompressor::new()?),
        };
        decompressor.decompress_to_buffer(data, out.as_mut_slice())
    });
    match decoded.map_err(|e| ChunkFault::Zstd(e.to_string()))? {
        got if got == raw => Ok(out),
        got => Err(ChunkFault::Length { got, want: raw }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flipped_bit_of_a_chunk_is_found() {
        let raw: Vec<u8> = (0..4096u32).flat_map(|i| ((i * i) as u16).to_le_bytes()).collect();
        let encoded = encode(&raw).unwrap();
        assert!(encoded.len() <= encoded_bound(raw.len()));
        assert_eq!(decode(&encoded, raw.len()).unwrap(), raw);
        for bit in 0..encoded.len() * 8 {
            let mut broken = encoded.clone();
            broken[bit / 8] ^= 1 << (bit % 8);
            assert!(matches!(decode(&broken, raw.len()), Err(ChunkFault::Crc { .. })), "bit {bit}");
        }
    }

    #[test]
    fn a_frame_that_decodes_to_more_or_less_is_refused() {
        let encoded = encode(&[7; 1000]).unwrap();
        assert!(matches!(decode(&encoded, 999), Err(ChunkFault::Zstd(_))));
        assert_eq!(decode(&encoded, 1001), Err(ChunkFault::Length { got: 1000, want: 1001 }));
        assert_eq!(decode(&[1, 2, 3], 10), Err(ChunkFault::Short(3)));
    }
}

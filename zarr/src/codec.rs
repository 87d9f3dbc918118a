//! Codecs that take bytes to bytes, undone within bounds: no more comes of a chunk than can be in it, and memory grows
//! only as bytes come.

use std::io::Read;

use bytes::Bytes;

use crate::blosc;
use crate::error::ChunkFault;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Codec {
    Blosc,
    Bzip2,
    Crc32c,
    Gzip,
    Lz4,
    Zlib,
    Zstd,
}

/// For people.
pub(crate) const READ: &str = "blosc, bz2, crc32c, gzip, lz4, zlib, zstd, and no compression";

/// LZ4 makes no more bytes of one.
const MOST_OF_ONE: usize = 255;

/// No chunk that is `decoded` bytes long is encoded in more.
pub(crate) fn most_encoded(decoded: usize) -> usize {
    decoded + decoded / 2 + (64 << 10)
}

/// Undoes all of `codecs`, the last one first: `want` bytes.
pub(crate) fn undone(codecs: &[Codec], encoded: Bytes, want: usize) -> Result<Bytes, ChunkFault> {
    let mut bytes = encoded;
    for (place, codec) in codecs.iter().enumerate().rev() {
        bytes = codec.undo(bytes, if place == 0 { want } else { most_encoded(want) })?;
    }
    match bytes.len() {
        got if got == want => Ok(bytes),
        got => Err(ChunkFault::Length { got, want }),
    }
}

impl Codec {
    /// By the names of Zarr v3, of v2, and of what Python writes of v2's into v3.
    pub(crate) fn of(name: &str) -> Option<Self> {
        Some(match name.strip_prefix("numcodecs.").unwrap_or(name) {
            "blosc" => Self::Blosc,
            "bz2" => Self::Bzip2,
            "crc32c" => Self::Crc32c,
            "gzip" => Self::Gzip,
            "lz4" => Self::Lz4,
            "zlib" => Self::Zlib,
            "zstd" => Self::Zstd,
            _ => return None,
        })
    }

    fn name(self) -> &'static str {
        match self {
            Self::Blosc => "blosc",
            Self::Bzip2 => "bz2",
            Self::Crc32c => "crc32c",
            Self::Gzip => "gzip",
            Self::Lz4 => "lz4",
            Self::Zlib => "zlib",
            Self::Zstd => "zstd",
        }
    }

    fn undo(self, encoded: Bytes, most: usize) -> Result<Bytes, ChunkFault> {
        let data = &encoded[..];
        match self {
            Self::Blosc => blosc::decompressed(data, most).map(Bytes::from).map_err(|reason| self.broken(reason)),
            Self::Bzip2 => self.all(bzip2::read::MultiBzDecoder::new(data), most),
            Self::Gzip => self.all(flate2::read::MultiGzDecoder::new(data), most),
            Self::Zlib => self.all(flate2::read::ZlibDecoder::new(data), most),
            Self::Zstd => match zstd::stream::read::Decoder::with_buffer(data) {
                Ok(decoder) => self.all(decoder, most),
                Err(reason) => Err(self.broken(reason.to_string())),
            },
            Self::Lz4 => self.lz4(data, most),
            Self::Crc32c => {
                let Some((body, written)) = data.split_last_chunk::<4>() else {
                    return Err(ChunkFault::Length { got: data.len(), want: 4 });
                };
                match (crc32c::crc32c(body), u32::from_le_bytes(*written)) {
                    (got, want) if got == want => Ok(encoded.slice(..body.len())),
                    (got, want) => Err(ChunkFault::Checksum { got, want }),
                }
            }
        }
    }

    fn all(self, decoder: impl Read, most: usize) -> Result<Bytes, ChunkFault> {
        let mut out = Vec::new();
        let read = decoder.take(most as u64 + 1).read_to_end(&mut out);
        read.map_err(|reason| self.broken(reason.to_string()))?;
        match out.len() > most {
            true => Err(ChunkFault::TooLong { codec: self.name(), most }),
            false => Ok(out.into()),
        }
    }

    /// A length of four bytes, then one block.
    fn lz4(self, data: &[u8], most: usize) -> Result<Bytes, ChunkFault> {
        let Some((length, block)) = data.split_first_chunk::<4>() else {
            return Err(ChunkFault::Length { got: data.len(), want: 4 });
        };
        let want = u32::from_le_bytes(*length) as usize;
        if want > most {
            return Err(ChunkFault::TooLong { codec: self.name(), most });
        }
        if want > block.len().saturating_mul(MOST_OF_ONE) + 64 {
            return Err(self.broken(format!("{want} bytes cannot be in {}", block.len())));
        }
        let mut out = vec![0; want];
        match lz4_flex::block::decompress_into(block, &mut out) {
            Ok(got) if got == want => Ok(out.into()),
            Ok(got) => Err(self.broken(format!("{got} bytes came, it promises {want}"))),
            Err(reason) => Err(self.broken(reason.to_string())),
        }
    }

    fn broken(self, reason: String) -> ChunkFault {
        ChunkFault::Broken { codec: self.name(), reason }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn gzip(data: &[u8]) -> Bytes {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(data).unwrap();
        encoder.finish().unwrap().into()
    }

    #[test]
    fn codecs_are_undone_in_order_and_to_the_byte() {
        let zipped = gzip(b"0123456789");
        let checked: Bytes = [&zipped[..], &crc32c::crc32c(&zipped).to_le_bytes()].concat().into();
        let chain = [Codec::Gzip, Codec::Crc32c];
        assert_eq!(undone(&chain, checked.clone(), 10).unwrap(), &b"0123456789"[..]);
        assert_eq!(undone(&chain, checked.clone(), 9).unwrap_err(), ChunkFault::TooLong { codec: "gzip", most: 9 });
        assert_eq!(undone(&chain, checked.clone(), 11).unwrap_err(), ChunkFault::Length { got: 10, want: 11 });
        let mut flipped = checked.to_vec();
        flipped[3] ^= 1;
        assert!(matches!(undone(&chain, flipped.into(), 10), Err(ChunkFault::Checksum { .. })));
        assert!(matches!(undone(&[Codec::Gzip], zipped.slice(..12), 10), Err(ChunkFault::Broken { .. })));
    }

    /// A few bytes that say they are many gigabytes, and some that are.
    #[test]
    fn no_more_memory_is_taken_than_can_be_due() {
        let bomb = gzip(&vec![0; 64 << 20]);
        assert!(matches!(undone(&[Codec::Gzip], bomb, 1000), Err(ChunkFault::TooLong { most: 1000, .. })));
        let lz4 = Bytes::from_static(&[0xff, 0xff, 0xff, 0x3f, 0]);
        assert!(matches!(undone(&[Codec::Lz4], lz4, 1 << 30), Err(ChunkFault::Broken { .. })));
        let blosc = [&[2u8, 1, 0x21, 2][..], &(1u32 << 29).to_le_bytes(), &(1u32 << 29).to_le_bytes()].concat();
        let length = (blosc.len() + 12) as u32;
        let blosc = [&blosc[..], &length.to_le_bytes(), &20u32.to_le_bytes(), &0u32.to_le_bytes()].concat();
        assert!(matches!(undone(&[Codec::Blosc], blosc.into(), 1 << 29), Err(ChunkFault::Broken { .. })));
    }
}

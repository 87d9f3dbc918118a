//! The bytes of an array of VTK's XML: a count before them, or blocks that are compressed each by itself.

use std::io::{self, BufRead, BufReader, Read};

use brickcast_volume::format::Endian;
use flate2::bufread::ZlibDecoder;

use super::base64::Base64;

/// The most bytes of a block; VTK's are of 32 KiB.
const LONGEST_BLOCK: u64 = 128 << 20;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compressor {
    Zlib,
    Lz4,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Blocks {
    pub(crate) is_base64: bool,
    pub(crate) compressor: Option<Compressor>,
    /// Bytes of a count.
    pub(crate) count_bytes: usize,
    pub(crate) endian: Endian,
    /// Of the voxels.
    pub(crate) expected: u64,
}

impl Blocks {
    /// The voxels out of the bytes behind where `file` stands.
    pub(crate) fn reader<R: BufRead + Send + 'static>(self, file: R) -> io::Result<Box<dyn Read + Send>> {
        let bytes: Box<dyn Read + Send> = match self.is_base64 {
            true => Box::new(Base64::new(file)),
            false => Box::new(file),
        };
        let mut reader = BlockReader {
            layout: self,
            bytes,
            sizes: Vec::new().into_iter(),
            block: io::Cursor::default(),
            last: 0,
            whole: 0,
        };
        let first = reader.count()?;
        if self.compressor.is_none() {
            if first != self.expected {
                return Err(io::Error::other(format!(
                    "{first} bytes are said to be there, {} are its voxels",
                    self.expected
                )));
            }
            return Ok(Box::new(reader.bytes.take(first)));
        }
        let (whole, last) = (reader.count()?, reader.count()?);
        let bytes = match (first, last) {
            (0, _) => Some(0),
            (n, 0) => n.checked_mul(whole),
            (n, last) => (n - 1).checked_mul(whole).and_then(|b| b.checked_add(last)),
        };
        if bytes != Some(self.expected) || whole > LONGEST_BLOCK || last > whole {
            let why = format!("{first} blocks of {whole} bytes, the last of {last}; {} are its voxels", self.expected);
            return Err(io::Error::other(why));
        }
        // As they come: the voxels bound how many there are, the file how many arrive.
        let mut sizes = Vec::new();
        for _ in 0..first {
            sizes.push(reader.count()?);
        }
        (reader.sizes, reader.whole, reader.last) = (sizes.into_iter(), whole, if last == 0 { whole } else { last });
        Ok(Box::new(reader))
    }
}

struct BlockReader {
    layout: Blocks,
    bytes: Box<dyn Read + Send>,
    /// Compressed, of the blocks to come.
    sizes: std::vec::IntoIter<u64>,
    block: io::Cursor<Vec<u8>>,
    whole: u64,
    last: u64,
}

impl BlockReader {
    fn count(&mut self) -> io::Result<u64> {
        let mut bytes = [0; 8];
        let part = &mut bytes[..self.layout.count_bytes];
        self.bytes.read_exact(part)?;
        if self.layout.endian == Endian::Big {
            part.reverse();
        }
        Ok(u64::from_le_bytes(bytes))
    }

    /// False where there is none.
    fn next(&mut self) -> io::Result<bool> {
        let Some(size) = self.sizes.next() else { return Ok(false) };
        let want = if self.sizes.len() == 0 { self.last } else { self.whole };
        if size > LONGEST_BLOCK {
            return Err(io::Error::other(format!("a block of {size} bytes")));
        }
        let mut packed = Vec::new();
        if self.bytes.by_ref().take(size).read_to_end(&mut packed)? as u64 != size {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut block = Vec::new();
        match self.layout.compressor {
            // Deflate shrinks at most 1032 times, LZ4 255 times.
            Some(Compressor::Lz4) if want <= size.saturating_mul(256) => {
                block = lz4_flex::block::decompress(&packed, want as usize).map_err(io::Error::other)?;
            }
            Some(Compressor::Lz4) => {}
            _ => {
                ZlibDecoder::new(BufReader::new(&packed[..])).take(want).read_to_end(&mut block)?;
            }
        }
        if block.len() as u64 != want {
            return Err(io::Error::other(format!("{} bytes came out of a block of {want}", block.len())));
        }
        self.block = io::Cursor::new(block);
        Ok(true)
    }
}

impl Read for BlockReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let got = self.block.read(buffer)?;
            if got > 0 || buffer.is_empty() || !self.next()? {
                return Ok(got);
            }
        }
    }
}

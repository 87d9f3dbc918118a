//! Streams that must be decoded: gzip and bzip2 in members, and numbers written as text.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read};

use bzip2::bufread::BzDecoder;
use flate2::bufread::GzDecoder;

use super::text_voxels::{AsciiVoxels, HexVoxels};
use super::voxel_type::VoxelType;

/// How a file keeps its voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    Raw,
    /// `skip` bytes of the decompressed stream come before the voxels.
    Gzip {
        skip: u64,
    },
    /// As gzip.
    Bzip2 {
        skip: u64,
    },
    /// Numbers between white space or commas; `skip` bytes of the file come before them.
    Ascii {
        skip: u64,
    },
    /// Two digits a byte.
    Hex {
        skip: u64,
    },
}

/// The largest expansion of deflate (RFC 1951: 258 bytes from two bits).
const DEFLATE_RATIO: u64 = 1032;

impl Coding {
    /// For people.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Gzip { .. } => "gzip",
            Self::Bzip2 { .. } => "bzip2",
            Self::Ascii { .. } => "ascii",
            Self::Hex { .. } => "hex",
        }
    }

    /// Why a file of `present` bytes cannot hold `expected` bytes of voxels, where that is plain before it is read.
    pub(super) fn impossible(self, present: u64, expected: u64, voxel_bytes: u64) -> Option<&'static str> {
        let (short, why) = match self {
            Self::Raw | Self::Bzip2 { .. } => return None,
            Self::Gzip { skip } => {
                (expected.saturating_add(skip) / DEFLATE_RATIO > present, "gzip shrinks at most 1032 times")
            }
            Self::Ascii { skip } => {
                let least = (expected / voxel_bytes).saturating_mul(2).saturating_sub(1);
                (least.saturating_add(skip) > present, "a number takes a digit and a space")
            }
            Self::Hex { skip } => {
                (expected.saturating_mul(2).saturating_add(skip) > present, "a byte takes two digits")
            }
        };
        short.then_some(why)
    }

    /// The stream's voxels as little-endian bytes (hex: in the file's byte order); `file` stands at its first byte.
    /// Nothing for raw.
    pub(super) fn decoder(self, file: File, voxel_type: VoxelType) -> io::Result<Option<Box<dyn Decoder>>> {
        let file = BufReader::with_capacity(1 << 17, file);
        let (mut decoder, skip): (Box<dyn Decoder>, u64) = match self {
            Self::Raw => return Ok(None),
            Self::Gzip { skip } => (Box::new(Members(Some(Member::Gzip(GzDecoder::new(file))))), skip),
            Self::Bzip2 { skip } => (Box::new(Members(Some(Member::Bzip2(BzDecoder::new(file))))), skip),
            Self::Ascii { skip } => return Ok(Some(Box::new(AsciiVoxels::new(skipped(file, skip)?, voxel_type)))),
            Self::Hex { skip } => return Ok(Some(Box::new(HexVoxels::new(skipped(file, skip)?)))),
        };
        skip_exactly(&mut decoder, skip)?;
        Ok(Some(decoder))
    }
}

fn skipped(mut file: BufReader<File>, skip: u64) -> io::Result<BufReader<File>> {
    skip_exactly(&mut file, skip)?;
    Ok(file)
}

fn skip_exactly(reader: &mut dyn Read, skip: u64) -> io::Result<()> {
    match io::copy(&mut reader.take(skip), &mut io::sink())? {
        n if n == skip => Ok(()),
        _ => Err(io::ErrorKind::UnexpectedEof.into()),
    }
}

/// Decoded voxels. No bytes are read where the data end.
pub(super) trait Decoder: Read + std::fmt::Debug + Send {
    /// Asked once all voxels were read: true where the data go on. Checksums that stand behind the voxels are checked.
    /// What follows the end of compressed data is not looked at: tools pad to blocks, and `gzip` does not mind.
    fn goes_on(&mut self) -> io::Result<bool> {
        Ok(self.read(&mut [0])? > 0)
    }
}

/// Compressed members, one after the other, as `gzip` and `bzip2` read them; none after a failure.
struct Members(Option<Member>);

enum Member {
    Gzip(GzDecoder<BufReader<File>>),
    Bzip2(BzDecoder<BufReader<File>>),
}

impl Member {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Gzip(decoder) => decoder.read(buffer),
            Self::Bzip2(decoder) => decoder.read(buffer),
        }
    }

    /// The member behind this one, which was read to its end; itself where there is none.
    fn next(self) -> io::Result<(Self, bool)> {
        Ok(match self {
            Self::Gzip(mut decoder) => match decoder.get_mut().fill_buf()?.first() {
                Some(0x1f) => (Self::Gzip(GzDecoder::new(decoder.into_inner())), true),
                _ => (Self::Gzip(decoder), false),
            },
            Self::Bzip2(mut decoder) => match decoder.get_mut().fill_buf()?.first() {
                Some(b'B') => (Self::Bzip2(BzDecoder::new(decoder.into_inner())), true),
                _ => (Self::Bzip2(decoder), false),
            },
        })
    }
}

impl std::fmt::Debug for Members {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Members")
    }
}

impl Read for Members {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let Some(member) = &mut self.0 else { return Ok(0) };
            let got = member.read(buffer)?;
            if got > 0 || buffer.is_empty() {
                return Ok(got);
            }
            let Some(member) = self.0.take() else { return Ok(0) };
            let (member, more) = member.next()?;
            self.0 = Some(member);
            if !more {
                return Ok(0);
            }
        }
    }
}

impl Decoder for Members {
    fn goes_on(&mut self) -> io::Result<bool> {
        match &mut self.0 {
            Some(member) => Ok(member.read(&mut [0])? > 0),
            None => Ok(false),
        }
    }
}

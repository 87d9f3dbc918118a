//! A data set's bytes from front to back, and how numbers lie in them.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek as _, SeekFrom};
use std::path::Path;

use flate2::bufread::DeflateDecoder;

use crate::packed::opened;

/// How much of a deflated data set is looked at for its header: a few bytes may unpack for ever.
const MOST_INFLATED: u64 = 1 << 30;
/// How far memory runs ahead of bytes really read.
const READ_STEP: u64 = 1 << 20;

enum From {
    File(BufReader<File>),
    Deflated(Box<DeflateDecoder<BufReader<File>>>),
}

pub(super) struct Bytes {
    from: From,
    /// The byte that comes next, from where the data set's bytes are counted.
    pub(super) at: u64,
    end: u64,
    pub(super) is_big: bool,
}

impl Bytes {
    /// Bytes of the file itself, counted from its first.
    pub(super) fn plain(path: &Path, at: u64, is_big: bool) -> io::Result<Self> {
        let mut file = opened(path)?;
        let end = file.get_ref().metadata()?.len();
        file.seek(SeekFrom::Start(at))?;
        Ok(Self { from: From::File(file), at, end, is_big })
    }

    /// What is deflated from `start` on, counted from there.
    pub(super) fn deflated(path: &Path, start: u64) -> io::Result<Self> {
        let mut file = opened(path)?;
        file.seek(SeekFrom::Start(start))?;
        let from = From::Deflated(Box::new(DeflateDecoder::new(file)));
        Ok(Self { from, at: 0, end: MOST_INFLATED, is_big: false })
    }

    /// Where the bytes end, or are no longer looked at.
    pub(super) fn end(&self) -> u64 {
        self.end
    }

    pub(super) fn exact<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        match &mut self.from {
            From::File(file) => file.read_exact(&mut bytes)?,
            From::Deflated(deflated) => deflated.read_exact(&mut bytes)?,
        }
        self.at += N as u64;
        Ok(bytes)
    }

    /// Nothing where the bytes end before the first one.
    pub(super) fn exact_or_end<const N: usize>(&mut self) -> io::Result<Option<[u8; N]>> {
        let mut first = [0];
        let got = match &mut self.from {
            From::File(file) => file.read(&mut first)?,
            From::Deflated(deflated) => deflated.read(&mut first)?,
        };
        if got == 0 {
            return Ok(None);
        }
        let mut bytes = [first[0]; N];
        match &mut self.from {
            From::File(file) => file.read_exact(&mut bytes[1..])?,
            From::Deflated(deflated) => deflated.read_exact(&mut bytes[1..])?,
        }
        self.at += N as u64;
        Ok(Some(bytes))
    }

    pub(super) fn u16(&mut self) -> io::Result<u16> {
        let bytes = self.exact()?;
        Ok(if self.is_big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    pub(super) fn u32(&mut self) -> io::Result<u32> {
        let bytes = self.exact()?;
        Ok(if self.is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    pub(super) fn take(&mut self, count: u64) -> io::Result<Vec<u8>> {
        let mut out = Vec::new();
        while (out.len() as u64) < count {
            let step = (count - out.len() as u64).min(READ_STEP);
            out.try_reserve(step as usize).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
            let got = match &mut self.from {
                From::File(file) => file.take(step).read_to_end(&mut out)?,
                From::Deflated(deflated) => deflated.take(step).read_to_end(&mut out)?,
            };
            if (got as u64) < step {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
        self.at += count;
        Ok(out)
    }

    /// Goes to a byte of the file itself.
    pub(super) fn back(&mut self, at: u64) -> io::Result<()> {
        let From::File(file) = &mut self.from else { return Err(io::ErrorKind::NotSeekable.into()) };
        file.seek(SeekFrom::Start(at))?;
        self.at = at;
        Ok(())
    }

    pub(super) fn skip(&mut self, count: u64) -> io::Result<()> {
        if count > self.end.saturating_sub(self.at) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        match &mut self.from {
            From::File(file) => file.seek_relative(count as i64)?,
            From::Deflated(deflated) => {
                if io::copy(&mut deflated.take(count), &mut io::sink())? < count {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
            }
        }
        self.at += count;
        Ok(())
    }
}

//! gzip, zlib and zstd: unpacked as they are read.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use brickcast_volume::format::FormatError;
use brickcast_volume::small_file;
use flate2::bufread::{GzDecoder, ZlibDecoder};

use crate::wrong::unreadable;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    None,
    Gzip,
    Zlib,
    Zstd,
}

impl Packing {
    /// By the first bytes. zlib's mark is too weak to be known by: formats say themselves where they have it.
    pub(crate) fn of(start: &[u8]) -> Self {
        match start {
            [0x1f, 0x8b, 8, ..] => Self::Gzip,
            [0x28, 0xb5, 0x2f, 0xfd, ..] => Self::Zstd,
            _ => Self::None,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "raw",
            Self::Gzip => "gzip",
            Self::Zlib => "zlib",
            Self::Zstd => "zstd",
        }
    }

    /// The bytes behind where `file` stands, unpacked. zstd's window is bounded by 128 MiB.
    pub(crate) fn unpacked<R: io::BufRead + Send + 'static>(self, file: R) -> io::Result<Box<dyn Read + Send>> {
        Ok(match self {
            Self::None => Box::new(file),
            Self::Gzip => Box::new(Members(Some(GzDecoder::new(file)))),
            Self::Zlib => Box::new(ZlibDecoder::new(file)),
            Self::Zstd => Box::new(zstd::stream::read::Decoder::with_buffer(file)?),
        })
    }
}

/// Members of gzip one after the other; what pads the last one is not looked at.
struct Members<R>(Option<GzDecoder<R>>);

impl<R: io::BufRead> Read for Members<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let Some(member) = &mut self.0 else { return Ok(0) };
            let got = member.read(buffer)?;
            if got > 0 || buffer.is_empty() {
                return Ok(got);
            }
            let goes_on = member.get_mut().fill_buf()?.first() == Some(&0x1f);
            self.0 = self.0.take().filter(|_| goes_on).map(|member| GzDecoder::new(member.into_inner()));
        }
    }
}

/// At most `most` of a file's first bytes, and whether these are all.
pub(crate) fn head(path: &Path, most: u64) -> Result<(Vec<u8>, bool), FormatError> {
    let mut bytes = Vec::new();
    let read = opened(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes));
    read.map_err(|reason| unreadable(path, reason))?;
    let is_all = bytes.len() as u64 <= most;
    bytes.truncate(most as usize);
    Ok((bytes, is_all))
}

/// A file as a whole, of at most `most` bytes.
pub(crate) fn whole(path: &Path, most: u64) -> Result<Vec<u8>, FormatError> {
    let (bytes, is_all) = head(path, most)?;
    match is_all {
        true => Ok(bytes),
        false => Err(unreadable(path, io::Error::other(format!("more than {most} bytes; no slice has so many")))),
    }
}

pub(crate) fn opened(path: &Path) -> io::Result<BufReader<File>> {
    match small_file::open_regular(path) {
        Ok(file) => Ok(BufReader::with_capacity(1 << 17, file)),
        Err(small_file::NotOpened::Io(reason)) => Err(reason),
        Err(small_file::NotOpened::NotRegular(kind)) => Err(io::Error::other(format!("it is {kind}, no regular file"))),
    }
}

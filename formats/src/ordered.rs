//! Voxels in file order, as they lie there or unpacked on the way: the source of formats with a header and one block.

use std::io::{self, Read, Seek as _, SeekFrom};
use std::path::PathBuf;

use brickcast_volume::format::{Endian, FormatError, SourceHeader, VolumeSource, VoxelType};

use crate::coding::{Blocks, Numbers, Runs};
use crate::packed::{Packing, opened};
use crate::wrong::unreadable;

/// How far memory runs ahead of bytes really read.
const READ_STEP: u64 = 4 << 20;

/// Where the voxels are.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub(crate) path: PathBuf,
    /// Around the whole file.
    pub(crate) outer: Packing,
    /// First byte of the voxels, or of what they are packed in, once the outer packing is off.
    pub(crate) start: u64,
    /// Around the voxels alone.
    pub(crate) inner: Packing,
    pub(crate) endian: Endian,
    /// The bytes of a number as it lies there, where that is a float of 16 bits; voxels are float32 then.
    pub(crate) is_half: bool,
    pub(crate) coding: Coding,
}

/// How voxels are written down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coding {
    Plain,
    /// Numbers between white space.
    Text(VoxelType),
    /// Of VTK.
    Blocks(Blocks),
    /// Of Amira.
    Runs,
}

impl Block {
    fn is_raw(&self) -> bool {
        self.outer == Packing::None && self.inner == Packing::None && self.coding == Coding::Plain && !self.is_half
    }

    fn packing(&self) -> &'static str {
        match (self.coding, self.inner) {
            (Coding::Text(_), _) => "text",
            (Coding::Blocks(_), _) => "VTK",
            (Coding::Runs, _) => "HxByteRLE",
            (Coding::Plain, Packing::None) => self.outer.name(),
            (Coding::Plain, inner) => inner.name(),
        }
    }

    fn stream(&self) -> io::Result<Stream> {
        let stream = self.bytes()?;
        let reader: Box<dyn Read + Send> = match stream {
            _ if self.coding == Coding::Plain => return Ok(stream),
            Stream::Raw(file) => Box::new(file),
            Stream::Packed(unpacked) => unpacked,
        };
        let reader = io::BufReader::with_capacity(1 << 16, reader);
        Ok(Stream::Packed(match self.coding {
            Coding::Text(voxel_type) => Box::new(Numbers::new(reader, voxel_type)),
            Coding::Blocks(blocks) => blocks.reader(reader)?,
            Coding::Runs => Box::new(Runs::new(reader)),
            Coding::Plain => Box::new(reader),
        }))
    }

    fn bytes(&self) -> io::Result<Stream> {
        let mut file = opened(&self.path)?;
        if self.outer == Packing::None {
            file.seek(SeekFrom::Start(self.start))?;
            return match self.inner {
                Packing::None => Ok(Stream::Raw(file)),
                inner => Ok(Stream::Packed(inner.unpacked(file)?)),
            };
        }
        let mut unpacked = self.outer.unpacked(file)?;
        if io::copy(&mut unpacked.by_ref().take(self.start), &mut io::sink())? < self.start {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(Stream::Packed(match self.inner {
            Packing::None => unpacked,
            inner => inner.unpacked(io::BufReader::with_capacity(1 << 16, unpacked))?,
        }))
    }
}

enum Stream {
    Raw(io::BufReader<std::fs::File>),
    Packed(Box<dyn Read + Send>),
}

impl std::fmt::Debug for Stream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Stream")
    }
}

#[derive(Debug)]
pub(crate) struct OrderedSource {
    header: SourceHeader,
    block: Block,
    files: Vec<PathBuf>,
    /// `None` before the first read.
    stream: Option<Stream>,
    /// Bytes of voxels that were read.
    done: u64,
}

impl OrderedSource {
    /// Checks a raw file's length before anything is read. What follows the voxels is left aside: tools pad.
    pub(crate) fn new(mut header: SourceHeader, block: Block, files: Vec<PathBuf>) -> Result<Self, FormatError> {
        let failed = |reason| unreadable(&block.path, reason);
        let file_bytes = opened(&block.path).and_then(|f| f.get_ref().metadata()).map_err(failed)?.len();
        let expected = expected(&header) / if block.is_half { 2 } else { 1 };
        if block.is_raw() || (block.is_half && block.outer == Packing::None) {
            let present = file_bytes.saturating_sub(block.start);
            if present < expected {
                return Err(FormatError::TooShort {
                    path: block.path,
                    start: block.start,
                    present,
                    expected,
                    dims: header.geometry.dims().to_array(),
                    voxel_type: header.voxel_type,
                });
            }
            if present > expected {
                header.notes.push(format!("{} bytes behind the voxels were left aside", present - expected));
            }
        }
        Ok(Self { header, block, files, stream: None, done: 0 })
    }

    fn failed(&self, position: u64, reason: io::Error) -> FormatError {
        let (path, dims) = (self.block.path.clone(), self.header.geometry.dims().to_array());
        match (self.block.is_raw(), reason.kind()) {
            (true, _) => unreadable(&path, reason),
            (false, io::ErrorKind::UnexpectedEof) => FormatError::CodedTooShort {
                path,
                coding: self.block.packing(),
                present: position,
                expected: expected(&self.header),
                dims,
                voxel_type: self.header.voxel_type,
            },
            _ => FormatError::CodedBroken { path, coding: self.block.packing(), position, reason },
        }
    }

    /// Replaces `out` by the next `want` bytes of voxels, fewer only at the volume's end.
    fn read(&mut self, want: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        let all = expected(&self.header);
        let want = want.min(all - self.done);
        if want == 0 {
            return Ok(());
        }
        // Taken, so that after an error the next read starts no second stream at a wrong place.
        let mut stream = match self.stream.take() {
            Some(stream) => stream,
            None if self.done == 0 => self.block.stream().map_err(|reason| self.failed(0, reason))?,
            None => return Err(unreadable(&self.block.path, io::Error::other("an earlier read failed; rewind first"))),
        };
        let (done, raw) = (self.done, if self.block.is_half { want / 2 } else { want });
        self.done += want;
        let is_packed = matches!(stream, Stream::Packed(_));
        let reader: &mut dyn Read = match &mut stream {
            Stream::Raw(file) => file,
            Stream::Packed(unpacked) => unpacked,
        };
        while (out.len() as u64) < raw {
            let (have, step) = (out.len() as u64, (raw - out.len() as u64).min(READ_STEP));
            out.try_reserve(step as usize).map_err(|_| self.failed(done, io::ErrorKind::OutOfMemory.into()))?;
            let got = reader.take(step).read_to_end(out).map_err(|reason| self.failed(done + have, reason))? as u64;
            if got < step {
                return Err(self.failed(done + have + got, io::ErrorKind::UnexpectedEof.into()));
            }
        }
        if self.done == all && is_packed && self.block.coding == Coding::Plain {
            // Makes the decoder check the sum behind the voxels.
            reader.read(&mut [0]).map_err(|reason| self.failed(all, reason))?;
        }
        let bytes = if self.block.is_half { 2 } else { self.header.voxel_type.bytes() };
        if self.block.endian == Endian::Big {
            swap(out, bytes);
        }
        if self.block.is_half {
            *out = out.as_chunks::<2>().0.iter().flat_map(|h| single(u16::from_le_bytes(*h)).to_le_bytes()).collect();
        }
        self.stream = Some(stream);
        Ok(())
    }
}

fn expected(header: &SourceHeader) -> u64 {
    header.geometry.voxel_count() * header.voxel_type.bytes() as u64
}

/// Bytes of every number the other way round.
pub(crate) fn swap(data: &mut [u8], bytes: usize) {
    match bytes {
        2 => data.as_chunks_mut::<2>().0.iter_mut().for_each(|v| v.reverse()),
        4 => data.as_chunks_mut::<4>().0.iter_mut().for_each(|v| v.reverse()),
        8 => data.as_chunks_mut::<8>().0.iter_mut().for_each(|v| v.reverse()),
        _ => {}
    }
}

/// A float of 16 bits as one of 32: exact.
pub(crate) fn single(half: u16) -> f32 {
    let (sign, exponent, fraction) = (u32::from(half >> 15) << 31, half >> 10 & 31, u32::from(half & 1023));
    match exponent {
        0 => {
            let value = fraction as f32 / 16_777_216.0;
            f32::from_bits(value.to_bits() | sign)
        }
        31 => f32::from_bits(sign | 0x7f80_0000 | fraction << 13),
        _ => f32::from_bits(sign | (u32::from(exponent) + 112) << 23 | fraction << 13),
    }
}

impl VolumeSource for OrderedSource {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        (self.stream, self.done) = (None, 0);
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        self.read(u64::from(d.x) * u64::from(d.y) * self.header.voxel_type.bytes() as u64 * u64::from(count), planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        let voxel = self.header.voxel_type.bytes();
        self.read((most / voxel * voxel).max(voxel) as u64, piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        if !self.block.is_raw() {
            return Ok(false);
        }
        let bytes = (voxel * self.header.voxel_type.bytes() as u64).min(expected(&self.header));
        let sought = self.block.stream().and_then(|mut stream| {
            if let Stream::Raw(file) = &mut stream {
                file.seek(SeekFrom::Start(self.block.start + bytes))?;
            }
            Ok(stream)
        });
        self.stream = Some(sought.map_err(|reason| unreadable(&self.block.path, reason))?);
        self.done = bytes;
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::single;

    #[test]
    fn halves_become_singles() {
        for (half, want) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0001, 5.960_464_5e-8),
            (0x03ff, 6.097_555e-5),
            (0x0400, 6.103_515_6e-5),
            (0x7c00, f32::INFINITY),
        ] {
            assert_eq!(single(half), want, "{half:04x}");
        }
        assert!(single(0x8000).is_sign_negative() && single(0x7e00).is_nan());
    }
}

//! The one reader behind all formats that end in voxels in file order, raw or coded: planes or pieces of them, little
//! endian.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::PathBuf;

pub(super) use super::coded::Coding;
use super::coded::Decoder;
use super::error::FormatError;
use super::source::{SourceHeader, VolumeSource, open_regular};
use super::voxel_type::Endian;

/// Where a file keeps its voxels.
#[derive(Debug, Clone)]
pub(super) struct DataLocation {
    pub(super) path: PathBuf,
    /// First byte of the voxels, or of the coded stream, in the file.
    pub(super) start: u64,
    pub(super) coding: Coding,
    /// Without meaning for voxels of one byte.
    pub(super) endian: Endian,
}

/// How far the slab's memory runs ahead of bytes really read.
const READ_STEP: u64 = 4 << 20;

#[derive(Debug)]
enum Stream {
    Raw(File),
    Coded(Box<dyn Decoder>),
}

#[derive(Debug)]
pub(super) struct PlaneSource {
    header: SourceHeader,
    location: DataLocation,
    /// See [`VolumeSource::files`].
    files: Vec<PathBuf>,
    /// Length of the file when it was opened first.
    file_bytes: u64,
    plane_bytes: u64,
    /// `None` before the first read.
    stream: Option<Stream>,
    /// Bytes of voxels that were read.
    done: u64,
}

impl PlaneSource {
    /// Checks the file's length against dims x type before anything is allocated. `files` are all that the volume is
    /// read from.
    pub(super) fn new(header: SourceHeader, location: DataLocation, files: Vec<PathBuf>) -> Result<Self, FormatError> {
        let file = open_regular(&location.path)?;
        let file_bytes = file.metadata().map_err(|reason| FormatError::io(&location.path, "read", reason))?.len();
        let dims = header.geometry.dims();
        let voxel_bytes = header.voxel_type.bytes() as u64;
        // At most 2^44 voxels (Geometry) of 8 bytes: no overflow.
        let plane_bytes = u64::from(dims.x) * u64::from(dims.y) * voxel_bytes;
        let source = Self { header, location, files, file_bytes, plane_bytes, stream: None, done: 0 };
        source.check_length()?;
        Ok(source)
    }

    fn expected_bytes(&self) -> u64 {
        self.plane_bytes * u64::from(self.header.geometry.dims().z)
    }

    fn check_length(&self) -> Result<(), FormatError> {
        let (start, expected) = (self.location.start, self.expected_bytes());
        let present = self.file_bytes.saturating_sub(start);
        let (path, dims) = (self.location.path.clone(), self.header.geometry.dims().to_array());
        let voxel_type = self.header.voxel_type;
        match self.location.coding {
            Coding::Raw if present < expected => {
                Err(FormatError::TooShort { path, start, present, expected, dims, voxel_type })
            }
            Coding::Raw if present > expected => {
                Err(FormatError::TooLong { path, start, present, expected, dims, voxel_type })
            }
            coding => match coding.impossible(present, expected, voxel_type.bytes() as u64) {
                Some(why) => {
                    let coding = coding.name();
                    Err(FormatError::CodedImpossible { path, coding, present, expected, dims, voxel_type, why })
                }
                None => Ok(()),
            },
        }
    }

    fn start_stream(&self) -> Result<Stream, FormatError> {
        let path = &self.location.path;
        let failed = |reason| FormatError::io(path, "read", reason);
        let mut file = open_regular(path)?;
        let got = file.metadata().map_err(failed)?.len();
        if got != self.file_bytes {
            return Err(FormatError::Changed { path: path.clone(), was: self.file_bytes, got });
        }
        file.seek(SeekFrom::Start(self.location.start)).map_err(failed)?;
        if self.location.coding == Coding::Raw {
            return Ok(Stream::Raw(file));
        }
        match self.location.coding.decoder(file, self.header.voxel_type) {
            Ok(Some(decoder)) => Ok(Stream::Coded(decoder)),
            Ok(None) => Err(failed(io::ErrorKind::Unsupported.into())),
            Err(reason) => Err(self.coded_failed(0, reason)),
        }
    }

    fn coded_too_short(&self, present: u64) -> FormatError {
        FormatError::CodedTooShort {
            path: self.location.path.clone(),
            coding: self.location.coding.name(),
            present,
            expected: self.expected_bytes(),
            dims: self.header.geometry.dims().to_array(),
            voxel_type: self.header.voxel_type,
        }
    }

    fn coded_failed(&self, position: u64, reason: io::Error) -> FormatError {
        if reason.kind() == io::ErrorKind::UnexpectedEof {
            return self.coded_too_short(position);
        }
        let (path, coding) = (self.location.path.clone(), self.location.coding.name());
        FormatError::CodedBroken { path, coding, position, reason }
    }

    /// An error of the stream at `position` bytes of voxels.
    fn failed(&self, position: u64, reason: io::Error) -> FormatError {
        match self.location.coding {
            Coding::Raw => FormatError::io(&self.location.path, "read", reason),
            _ => self.coded_failed(position, reason),
        }
    }

    /// Appends the next `want` bytes to `planes`, whose memory grows only as bytes arrive.
    fn fill(&self, stream: &mut Stream, want: u64, done: u64, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let reader: &mut dyn Read = match stream {
            Stream::Raw(file) => file,
            Stream::Coded(decoder) => decoder,
        };
        let memory = |_| FormatError::Memory {
            path: self.location.path.clone(),
            bytes: want,
            planes: want.div_ceil(self.plane_bytes) as u32,
            dims: self.header.geometry.dims().to_array(),
        };
        if self.location.coding == Coding::Raw {
            // The file is known to be that long.
            planes.try_reserve_exact(usize::try_from(want).unwrap_or(usize::MAX)).map_err(memory)?;
        }
        while (planes.len() as u64) < want {
            let have = planes.len() as u64;
            let step = (want - have).min(READ_STEP);
            planes.try_reserve(step as usize).map_err(memory)?;
            let got = reader.take(step).read_to_end(planes).map_err(|reason| self.failed(done + have, reason))? as u64;
            if got < step {
                let present = done + have + got;
                return Err(match self.location.coding {
                    Coding::Raw => FormatError::Changed {
                        path: self.location.path.clone(),
                        was: self.file_bytes,
                        got: self.location.start + present,
                    },
                    _ => self.coded_too_short(present),
                });
            }
        }
        Ok(())
    }

    /// Replaces `out` by the next `want` bytes, fewer only at the volume's end.
    fn read(&mut self, want: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        let want = want.min(self.expected_bytes() - self.done);
        if want == 0 {
            return Ok(());
        }
        // Taken, so that after an error the next read starts no second stream at a wrong place.
        let mut stream = match self.stream.take() {
            Some(stream) => stream,
            None if self.done == 0 => self.start_stream()?,
            None => return Err(self.failed(0, io::Error::other("an earlier read failed; rewind first"))),
        };
        let done = self.done;
        self.done += want;
        self.fill(&mut stream, want, done, out)?;
        if self.done == self.expected_bytes() {
            self.check_end(&mut stream)?;
        }
        if self.location.endian == Endian::Big {
            swap_bytes(out, self.header.voxel_type.bytes());
        }
        self.stream = Some(stream);
        Ok(())
    }

    /// One read past the end: reports data that goes on, and makes the decoder check the checksum in the trailer.
    fn check_end(&self, stream: &mut Stream) -> Result<(), FormatError> {
        let Stream::Coded(decoder) = stream else { return Ok(()) };
        match decoder.goes_on() {
            Ok(false) => Ok(()),
            Ok(true) => Err(FormatError::CodedTooLong {
                path: self.location.path.clone(),
                coding: self.location.coding.name(),
                expected: self.expected_bytes(),
                dims: self.header.geometry.dims().to_array(),
                voxel_type: self.header.voxel_type,
            }),
            Err(reason) => Err(FormatError::CodedBroken {
                path: self.location.path.clone(),
                coding: self.location.coding.name(),
                position: self.expected_bytes(),
                reason,
            }),
        }
    }
}

impl VolumeSource for PlaneSource {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.stream = None;
        self.done = 0;
        self.stream = Some(self.start_stream()?);
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        self.read(self.plane_bytes * u64::from(count), planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        let voxel = self.header.voxel_type.bytes();
        self.read((most / voxel * voxel).max(voxel) as u64, piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        if self.location.coding != Coding::Raw {
            return Ok(false);
        }
        let mut stream = self.stream.take().map_or_else(|| self.start_stream(), Ok)?;
        let bytes = (voxel * self.header.voxel_type.bytes() as u64).min(self.expected_bytes());
        if let Stream::Raw(file) = &mut stream {
            let sought = file.seek(SeekFrom::Start(self.location.start + bytes));
            sought.map_err(|reason| FormatError::io(&self.location.path, "read", reason))?;
        }
        (self.stream, self.done) = (Some(stream), bytes);
        Ok(true)
    }
}

fn swap_bytes(data: &mut [u8], voxel_bytes: usize) {
    match voxel_bytes {
        2 => data.as_chunks_mut::<2>().0.iter_mut().for_each(|v| v.reverse()),
        8 => data.as_chunks_mut::<8>().0.iter_mut().for_each(|v| v.reverse()),
        4 => data.as_chunks_mut::<4>().0.iter_mut().for_each(|v| v.reverse()),
        _ => {}
    }
}

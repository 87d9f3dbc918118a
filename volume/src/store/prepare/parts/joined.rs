//! The voxels of a level that several parts gathered, one after the other.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::PathBuf;

use crate::format::{FormatError, SourceHeader, VolumeSource};
use crate::small_file::{NotOpened, open_regular};

/// Little-endian voxels of one file after the other; each ends with a plane. One of them is open at a time.
#[derive(Debug)]
pub(super) struct JoinedPlanes {
    header: SourceHeader,
    /// Each with its first byte of all; in their order.
    files: Vec<(PathBuf, u64)>,
    open: Option<(usize, File)>,
    /// Bytes before the next voxel.
    done: u64,
}

impl JoinedPlanes {
    /// `files` with the bytes of each, which were checked.
    pub(super) fn new(header: SourceHeader, files: impl Iterator<Item = (PathBuf, u64)>) -> Self {
        let mut end = 0;
        let place = |(path, bytes): (PathBuf, u64)| {
            let first = end;
            end += bytes;
            (path, first)
        };
        Self { header, files: files.map(place).collect(), open: None, done: 0 }
    }

    fn bytes(&self) -> u64 {
        self.header.geometry.voxel_count() * self.header.voxel_type.bytes() as u64
    }
}

impl VolumeSource for JoinedPlanes {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.seek(0).map(drop)
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        let plane = d.x as usize * d.y as usize * self.header.voxel_type.bytes();
        self.read_piece(plane * count as usize, planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        let want = (self.bytes() - self.done).min(most as u64) as usize;
        piece.resize(want, 0);
        let mut filled = 0;
        while filled < want {
            let at = self.files.partition_point(|(_, first)| *first <= self.done) - 1;
            let (path, first) = &self.files[at];
            let failed = |reason| FormatError::Io { path: path.clone(), action: "read", reason };
            let end = self.files.get(at + 1).map_or(u64::MAX, |(_, next)| *next);
            let part = ((want - filled) as u64).min(end - self.done) as usize;
            if self.open.as_ref().is_none_or(|(open, _)| *open != at) {
                let file = open_regular(path).map_err(|error| match error {
                    NotOpened::Io(reason) => failed(reason),
                    NotOpened::NotRegular(kind) => FormatError::NotRegular { path: path.clone(), kind },
                })?;
                self.open = Some((at, file));
            }
            let Some((_, file)) = &mut self.open else { continue };
            let read = file.seek(SeekFrom::Start(self.done - first));
            read.and_then(|_| file.read_exact(&mut piece[filled..filled + part])).map_err(failed)?;
            (filled, self.done) = (filled + part, self.done + part as u64);
        }
        Ok(())
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.done = (voxel * self.header.voxel_type.bytes() as u64).min(self.bytes());
        Ok(true)
    }
}

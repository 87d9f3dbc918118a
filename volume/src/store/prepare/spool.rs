//! An input that can only be read in order, unpacked once into a scratch file that can be read anywhere.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::pass::Pass;
use crate::format::{FormatError, SourceHeader, VolumeSource};
use crate::store::error::StoreError;
use crate::store::progress::Phase;

/// Bytes that are not written where all of them are 0: a scratch file has holes there.
const HOLE: usize = 1 << 16;
static ZEROS: [u8; HOLE] = [0; HOLE];

/// Little-endian voxels in file order; the file is removed with its directory.
#[derive(Debug)]
pub(crate) struct Spool {
    header: SourceHeader,
    path: PathBuf,
    file: File,
    /// Bytes before the next voxel.
    done: u64,
}

impl Spool {
    /// Reads all of the input, which stands at its first plane.
    pub(crate) fn of(pass: &mut Pass<'_>, dir: &Path) -> Result<Self, StoreError> {
        let path = dir.join("voxels");
        let file = File::options().read(true).write(true).create_new(true).open(&path);
        let mut file = file.map_err(StoreError::io("create", &path))?;
        let bytes = pass.header.voxel_type.bytes() as u64;
        let whole = pass.header.geometry.voxel_count() * bytes;
        let header = pass.header.clone();
        file.set_len(whole).map_err(StoreError::io("write", &path))?;
        pass.each_piece(Phase::Unpack, |start, piece| {
            let mut at = start * bytes;
            for part in piece.chunks(HOLE) {
                if part != &ZEROS[..part.len()] {
                    let written = file.seek(SeekFrom::Start(at)).and_then(|_| file.write_all(part));
                    written.map_err(StoreError::io("write", &path))?;
                }
                at += part.len() as u64;
            }
            Ok(())
        })?;
        let mut spool = Self { header, path, file, done: 0 };
        spool.rewind()?;
        Ok(spool)
    }

    fn failed(&self, reason: io::Error) -> FormatError {
        FormatError::Io { path: self.path.clone(), action: "read", reason }
    }

    fn bytes(&self) -> u64 {
        self.header.geometry.voxel_count() * self.header.voxel_type.bytes() as u64
    }
}

impl VolumeSource for Spool {
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
        let want = (self.bytes() - self.done).min(most as u64);
        piece.resize(want as usize, 0);
        self.file.read_exact(piece).map_err(|reason| self.failed(reason))?;
        self.done += want;
        Ok(())
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.done = (voxel * self.header.voxel_type.bytes() as u64).min(self.bytes());
        self.file.seek(SeekFrom::Start(self.done)).map_err(|reason| self.failed(reason))?;
        Ok(true)
    }
}

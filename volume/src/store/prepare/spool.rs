//! Voxels in a scratch file that can be read anywhere: an input that can only be read in order, unpacked once; a level
//! that was gathered and is still to be written.

use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::pass::Pass;
use crate::format::{FormatError, SourceHeader, VolumeSource};
use crate::store::error::StoreError;
use crate::store::progress::Phase;
use crate::store::tiles::Tile;

/// Bytes that are not written where all of them are 0: a scratch file has holes there.
const HOLE: usize = 1 << 16;
static ZEROS: [u8; HOLE] = [0; HOLE];

/// Little-endian voxels in file order; unless it was settled, the file is removed with this, or with its directory.
#[derive(Debug)]
pub(crate) struct Spool {
    header: SourceHeader,
    path: PathBuf,
    file: File,
    /// Bytes before the next voxel.
    done: u64,
    /// Set where others read it later.
    stays: bool,
}

impl Spool {
    /// Of a volume whose voxels are still to be put into a file of this name; all 0 until then.
    pub(crate) fn create(header: SourceHeader, dir: &Path, name: &str) -> Result<Self, StoreError> {
        let path = dir.join(name);
        let file = File::options().read(true).write(true).create_new(true).open(&path);
        let file = file.map_err(StoreError::io("create", &path))?;
        let spool = Self { header, path, file, done: 0, stays: false };
        spool.file.set_len(spool.bytes()).map_err(StoreError::io("write", &spool.path))?;
        Ok(spool)
    }

    /// Puts a plane of a tile into its place.
    pub(crate) fn put(&mut self, tile: &Tile, z: u32, plane: &[u8]) -> Result<(), StoreError> {
        let d = self.header.geometry.dims();
        let [width, _] = tile.size();
        // Rows that follow each other in the file are written as one.
        let run = if width == d.x as usize { tile.voxels() } else { width };
        let bytes = self.header.voxel_type.bytes();
        let first_rows = (tile.lo[1]..).step_by(run / width);
        for (y, part) in first_rows.zip(plane.chunks_exact(run * bytes)) {
            let start = u64::from(tile.lo[0]) + u64::from(d.x) * (u64::from(y) + u64::from(d.y) * u64::from(z));
            let at = SeekFrom::Start(start * bytes as u64);
            let written = self.file.seek(at).and_then(|_| self.file.write_all(part));
            written.map_err(StoreError::io("write", &self.path))?;
        }
        Ok(())
    }

    /// Brings the file to the disk, where it stays.
    pub(crate) fn settle(mut self) -> Result<(), StoreError> {
        self.stays = true;
        self.file.sync_all().map_err(StoreError::io("write", &self.path))
    }

    /// Stands at the first voxel again.
    pub(crate) fn start_over(&mut self) -> Result<(), StoreError> {
        Ok(self.rewind()?)
    }

    /// Reads all of the input, which stands at its first plane.
    pub(crate) fn of(pass: &mut Pass<'_>, dir: &Path) -> Result<Self, StoreError> {
        let mut spool = Self::create(pass.header.clone(), dir, "voxels")?;
        let bytes = pass.header.voxel_type.bytes() as u64;
        let Self { file, path, .. } = &mut spool;
        pass.each_piece(Phase::Unpack, |start, piece| {
            let mut at = start * bytes;
            for part in piece.chunks(HOLE) {
                if part != &ZEROS[..part.len()] {
                    let written = file.seek(SeekFrom::Start(at)).and_then(|_| file.write_all(part));
                    written.map_err(StoreError::io("write", path))?;
                }
                at += part.len() as u64;
            }
            Ok(())
        })?;
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

impl Drop for Spool {
    fn drop(&mut self) {
        if !self.stays {
            // What is left goes with the directory.
            let _ = fs::remove_file(&self.path);
        }
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

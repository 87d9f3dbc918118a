//! A volume whose planes lie in several files, each with as many whole planes as the others, one file open at a time.

use std::io;
use std::path::{Path, PathBuf};

use super::coded::Coding;
use super::error::FormatError;
use super::planes::{DataLocation, PlaneSource};
use super::source::{SourceHeader, VolumeSource};
use crate::space::Geometry;

#[derive(Debug)]
pub(super) struct SeriesSource {
    header: SourceHeader,
    /// Of what one file holds.
    part: SourceHeader,
    /// The header's file, then the data files in order.
    files: Vec<PathBuf>,
    /// Where the voxels of each data file begin.
    starts: Vec<u64>,
    /// Of the first file; the others differ in path and start.
    like: DataLocation,
    /// The file that was read last, and which of all it is.
    open: Option<(usize, PlaneSource)>,
    /// The voxel that comes next, x fastest.
    next: u64,
    /// It may be another than the open file stands at.
    sought: bool,
    /// An error ends a pass.
    failed: bool,
}

impl SeriesSource {
    /// Finds every file, and checks its length against its share of the voxels. The number of files divides the
    /// volume's planes. `files` is the header's file alone.
    pub(super) fn new<F: FnOnce() -> Result<DataLocation, FormatError>>(
        header: SourceHeader,
        mut files: Vec<PathBuf>,
        parts: impl ExactSizeIterator<Item = F>,
    ) -> Result<Self, FormatError> {
        let (count, path) = (parts.len(), files[0].clone());
        let (d, g) = (header.geometry.dims(), header.geometry);
        let depth = d.z / u32::try_from(count).unwrap_or(u32::MAX).max(1);
        let geometry = Geometry::new([d.x, d.y, depth], g.spacing().to_array(), g.origin().to_array())
            .map_err(|reason| FormatError::Geometry { path: path.clone(), reason })?;
        let part = SourceHeader { geometry, notes: Vec::new(), ..header.clone() };
        let (mut starts, mut like) = (Vec::with_capacity(count), None);
        for (i, locate) in parts.enumerate() {
            let checked = locate().and_then(|location| {
                PlaneSource::new(part.clone(), location.clone(), Vec::new())?;
                Ok(location)
            });
            let location = checked.map_err(|reason| of_part(&path, i, count, reason))?;
            files.push(location.path.clone());
            starts.push(location.start);
            like.get_or_insert(location);
        }
        match like {
            Some(like) => {
                Ok(Self { header, part, files, starts, like, open: None, next: 0, sought: false, failed: false })
            }
            None => Err(FormatError::io(&path, "read", io::Error::other("it names no data files"))),
        }
    }

    /// The next voxels, at most `most` of them and all of one file.
    fn read_part(&mut self, most: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let (of_file, bytes) = (self.part.geometry.voxel_count(), self.header.voxel_type.bytes() as u64);
        let (i, within) = ((self.next / of_file) as usize, self.next % of_file);
        let want = usize::try_from(most.min(of_file - within) * bytes).unwrap_or(usize::MAX);
        let mut read = || -> Result<PlaneSource, FormatError> {
            let mut source = match self.open.take().filter(|(open, _)| *open == i) {
                Some((_, source)) => source,
                None => {
                    let (path, start) = (self.files[i + 1].clone(), self.starts[i]);
                    let location = DataLocation { path, start, ..self.like.clone() };
                    PlaneSource::new(self.part.clone(), location, Vec::new())?
                }
            };
            if self.sought {
                source.seek(within)?;
            }
            source.read_piece(want, out)?;
            Ok(source)
        };
        let source = read().map_err(|reason| of_part(&self.files[0], i, self.starts.len(), reason))?;
        self.sought = false;
        self.next += out.len() as u64 / bytes;
        self.open = (!self.next.is_multiple_of(of_file)).then_some((i, source));
        Ok(())
    }

    /// Replaces `out` by the next `want` voxels (fewer only at the volume's end).
    fn read(&mut self, want: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        if self.failed {
            let reason = io::Error::other("an earlier read failed; rewind first");
            return Err(FormatError::io(&self.files[0], "read", reason));
        }
        self.failed = true;
        let end = self.header.geometry.voxel_count().min(self.next.saturating_add(want));
        let mut more = Vec::new();
        while self.next < end {
            if out.is_empty() {
                self.read_part(end - self.next, out)?;
            } else {
                self.read_part(end - self.next, &mut more)?;
                out.append(&mut more);
            }
        }
        self.failed = false;
        Ok(())
    }
}

fn of_part(header: &Path, index: usize, count: usize, reason: FormatError) -> FormatError {
    FormatError::Part { header: header.into(), number: index + 1, count, reason: Box::new(reason) }
}

impl VolumeSource for SeriesSource {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        (self.open, self.next, self.sought, self.failed) = (None, 0, false, false);
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        self.read(u64::from(d.x) * u64::from(d.y) * u64::from(count), planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        self.read((most / self.header.voxel_type.bytes()).max(1) as u64, piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        if self.like.coding != Coding::Raw {
            return Ok(false);
        }
        (self.next, self.sought) = (voxel, true);
        Ok(true)
    }
}

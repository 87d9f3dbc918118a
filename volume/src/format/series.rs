//! A volume whose planes lie in several files, each with as many whole planes as the others, one file open at a time.

use std::io;
use std::path::{Path, PathBuf};

use super::planes::{DataLocation, PlaneSource};
use super::{FormatError, SourceHeader, VolumeSource};
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
    /// The file that the next plane is in, once a plane of it was read.
    open: Option<PlaneSource>,
    next_plane: u32,
    /// An error ends a pass.
    failed: bool,
}

impl SeriesSource {
    /// Finds every file, and checks its length against its share of the voxels. The number of files divides the volume's planes.
    pub(super) fn new<F: FnOnce() -> Result<DataLocation, FormatError>>(
        header: SourceHeader,
        path: &Path,
        parts: impl ExactSizeIterator<Item = F>,
    ) -> Result<Self, FormatError> {
        let count = parts.len();
        let (d, g) = (header.geometry.dims(), header.geometry);
        let depth = d.z / u32::try_from(count).unwrap_or(u32::MAX).max(1);
        let geometry = Geometry::new([d.x, d.y, depth], g.spacing().to_array(), g.origin().to_array())
            .map_err(|reason| FormatError::Geometry { path: path.into(), reason })?;
        let part = SourceHeader { geometry, notes: Vec::new(), ..header.clone() };
        let (mut files, mut starts, mut like) = (vec![path.to_path_buf()], Vec::with_capacity(count), None);
        for (i, locate) in parts.enumerate() {
            let checked = locate().and_then(|location| {
                PlaneSource::new(part.clone(), location.clone(), Vec::new())?;
                Ok(location)
            });
            let location = checked.map_err(|reason| of_part(path, i, count, reason))?;
            files.push(location.path.clone());
            starts.push(location.start);
            like.get_or_insert(location);
        }
        match like {
            Some(like) => Ok(Self { header, part, files, starts, like, open: None, next_plane: 0, failed: false }),
            None => Err(FormatError::io(path, "read", io::Error::other("it names no data files"))),
        }
    }

    /// The next planes of one file, at most `count` of them.
    fn read_part(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let depth = self.part.geometry.dims().z;
        let (i, within) = ((self.next_plane / depth) as usize, self.next_plane % depth);
        let count = count.min(depth - within);
        let mut read = || -> Result<PlaneSource, FormatError> {
            let mut source = match self.open.take() {
                Some(source) => source,
                None => {
                    let (path, start) = (self.files[i + 1].clone(), self.starts[i]);
                    let location = DataLocation { path, start, ..self.like.clone() };
                    PlaneSource::new(self.part.clone(), location, Vec::new())?
                }
            };
            source.read_planes(count, planes)?;
            Ok(source)
        };
        let source = read().map_err(|reason| of_part(&self.files[0], i, self.starts.len(), reason))?;
        self.open = (within + count < depth).then_some(source);
        self.next_plane += count;
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
        (self.open, self.next_plane, self.failed) = (None, 0, false);
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        planes.clear();
        if self.failed {
            let reason = io::Error::other("an earlier read failed; rewind first");
            return Err(FormatError::io(&self.files[0], "read", reason));
        }
        self.failed = true;
        let end = self.header.geometry.dims().z.min(self.next_plane.saturating_add(count));
        let mut more = Vec::new();
        while self.next_plane < end {
            let count = end - self.next_plane;
            if planes.is_empty() {
                self.read_part(count, planes)?;
            } else {
                self.read_part(count, &mut more)?;
                planes.append(&mut more);
            }
        }
        self.failed = false;
        Ok(())
    }
}

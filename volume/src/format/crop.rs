//! A box of a volume's voxels, read as a volume of its own.
//!
//! The invariant: *voxel v of what is read is voxel `lo + v` of the source, at the same place in the world*; what lies
//! outside of the box is passed over where the source can seek, and never held.

use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::error::FormatError;
use super::source::{SourceHeader, VolumeSource};

/// Bytes of a source that are read at once, where it can stop there.
const PIECE: u64 = 4 << 20;
/// Fewer are read rather than sought over.
const GAP: u64 = 256 << 10;

/// Which voxels of each axis, half-open; without an end, up to the volume's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crop(pub [(u32, Option<u32>); 3]);

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CropError {
    #[error("`{0}` is not X0:X1,Y0:Y1,Z0:Z1 in voxels, from 0, the ends left out, such as 100:300,:,20: ")]
    Text(String),
    #[error(
        "the box {crop} holds no voxel or reaches beyond the volume, which has {dims:?}: on each axis the first voxel \
         is below the end, and the end at most the volume's"
    )]
    Outside { crop: Crop, dims: [u32; 3] },
}

impl std::fmt::Display for Crop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (axis, (lo, hi)) in self.0.iter().enumerate() {
            let comma = if axis == 0 { "" } else { "," };
            write!(f, "{comma}{lo}:{}", hi.map(|hi| hi.to_string()).unwrap_or_default())?;
        }
        Ok(())
    }
}

impl FromStr for Crop {
    type Err = CropError;

    fn from_str(text: &str) -> Result<Self, CropError> {
        let number = |part: &str| match part.trim() {
            "" => Some(None),
            part => part.parse().ok().map(Some),
        };
        let axis = |part: &str| {
            let (lo, hi) = part.split_once(':')?;
            Some((number(lo)?.unwrap_or(0), number(hi)?))
        };
        let axes: Option<Vec<_>> = text.split(',').map(axis).collect();
        axes.and_then(|axes| axes.try_into().ok()).map(Self).ok_or_else(|| CropError::Text(text.to_owned()))
    }
}

impl Crop {
    /// First voxel and end of the box in a volume.
    ///
    /// # Errors
    /// A box without voxels, or beyond the volume.
    pub fn of(self, dims: [u32; 3]) -> Result<[[u32; 3]; 2], CropError> {
        let lo: [u32; 3] = std::array::from_fn(|a| self.0[a].0);
        let hi: [u32; 3] = std::array::from_fn(|a| self.0[a].1.unwrap_or(dims[a]));
        let is_inside = (0..3).all(|a| lo[a] < hi[a] && hi[a] <= dims[a]);
        if is_inside { Ok([lo, hi]) } else { Err(CropError::Outside { crop: self, dims }) }
    }
}

/// A box of a source.
#[derive(Debug)]
pub(super) struct Cropped {
    source: Box<dyn VolumeSource>,
    path: PathBuf,
    /// Of the box.
    header: SourceHeader,
    lo: [u64; 3],
    hi: [u64; 3],
    /// Voxels of the source per axis.
    dims: [u64; 3],
    /// The voxel of the source that it gives next.
    source_next: u64,
    /// The voxel of the box that comes next.
    next: u64,
    /// Bytes of the box that were read ahead, and how many of them were given.
    ahead: Vec<u8>,
    given: usize,
    piece: Vec<u8>,
}

impl Cropped {
    /// `header` is that of the box `[lo, hi)`, which lies in the source.
    pub(super) fn new(
        source: Box<dyn VolumeSource>,
        path: &Path,
        header: SourceHeader,
        [lo, hi]: [[u32; 3]; 2],
    ) -> Self {
        let dims = source.header().geometry.dims().to_array().map(u64::from);
        Self {
            source,
            path: path.into(),
            header,
            lo: lo.map(u64::from),
            hi: hi.map(u64::from),
            dims,
            source_next: 0,
            next: 0,
            ahead: Vec::new(),
            given: 0,
            piece: Vec::new(),
        }
    }

    fn voxel_bytes(&self) -> u64 {
        self.header.voxel_type.bytes() as u64
    }

    /// Where a voxel of the box is in the source.
    fn in_source(&self, voxel: u64) -> u64 {
        let [nx, ny] = [self.hi[0] - self.lo[0], self.hi[1] - self.lo[1]];
        let (x, y, z) = (voxel % nx, voxel / nx % ny, voxel / nx / ny);
        ((self.lo[2] + z) * self.dims[1] + self.lo[1] + y) * self.dims[0] + self.lo[0] + x
    }

    /// Reads a piece of the source, and keeps what lies in the box. The next voxel of the box lies in it or behind it.
    fn read_ahead(&mut self) -> Result<(), FormatError> {
        let (bytes, at) = (self.voxel_bytes(), self.in_source(self.next));
        let is_far = at < self.source_next || (at - self.source_next) * bytes > GAP;
        if is_far && self.source.seek(at)? {
            self.source_next = at;
        }
        // No further than the plane's last row: what follows may be sought over.
        let plane_end =
            (at / (self.dims[0] * self.dims[1]) * self.dims[1] + self.hi[1] - 1) * self.dims[0] + self.hi[0];
        let most = (plane_end - self.source_next.min(plane_end - 1)).saturating_mul(bytes).min(PIECE);
        self.source.read_piece(most as usize, &mut self.piece)?;
        let (first, end) = (self.source_next, self.source_next + self.piece.len() as u64 / bytes);
        if first == end {
            let reason = io::Error::new(io::ErrorKind::UnexpectedEof, "it ended before its last voxel");
            return Err(FormatError::io(&self.path, "read", reason));
        }
        self.ahead.clear();
        self.given = 0;
        for row in first / self.dims[0]..end.div_ceil(self.dims[0]) {
            let (y, z) = (row % self.dims[1], row / self.dims[1]);
            if (self.lo[1]..self.hi[1]).contains(&y) && (self.lo[2]..self.hi[2]).contains(&z) {
                let from = (row * self.dims[0] + self.lo[0]).max(first);
                let to = (row * self.dims[0] + self.hi[0]).min(end);
                if from < to {
                    let [from, to] = [from, to].map(|voxel| ((voxel - first) * bytes) as usize);
                    self.ahead.extend_from_slice(&self.piece[from..to]);
                }
            }
        }
        self.source_next = end;
        Ok(())
    }

    /// Replaces `out` by the next `want` voxels (fewer only at the box's end).
    fn read(&mut self, want: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        let bytes = self.voxel_bytes();
        let end = self.header.geometry.voxel_count().min(self.next.saturating_add(want));
        while self.next < end {
            if self.given == self.ahead.len() {
                self.read_ahead()?;
            }
            let take = usize::try_from((end - self.next) * bytes).unwrap_or(usize::MAX);
            let take = take.min(self.ahead.len() - self.given);
            out.extend_from_slice(&self.ahead[self.given..][..take]);
            self.given += take;
            self.next += take as u64 / bytes;
        }
        Ok(())
    }
}

impl VolumeSource for Cropped {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        self.source.files()
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.source.rewind()?;
        (self.source_next, self.next, self.given) = (0, 0, 0);
        self.ahead.clear();
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims().as_u64vec3();
        self.read(d.x * d.y * u64::from(count), planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        self.read((most as u64 / self.voxel_bytes()).max(1), piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        // Behind the box's end is nowhere in the source: what is there is asked for by its first voxel.
        let is_end = voxel >= self.header.geometry.voxel_count();
        let at = self.in_source(if is_end { 0 } else { voxel });
        if !self.source.seek(at)? {
            return Ok(false);
        }
        (self.source_next, self.next, self.given) = (at, voxel, 0);
        self.ahead.clear();
        Ok(true)
    }

    fn read_box(&mut self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<bool, FormatError> {
        let moved = |at: [u32; 3]| std::array::from_fn(|a| at[a] + self.lo[a] as u32);
        self.source.read_box(moved(lo), moved(hi), voxels)
    }
}

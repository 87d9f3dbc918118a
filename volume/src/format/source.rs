//! An input volume, whatever its format.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::error::FormatError;
use super::known::supported;
use super::rescale::Rescale;
use super::said_by::{Facts, FactsBy, SaidBy, facts};
use super::voxel_type::VoxelType;
use crate::small_file::{self, FileKind, NotOpened};
use crate::space::Geometry;

/// What of a geometry a file, or the user, says; the rest was assumed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Placement {
    pub spacing: bool,
    pub origin: bool,
    pub directions: bool,
}

/// What a file says of its volume.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceHeader {
    pub geometry: Geometry,
    /// What of the geometry the file says.
    pub placement: Placement,
    pub facts_by: FactsBy,
    pub voxel_type: VoxelType,
    /// What the voxels' numbers mean.
    pub rescale: Rescale,
    /// Name of the format, for people.
    pub format: &'static str,
    /// Unit of spacing and origin where the file names one, e.g. `mm`.
    pub space_unit: Option<String>,
    /// Numbers that stand for no data (fill values), as voxels hold them; the file or the user declares them. NaN
    /// always does.
    pub no_data: Vec<f64>,
    /// What was guessed or left aside (a raw file's name read as dims, axes of another space), for people.
    pub notes: Vec<String>,
}

impl SourceHeader {
    /// Of a file that says nothing else.
    #[must_use]
    pub fn new(format: &'static str, geometry: Geometry, voxel_type: VoxelType) -> Self {
        Self {
            geometry,
            placement: Placement::default(),
            facts_by: FactsBy::default(),
            voxel_type,
            rescale: Rescale::IDENTITY,
            format,
            space_unit: None,
            no_data: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Who says what is known of the volume.
    #[must_use]
    pub fn source_of(&self) -> Facts {
        let FactsBy { dims, voxel_type, place, overruled } = self.facts_by;
        let by =
            |is_overruled, is_said: bool| SaidBy::flag_or(is_overruled, if is_said { place } else { SaidBy::Default });
        facts([
            dims,
            voxel_type,
            by(overruled.spacing, self.placement.spacing),
            by(overruled.origin, self.placement.origin),
            by(overruled.directions, self.placement.directions),
            by(false, self.space_unit.is_some()),
            by(false, !self.rescale.is_identity()),
        ])
    }
}

/// An input volume, read in order; a second pass starts with [`VolumeSource::rewind`].
pub trait VolumeSource: Send + std::fmt::Debug {
    fn header(&self) -> &SourceHeader;

    /// Every file that the volume is read from, its header first: while none of them changes, nor does the volume. None
    /// where it is in memory.
    fn files(&self) -> &[PathBuf] {
        &[]
    }

    /// Starts over at plane 0.
    ///
    /// # Errors
    /// The file cannot be opened again.
    fn rewind(&mut self) -> Result<(), FormatError>;

    /// Replaces `planes` by the next `count` z-planes (fewer only at the volume's end), voxels little endian, x
    /// fastest.
    ///
    /// # Errors
    /// Truncated data, a broken compressed stream.
    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError>;

    /// Replaces `piece` by the voxels that come next: whole voxels, `most` bytes where so many are left. A source that
    /// cannot stop within a plane gives the whole next one.
    ///
    /// # Errors
    /// As [`VolumeSource::read_planes`].
    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        let _ = most;
        self.read_planes(1, piece)
    }

    /// Makes `voxel`, counted x fastest, the next one that [`VolumeSource::read_piece`] gives. False where the source
    /// goes in order only; then nothing has changed.
    ///
    /// # Errors
    /// The file cannot be opened again.
    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        let _ = voxel;
        Ok(false)
    }

    /// Replaces `voxels` by those of the box `[lo, hi)`, x fastest, where the source has boxes rather than rows: what
    /// lies in chunks is then taken out of each at once. False where it has none; then nothing has changed. What
    /// [`VolumeSource::read_piece`] gives next stays the same.
    ///
    /// # Errors
    /// As [`VolumeSource::read_planes`].
    fn read_box(&mut self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<bool, FormatError> {
        let _ = (lo, hi, voxels);
        Ok(false)
    }
}

/// Opens a regular file; anything else is refused, never waited for.
pub(super) fn open_regular(path: &Path) -> Result<File, FormatError> {
    small_file::open_regular(path).map_err(|error| match error {
        NotOpened::Io(reason) => FormatError::io(path, "open", reason),
        NotOpened::NotRegular(FileKind::Folder) => FormatError::Directory { path: path.into(), supported: supported() },
        NotOpened::NotRegular(kind) => FormatError::NotRegular { path: path.into(), kind },
    })
}

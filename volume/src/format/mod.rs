//! Volume file formats, read in slabs of whole z-planes.

use crate::space::Geometry;

/// The type of a file's voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum VoxelType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F32,
}

impl VoxelType {
    /// Bytes per voxel.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
        }
    }

    /// 8 and 16 bits are stored as they are; wider types are mapped to 16 bits by scale and offset.
    #[must_use]
    pub fn is_lossless(self) -> bool {
        self.bytes() <= 2
    }
}

/// What a file says of its volume.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceHeader {
    pub geometry: Geometry,
    pub voxel_type: VoxelType,
    /// Name of the format, for people.
    pub format: &'static str,
    /// Unit of spacing and origin where the file names one, e.g. `mm`.
    pub space_unit: Option<String>,
    /// What was guessed or left aside (a raw file's name read as dims, a rotation that was dropped), for people.
    pub notes: Vec<String>,
}

#[derive(Debug, thiserror::Error)]
#[error("todo")]
pub struct FormatError;

/// An input volume, read in order; a second pass starts with [`VolumeSource::rewind`].
pub trait VolumeSource: Send {
    fn header(&self) -> &SourceHeader;

    /// Starts over at plane 0.
    ///
    /// # Errors
    /// The file cannot be opened again.
    fn rewind(&mut self) -> Result<(), FormatError>;

    /// Replaces `planes` by the next `count` z-planes (fewer only at the volume's end), voxels little endian, x fastest.
    ///
    /// # Errors
    /// Truncated data, a broken compressed stream.
    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError>;
}

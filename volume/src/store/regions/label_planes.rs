//! Planes of given labels, from a label volume or from a flood fill.

use std::path::Path;

use super::error::RegionsError;
use super::label_place::{self, Placed};
use crate::format::{FormatError, Opener, RawHints, VolumeSource, VoxelType};
use crate::store::error::StoreError;
use crate::store::prepare::spool::Spool;

/// Labels in file order; a pass starts at plane 0.
#[derive(Debug)]
pub(crate) enum LabelPlanes {
    File(Box<dyn VolumeSource>),
    Memory(Vec<u32>),
}

impl LabelPlanes {
    /// `volume` is where they must lie.
    pub(crate) fn open(
        (path, hints, opener): (&Path, &RawHints, Opener),
        volume: Placed<'_>,
    ) -> Result<Self, StoreError> {
        let source = opener.open(path, hints)?;
        let header = source.header();
        let (got, want) = (header.geometry.dims().to_array(), volume.0.dims().to_array());
        if got != want {
            return Err(RegionsError::LabelDims { got, want }.into());
        }
        label_place::check(volume, (&header.geometry, header.placement))?;
        match header.voxel_type {
            VoxelType::F32 | VoxelType::F64 => Err(RegionsError::LabelType { got: header.voxel_type.name() }.into()),
            _ => Ok(Self::File(source)),
        }
    }

    /// Labels of a coarser level.
    pub(crate) fn of_level(labels: Spool) -> Self {
        Self::File(Box::new(labels))
    }

    /// The error for more labels than `max`, by where they come from.
    pub(crate) fn too_many(&self, max: usize) -> RegionsError {
        match self {
            Self::File(_) => RegionsError::TooManyLabels { max },
            Self::Memory(_) => RegionsError::TooManyFlooded { max },
        }
    }

    /// Starts over at plane 0.
    pub(crate) fn rewind(&mut self) -> Result<(), FormatError> {
        match self {
            Self::File(source) => source.rewind(),
            Self::Memory(_) => Ok(()),
        }
    }

    /// Replaces `labels` by those of the planes `z0..z1`, which must be the next; a plane has `plane` voxels. Labels of
    /// signed types are told apart by their bits.
    pub(crate) fn read(&mut self, z0: u32, z1: u32, plane: usize, labels: &mut Vec<u32>) -> Result<(), StoreError> {
        labels.clear();
        let source = match self {
            Self::Memory(all) => {
                labels.extend_from_slice(&all[z0 as usize * plane..z1 as usize * plane]);
                return Ok(());
            }
            Self::File(source) => source,
        };
        let voxel_type = source.header().voxel_type;
        let mut bytes = Vec::new();
        for z in z0..z1 {
            source.read_planes(1, &mut bytes)?;
            let want = plane * voxel_type.bytes();
            if bytes.len() != want {
                return Err(StoreError::SourceLength { plane: z, got: bytes.len(), want });
            }
            match voxel_type.bytes() {
                8 => labels_of_8(voxel_type, &bytes, labels)?,
                1 => labels.extend(bytes.iter().map(|b| u32::from(*b))),
                2 => labels.extend(bytes.as_chunks::<2>().0.iter().map(|b| u32::from(u16::from_le_bytes(*b)))),
                _ => labels.extend(bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b))),
            }
        }
        Ok(())
    }
}

/// 64-bit labels that 32 bits hold: numpy's default type for them is int64.
fn labels_of_8(voxel_type: VoxelType, bytes: &[u8], labels: &mut Vec<u32>) -> Result<(), RegionsError> {
    for b in bytes.as_chunks::<8>().0 {
        let label = match voxel_type {
            VoxelType::U64 => u32::try_from(u64::from_le_bytes(*b)).ok(),
            _ => i32::try_from(i64::from_le_bytes(*b)).ok().map(|label| label as u32),
        };
        let got = || match voxel_type {
            VoxelType::U64 => i128::from(u64::from_le_bytes(*b)),
            _ => i128::from(i64::from_le_bytes(*b)),
        };
        labels.push(label.ok_or_else(|| RegionsError::LabelValue { got: got() })?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nobody who floods has a label volume to change.
    #[test]
    fn a_flood_fill_with_too_many_regions_says_so_in_its_own_words() {
        let says = LabelPlanes::Memory(Vec::new()).too_many(1 << 24).to_string();
        assert!(says.contains("flood") && says.contains("--segmentation-range") && !says.contains("volume"), "{says}");
    }
}

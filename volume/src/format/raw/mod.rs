//! Headerless voxels: what the hints say, then what the file's name says.

pub(super) mod error;
mod name;

use super::crop::Crop;
use super::error::FormatError;
use super::input::Input;
use super::planes::{Coding, DataLocation, PlaneSource};
use super::said_by::{FactsBy, SaidBy};
use super::source::{Placement, SourceHeader, VolumeSource};
use super::voxel_type::{Endian, VoxelType};
use crate::space::Geometry;
use glam::DMat3;
use name::RawName;

pub use error::RawError;

/// What the user says of a raw file, whose name fills in what is missing; and of files of any format, what they hold,
/// where it lies, and which part of it is meant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawHints {
    /// Voxels per axis, x fastest.
    pub dims: Option<[u32; 3]>,
    pub voxel_type: Option<VoxelType>,
    pub endian: Option<Endian>,
    /// Bytes in front of the first voxel.
    pub skip: u64,
    /// World units per voxel and axis.
    pub spacing: Option<[f64; 3]>,
    /// World position of the centre of voxel (0, 0, 0).
    pub origin: Option<[f64; 3]>,
    /// A value that stands for no data, in files of any format.
    pub no_data: Option<f64>,
    /// Which channel of an image that has several, counted from 0.
    pub channel: Option<u64>,
    /// Which point in time of an image that has several, counted from 0.
    pub time: Option<u64>,
    /// The index axes in the world, one a column: orthonormal.
    pub axes: Option<DMat3>,
    /// Which box of the voxels.
    pub crop: Option<Crop>,
    /// Slices of a stack that are missing or broken are filled.
    pub skip_broken: bool,
}

impl RawHints {
    /// True where the user said nothing that is for raw files alone.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.dims.is_none() && self.voxel_type.is_none() && self.endian.is_none() && self.skip == 0
    }

    /// What is said of the flags of images, in formats that have one channel and one point in time.
    #[must_use]
    pub fn of_one_volume(&self) -> Option<String> {
        (self.channel.is_some() || self.time.is_some())
            .then(|| "--channel and --time are for OME-Zarr; this format has one volume, which was taken".into())
    }
}

pub(super) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let Input { path, file, files, .. } = input;
    let file_bytes = file.metadata().map_err(|reason| FormatError::io(&path, "read", reason))?.len();
    let name = RawName::of(&path);
    let mut notes: Vec<String> = hints.of_one_volume().into_iter().collect();
    if hints.dims.is_none()
        && let Some([x, y, z]) = name.dims
    {
        notes.push(format!("dims {x} x {y} x {z} read from the file's name (--dims X,Y,Z overrides)"));
    }
    if hints.voxel_type.is_none()
        && let Some(voxel_type) = name.voxel_type
    {
        notes.push(format!("type {voxel_type} read from the file's name (--type overrides)"));
    }
    let (dims, voxel_type) = match (hints.dims.or(name.dims), hints.voxel_type.or(name.voxel_type)) {
        (Some(dims), Some(voxel_type)) => (dims, voxel_type),
        (dims, voxel_type) => {
            let missing = match (dims.is_some(), voxel_type.is_some()) {
                (false, false) => "dims and type",
                (false, true) => "dims",
                _ => "type",
            };
            let length = length_help(dims, voxel_type, file_bytes.saturating_sub(hints.skip));
            return Err(FormatError::header(&path, RawError::Unknown { missing, length }));
        }
    };
    let endian = hints.endian.or(name.endian).unwrap_or(Endian::Little);
    if voxel_type.bytes() > 1 && hints.endian.is_none() {
        notes.push(match name.endian {
            Some(endian) => format!("byte order {endian} read from the file's name (--endian overrides)"),
            None => "byte order not said: little assumed (--endian big overrides)".into(),
        });
    }
    if hints.spacing.is_none() {
        notes.push("spacing not said: 1, 1, 1 assumed (--spacing X,Y,Z overrides)".into());
    }
    let geometry = Geometry::new(dims, hints.spacing.unwrap_or([1.0; 3]), hints.origin.unwrap_or([0.0; 3]))
        .map_err(|reason| FormatError::Geometry { path: path.clone(), reason })?;
    let placement = Placement { spacing: hints.spacing.is_some(), origin: hints.origin.is_some(), directions: false };
    let facts_by = FactsBy {
        dims: SaidBy::flag_or(hints.dims.is_some(), SaidBy::FileName),
        voxel_type: SaidBy::flag_or(hints.voxel_type.is_some(), SaidBy::FileName),
        place: SaidBy::Flag,
        overruled: placement,
    };
    let no_data = hints.no_data.into_iter().collect();
    let header = SourceHeader { placement, facts_by, no_data, notes, ..SourceHeader::new("raw", geometry, voxel_type) };
    let location = DataLocation { path, start: hints.skip, coding: Coding::Raw, endian };
    Ok(Box::new(PlaneSource::new(header, location, files)?))
}

/// What the file's length says where only half is known; empty where it says nothing.
fn length_help(dims: Option<[u32; 3]>, voxel_type: Option<VoxelType>, bytes: u64) -> String {
    match (dims, voxel_type) {
        (Some(dims), None) => {
            let voxels: u128 = dims.iter().map(|&n| u128::from(n)).product();
            if voxels > 0 && u128::from(bytes) % voxels == 0 {
                format!(" Its {bytes} bytes are {} per voxel.", u128::from(bytes) / voxels)
            } else {
                format!(" Its {bytes} bytes are no multiple of the {voxels} voxels.")
            }
        }
        (None, Some(voxel_type)) => {
            format!(" Its {bytes} bytes are {} voxels of {voxel_type}.", bytes / voxel_type.bytes() as u64)
        }
        _ => String::new(),
    }
}

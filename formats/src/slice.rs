//! What slices are, and what files say of them.

use brickcast_volume::format::{Rescale, VoxelType};

use crate::space::Place;

/// What all slices of a stack share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) size: [u32; 2],
    pub(crate) voxel_type: VoxelType,
}

/// What the first file says of the whole.
#[derive(Debug, Clone)]
pub(crate) struct Said {
    pub(crate) format: &'static str,
    pub(crate) place: Place,
    pub(crate) unit: Option<String>,
    pub(crate) rescale: Rescale,
    pub(crate) has_several: bool,
    pub(crate) notes: Vec<String>,
}

impl Said {
    pub(crate) fn nothing(format: &'static str) -> Self {
        Self {
            format,
            place: Place::unknown(),
            unit: None,
            rescale: Rescale::IDENTITY,
            has_several: false,
            notes: Vec::new(),
        }
    }
}

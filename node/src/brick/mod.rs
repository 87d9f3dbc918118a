//! Bricks as nodes have them: what is made of their voxels for either backend, whether an acceleration pays in them,
//! and which of them are resident.

pub(crate) mod bytes;
pub(crate) mod emptiness;
pub mod residency;
pub(crate) mod texels;
pub(crate) mod worth;

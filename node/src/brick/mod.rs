//! Bricks as nodes have them: what is made of their voxels for either backend, whether an acceleration pays in them,
//! which of them are resident, and how much memory they and loading them may have.

pub(crate) mod bytes;
pub(crate) mod emptiness;
pub mod residency;
pub mod shares;
pub(crate) mod texels;
pub(crate) mod worth;

//! How voxels are written down where they do not lie as bytes: numbers as text, blocks of VTK's XML, base64, runs.

mod base64;
mod blocks;
mod runs;
mod text;

pub(crate) use blocks::{Blocks, Compressor};
pub(crate) use runs::Runs;
pub(crate) use text::Numbers;

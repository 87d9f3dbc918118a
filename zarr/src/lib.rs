//! Other people's OME-Zarr as input volumes: 0.1 to 0.4 over Zarr v2, 0.5 over v3, wherever their objects lie.
//!
//! The invariant: *what is read is what the metadata says lies there, voxel by voxel, or an error that names the file;
//! and neither metadata nor chunks, whatever is in them, cost more memory than [`MAX_CHUNK_BYTES`] and the bounds
//! of [`OmeZarrSource`]*. A chunk that is not there holds the array's fill value, as Zarr says.

mod array;
mod axes;
mod blosc;
mod blosclz;
mod chunks;
mod codec;
mod cut;
mod error;
mod image;
mod json;
mod node;
mod shards;
mod source;
mod space;
mod time_axis;
mod view;

use std::sync::Arc;

use brickcast_volume::format::{FormatError, RawHints, VolumeSource};
use brickcast_volume::store::Objects;

use error::failed;
pub use error::{ChunkFault, MAX_CHUNK_BYTES, OmeZarrError};
pub use source::OmeZarrSource;
pub use time_axis::TimeAxis;
pub use view::whole;

/// True where something of Zarr lies at the root of `objects`.
///
/// # Errors
/// The place cannot be read.
pub fn is_zarr(objects: &dyn Objects) -> Result<bool, FormatError> {
    node::is_there(objects, "").map_err(|reason| failed(objects, reason))
}

/// Opens the image, or the single array, at the root of `objects`. `hints` say which channel and time of several.
///
/// # Errors
/// No Zarr; several images; an array that no volume can be; metadata that say what cannot be.
pub fn open(objects: Arc<dyn Objects>, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    match source::open(objects.clone(), hints) {
        Ok(source) => Ok(Box::new(source)),
        Err(reason) => Err(failed(objects.as_ref(), reason)),
    }
}

/// The axis of time of the image at the root of `objects`; nothing where it has none.
///
/// # Errors
/// As [`open`], as far as metadata go.
pub fn times(objects: &dyn Objects) -> Result<Option<TimeAxis>, FormatError> {
    space::times(objects).map_err(|reason| failed(objects, reason))
}

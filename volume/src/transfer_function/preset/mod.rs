//! Files of transfer functions: ParaView's colour-map presets, a list of presets or one bare preset, as JSON or in the
//! older XML; and 3D Slicer's volume properties.

mod categorical;
mod curves;
mod entry;
mod error;
mod fields;
mod list;
mod read;
mod resample;
#[cfg(test)]
mod tests;
mod volume_property;
mod write;
mod xml;

pub use error::{MAX_BYTES, MAX_NODES, PresetError, PresetErrorKind};
pub use list::PresetList;
pub use read::{Preset, PresetOptions};

//! Transfer functions: piecewise linear colour and opacity over the volume's own data units.

pub(crate) mod codes;
pub mod color_space;
pub mod colormap;
mod colormap_tables;
pub mod detail;
pub(crate) mod empty;
pub mod extremes;
mod function;
pub mod materials;
pub mod of_projection;
pub mod preset;
pub mod suggest;
pub mod table;
pub mod window;

pub use colormap::Colormap;
pub use extremes::{Shown, TableExtremes};
pub use function::{ColorPoint, MAX_POINTS, MAX_X, OpacityPoint, TransferFunction, TransferFunctionError};
pub use preset::{Preset, PresetError, PresetErrorKind, PresetList, PresetOptions};
pub use table::TransferTable;
pub use window::{default_opacities, describe_default, describe_default_opacities};

//! Pictures to files: PNG, animated PNG, OpenEXR, GIF, films, and the manifest beside them.
//!
//! Every file is finished or absent: it is written under a temporary name in its own folder and renamed when complete.

pub mod animation;
mod atomic;
mod cutter;
mod error;
pub mod exr;
mod film;
mod format;
mod gif;
mod hatch;
pub mod likeness;
mod limits;
pub mod manifest;
pub mod picture_manifest;
mod place;
pub mod png;
mod reel;
mod writer;

pub use error::OutputError;
pub use format::OutputFormat;
pub use hatch::{hatched, striped};
pub use likeness::{Difference, DrawnFile};
pub use limits::MAX_FRAMES;
pub use manifest::{write_json, write_manifest, write_text};
pub use picture_manifest::{AboutPicture, ManifestError, PictureManifest, animation_manifest, read_manifest};
pub use writer::{FrameOptions, FrameWriter, Keeper, Kept};

//! The data model: space, bricks, the merge tree, transfer functions, file formats and the brick store.
//!
//! No GPU, no network, no async. Everything here has validated values inside and parses at the door.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they have written"))]

pub mod brick;
pub mod camera;
pub mod camera_file;
pub mod chord;
pub mod deep_regions;
mod filter;
pub mod format;
pub mod ids;
pub mod json_fields;
pub mod leftovers;
pub mod lod;
pub mod look_on;
pub mod macrocell;
pub mod memory;
pub mod merge;
pub mod per_chunk;
pub mod phantom;
pub mod pixel;
pub mod preintegration;
pub mod premul;
pub mod regions;
pub mod scene;
pub mod shown;
pub mod small_file;
pub mod space;
pub mod store;
pub mod style;
pub mod transfer_function;
pub mod unfinished;
mod up;
pub mod visibility;
mod words;

pub use brick::{BrickGrid, OwnedBox, StoredBox};
pub use camera::{Camera, Orbit, Projection};
pub use ids::{BrickId, BrickIndex, ChunkId, ChunkIndex, Epoch, FrameId, SessionId, StoreHash, TreeNode};
pub use merge::MergeTree;
pub use per_chunk::PerChunk;
pub use pixel::{PixelKind, Pixels, RawPixel};
pub use premul::{Premul, over};
pub use space::Geometry;
pub use up::Up;
pub use visibility::{PictureSize, PixelRect, View};
pub use words::nearest;

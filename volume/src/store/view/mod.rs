//! Views: stores whose finest voxels stay in somebody else's array (`docs/adr/0021-other-peoples-ome-zarr.md`).
//!
//! The invariant: *a view is a store: the same manifest, hashes and bits as [`prepare`](crate::store::prepare()) of the
//! same voxels gives*. Of a shard of its finest voxels it keeps the end alone, under the shard's key; what lies before
//! it is made of the array when it is asked for, and is what the end's checksums say, or an error that names the chunk.

mod cut;
mod file;
mod form;
mod objects;
mod shard;

pub use file::{ViewFile, ViewInput};
pub use objects::{FinestVoxels, ViewObjects};

pub(super) use cut::cut_to_ends;
pub(super) use file::written;

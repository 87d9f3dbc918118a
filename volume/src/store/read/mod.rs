//! Reading a store: bricks, planes, and all of it to find damage.

pub(super) mod cache;
pub(super) mod inspect;
pub(super) mod planes;
mod regions;
pub(super) mod source;
pub(super) mod store;
mod verify;
pub(super) mod voxels;
pub(super) mod window;
mod with_halo;

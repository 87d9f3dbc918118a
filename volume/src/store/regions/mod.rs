//! The regions of a store: found, written, and opened again.

mod descent;
pub(super) mod error;
mod facts_build;
pub(super) mod facts_table;
mod label_levels;
mod label_place;
pub(super) mod label_planes;
mod near;
pub(super) mod open;
mod scratch;
pub(super) mod segment;
pub(super) mod write;

//! From an input volume to a store.

mod coarser;
mod complete;
mod describe;
pub(super) mod disk;
pub(super) mod fill;
mod finish;
pub(super) mod histogram;
pub(super) mod job;
mod memory;
pub(super) mod missing;
mod noise;
pub(super) mod options;
pub(super) mod parts;
mod pass;
pub(super) mod quantise;
pub(super) mod spool;
mod statistics;
pub(super) mod step_map;
mod tables;
mod told;

//! From an input volume to a store.

mod fill;
mod histogram;
pub(super) mod job;
mod memory;
mod missing;
mod noise;
pub(super) mod options;
mod pass;
mod quantise;
mod spool;
mod statistics;
mod told;

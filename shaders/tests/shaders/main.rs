//! What stands in Rust and in WGSL, which kernel a brick takes, and what leaps may change.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod constants;
mod intervals;
mod keys;
mod layout;
mod leaping;
mod modules;

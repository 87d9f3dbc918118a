//! The node from outside: its kernels, and `brickcast-node` as a process.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod daemon;
mod raycaster_kernels;

//! The node from outside: its kernels, and `brickcast-node` as a process.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

// Its `#[test]` in place of the compiler's: a test may find out that it can try nothing here.
#[macro_use]
extern crate brickcast_harness;

mod daemon;
#[cfg(target_os = "linux")]
mod ignored;
mod raycaster_kernels;

fn main() -> std::process::ExitCode {
    brickcast_harness::main()
}

//! Nodes that are far, slow, busy, lost, or throttled: what a session makes of them.
//!
//! Most tests here measure time or processor time, so each file has its turn ([`brickcast_tests::turn`]).

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

// Its `#[test]` in place of the compiler's: a test may find out that it can try nothing here.
#[macro_use]
extern crate brickcast_harness;

mod alone;
mod balance;
mod buckets;
#[cfg(target_os = "linux")]
mod budget;
#[cfg(target_os = "linux")]
mod cancels;
#[cfg(target_os = "linux")]
mod deaf;
mod decoding;
mod far;
mod faults;
mod flips;
mod levels;
mod processes;
mod shared;
mod simulated;
mod simulated_network;
mod soak;
#[cfg(target_os = "linux")]
mod stage;
mod starting;
mod throttle;

fn main() -> std::process::ExitCode {
    brickcast_harness::main_of_threads(4)
}

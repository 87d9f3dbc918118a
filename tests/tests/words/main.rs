//! The command line: its words, its settings, its files, and other people's programs beside it.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

// Its `#[test]` in place of the compiler's: a test may find out that it can try nothing here.
#[macro_use]
extern crate brickcast_harness;

mod auto;
mod cache;
mod cache_command;
mod cli;
#[cfg(unix)]
mod compose;
mod config;
mod convert;
mod default_look;
mod field;
mod films;
mod formats;
mod hidden;
#[cfg(target_os = "linux")]
mod interrupts;
#[cfg(target_os = "linux")]
mod kept;
mod levels;
mod ome_zarr;
mod ome_zarr_views;
#[cfg(target_os = "linux")]
mod parts;
#[cfg(target_os = "linux")]
mod phantom;
mod prepare_far;
#[cfg(unix)]
mod project;
mod quality;
#[cfg(target_os = "linux")]
mod readme;
mod real_volumes;
mod scene_file;
mod store_care;
mod store_interop;
mod talk;
mod time;
mod transfer_function;
mod unreadable;
mod values;
mod whole;

fn main() -> std::process::ExitCode {
    brickcast_harness::main()
}

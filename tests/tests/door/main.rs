//! What comes from outside: files that are not what they should be, clients that may not or that are too many.
//!
//! Floods measure how others are served meanwhile, so each file has its turn ([`brickcast_tests::turn`]).

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

#[cfg(target_os = "linux")]
mod files;
#[cfg(target_os = "linux")]
mod floods;
#[cfg(target_os = "linux")]
mod floods_in_sum;
mod inputs;
#[cfg(unix)]
mod security;
#[cfg(unix)]
mod site;
#[cfg(unix)]
mod telling;

//! The compositor: an engine (a session with its cluster, frames, plan and balance) and, in [`cli`], a command line.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they have written"))]

pub mod balance;
mod cache;
pub mod cli;
pub mod cluster;
pub mod embedded;
pub mod frame;
pub mod output;
pub mod picture;
pub mod plan;
pub mod session;
mod stored;
mod words;

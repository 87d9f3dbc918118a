//! The compositor: plan, order, over, ledger, outputs and the command line.

pub mod accel_args;
pub mod audit;
pub mod blend;
pub mod cli;
mod cli_values;
mod cluster;
mod collect;
pub mod command;
pub mod dial;
pub mod discovery;
pub mod embedded;
pub mod failure;
mod follow;
mod frame;
pub mod ledger;
pub mod output;
pub mod plan;
pub mod progress;
pub mod region_args;
pub mod scene_args;
pub mod service;
pub mod session;
mod session_error;
pub mod source;
pub mod stats;
mod worker;

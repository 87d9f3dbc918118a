//! The compositor: plan, order, over, ledger, outputs and the command line.

pub mod accel_args;
pub mod audit;
pub mod blend;
pub mod cli;
mod cli_values;
pub mod command;
pub mod embedded;
pub mod failure;
pub mod ledger;
pub mod output;
pub mod plan;
pub mod progress;
pub mod region_args;
pub mod scene_args;
pub mod service;
pub mod session;
pub mod source;
pub mod stats;

//! The command line: flags, environment and files become scenes, sessions and pictures. Nothing outside this folder
//! knows of flags.

pub mod args;
pub mod command;
pub mod config_file;
pub mod failure;
pub mod input;
pub mod interrupts;
pub mod invocation;
mod meant;
pub mod progress;
mod quality;
pub(crate) mod say;
pub mod scene;
pub mod source;

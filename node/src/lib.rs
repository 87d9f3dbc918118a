//! The render node: adapter, brick residency, rendering and the tonic service.

pub mod admission;
pub mod arrival;
pub mod client;
pub mod config;
pub mod connections;
pub mod cpu;
pub mod door;
pub mod drivers;
mod emptiness;
pub mod error;
pub mod gpu;
pub mod held;
pub mod kernel_style;
mod lanes;
pub mod meter;
pub mod node;
pub mod pace;
pub mod probe;
pub mod quota;
pub mod raycaster;
pub mod recipe;
pub mod refusals;
pub mod render;
pub mod residency;
pub mod server;
mod service;
pub mod stores;
#[cfg(test)]
mod testing;
mod texels;
pub mod watch;
mod worth;

pub use config::{DataRoot, NodeConfig};
pub use error::NodeError;
pub use node::Node;
pub use server::{serve, serve_admitted, serve_incoming};

//! The render node: adapter, brick residency, rendering and the tonic service.

pub mod backend;
pub mod brick;
pub mod clients;
pub mod config;
pub mod cpu;
pub mod error;
pub mod gpu;
mod interval;
pub mod kernel;
pub mod node;
pub mod render;
pub mod serve;
pub mod stores;
#[cfg(test)]
mod testing;
pub mod version;

pub use config::{DataRoot, NodeConfig};
pub use error::NodeError;
pub use node::Node;
pub use serve::{serve, serve_admitted, serve_incoming};

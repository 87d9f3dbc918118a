//! A node on the network: who is let in, how requests arrive, and the services behind the door.

pub mod admission;
pub mod arrival;
pub mod connections;
mod door;
mod handshakes;
mod peer;
pub mod probe;
mod refusals;
mod server;
mod service;
mod writes;

pub use server::{DRAIN_TIMEOUT, ServeError, serve, serve_admitted, serve_incoming};

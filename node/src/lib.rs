//! The render node: adapter, brick residency, rendering and the tonic service.

pub mod cpu;
pub mod gpu;
pub mod raycaster;

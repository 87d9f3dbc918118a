//! The render node: adapter, brick residency, rendering and the tonic service.

pub mod raycaster;

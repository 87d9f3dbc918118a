//! The kernels on the CPU: plain, in their WGSL's order of operations.

pub mod accelerated;
mod holes;
pub mod integral;
mod lanes;
mod light;
pub mod macrocell;
mod processor;
pub mod raycast;
pub mod slab;
pub mod slabs;
mod surface;
#[cfg(test)]
mod surface_tests;

//! The kernels on the CPU: scalar, in their WGSL's files, names and order of operations.

pub mod bindings;
mod classify;
pub mod holes;
mod jump;
mod lanes;
mod light;
pub mod macrocell;
pub mod march;
pub mod part;
mod processor;
pub mod ray;
pub mod read;
pub mod run;
pub mod scene;
mod slab;
pub mod slabs;
pub mod surface;
#[cfg(test)]
mod surface_tests;
pub mod take;
pub mod walk;

/// What it was called while there was a loop for plain bricks.
pub use self::ray as raycast;

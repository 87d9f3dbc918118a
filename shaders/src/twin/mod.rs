//! The kernels on the CPU: scalar, in their WGSL's files, names and order of operations.

pub mod bindings;
pub(crate) mod classify;
pub mod holes;
pub(crate) mod jump;
pub(crate) mod light;
pub mod macrocell;
pub mod march;
pub mod part;
pub(crate) mod positions;
pub mod power;
pub mod ray;
pub mod read;
pub mod run;
pub mod scene;
mod slab;
pub mod surface;
#[cfg(test)]
mod surface_tests;
pub mod take;
pub mod walk;

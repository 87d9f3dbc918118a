//! `wgsl/take/` on the CPU: what a run of positions adds to a pixel.

mod projection;
mod sampled;
mod slabs;

pub use super::part::Take;
pub use projection::Projection;
pub use sampled::Sampled;
pub use slabs::Slabs;

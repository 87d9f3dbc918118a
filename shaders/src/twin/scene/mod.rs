//! `wgsl/scene/` on the CPU: which part of a ray there is, and where its positions lie.

mod plain;
pub(crate) mod styled;

pub use super::part::Scene;
pub use plain::Plain;
pub use styled::{LEAST_CUT, Styled};

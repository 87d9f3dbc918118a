//! `wgsl/scene/` on the CPU: what of a ray there is, and where its positions lie.

pub(super) mod plain;
pub(super) mod styled;

use super::bindings::{Along, Bindings};
use super::ray::{Ray, Segment};

pub use plain::Plain;
pub use styled::{LEAST_CUT, Styled};

/// With or without a style.
pub trait Scene {
    /// What clips leave of what the brick owns; nothing where `k * step >= t_out`.
    fn clipped(bound: &Bindings<'_>, ray: &Ray, owned: Segment) -> Segment;

    /// The place at `k` steps, which need not be whole; index space.
    fn place_at(along: &Along<'_>, k: f32) -> [f32; 3];
}

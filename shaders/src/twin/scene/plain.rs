//! `wgsl/scene/plain.wgsl` on the CPU: a scene without clips, whose rays visit no position but those that bricks own.

use super::super::bindings::{Along, Bindings};
use super::super::part::Scene;
use super::super::ray::{Ray, Segment};

#[derive(Debug)]
pub struct Plain;

impl Scene for Plain {
    #[inline(always)]
    fn clipped(_: &Bindings<'_>, _: &Ray, owned: Segment) -> Segment {
        owned
    }

    #[inline(always)]
    fn place_at(along: &Along<'_>, k: f32) -> [f32; 3] {
        let t = k * along.frame().step;
        std::array::from_fn(|a| along.ray.origin[a] + t * along.ray.direction[a])
    }
}

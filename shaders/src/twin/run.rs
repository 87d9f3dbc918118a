//! `wgsl/shared/run.wgsl` on the CPU: what passes between walk and take.

use super::jump::leaves;
use super::ray::{Ray, rounded_up};
use crate::layout::FrameUniform;

/// What a walk knows of a position before it is read.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Step {
    /// Of the position (0..=1), where that is known.
    pub code: f32,
    pub is_known: bool,
    /// All positions up to the ray's exit from the cube about `center` are like this one.
    pub jumps: bool,
    /// Index space.
    pub center: [f32; 3],
    /// Of the cube's edge, voxels.
    pub half: f32,
    /// The map says so: nothing is read.
    pub is_by_map: bool,
    /// Nothing is taken here ...
    pub is_skip: bool,
    /// ... and the next position is the one before.
    pub is_back: bool,
    /// Deep in a region, as the texel says.
    pub is_deep: bool,
    /// Deep in a region or in a cube of one value: no gradient.
    pub is_flat: bool,
}

/// The first position behind the cube.
#[inline(always)]
pub(crate) fn exit_of(frame: &FrameUniform, ray: &Ray, step: &Step) -> f32 {
    rounded_up(leaves(ray, step.center, step.half) / frame.step)
}

/// Positions `k .. k + n` of one code: a sample, a leap, or a cube of one value. A sample is one step long (n = 1), or
/// shorter where levels meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    pub k: f32,
    pub n: f32,
    /// From the first of them to the last.
    pub within: f32,
    /// Those of them that the brick owns.
    pub owns: f32,
    /// 0..=1.
    pub code: f32,
    pub in_region: bool,
    /// Nothing in it has a gradient.
    pub is_flat: bool,
    /// The position before it was taken: a slab lies between.
    pub follows: bool,
}

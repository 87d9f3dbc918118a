//! `wgsl/shared/ray.wgsl` on the CPU: rays, and the samples of a ray that a brick owns.

use crate::layout::{BrickUniform, FrameUniform};

/// Slower than this per unit of t, a ray moves by less than 3e-7 voxel over the longest reach: it runs inside the
/// plane.
pub const PARALLEL_TO_PLANE: f32 = 1e-12;
/// Where no plane ends a ray; t.
pub const FAR: f32 = 3e38;

/// Index space; t in units of the smallest spacing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    pub origin: [f32; 3],
    /// Index space per unit of t; components parallel to a plane are exactly zero.
    pub direction: [f32; 3],
    /// 1 / direction, zero where direction is zero.
    pub inverse: [f32; 3],
}

/// The samples of a ray that a brick owns: k, k + 1, ... while `k * step < t_out`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// An integer, exact in f32 up to 2^24.
    pub k: f32,
    pub t_out: f32,
}

/// The ray through the centre of pixel (x, y) of the picture.
#[must_use]
pub fn pixel_ray(frame: &FrameUniform, x: u32, y: u32) -> Ray {
    let u = (2 * x as i32 + 1 - frame.width) as f32 * frame.inverse_width;
    let v = (frame.height - 1 - 2 * y as i32) as f32 * frame.inverse_height;
    let q: [f32; 3] = std::array::from_fn(|a| frame.ray_right[a] * u + frame.ray_up[a] * v);
    let mut direction = frame.ray_forward;
    let mut aside = q;
    if frame.parallel == 0 {
        direction = std::array::from_fn(|a| direction[a] + q[a]);
        let far = dot(direction, direction).sqrt();
        let scale = 1.0 / far;
        // Without cancellation: scale - 1 = -q.q scale / (1 + far).
        let back = dot(q, q) * scale / (1.0 + far);
        aside = std::array::from_fn(|a| q[a] * scale - frame.ray_forward[a] * back);
        direction = direction.map(|d| d * scale);
    }
    let origin = std::array::from_fn(|a| frame.eye[a] + aside[a] * frame.fan[a]);
    direction = std::array::from_fn(|a| direction[a] * frame.voxels_per_unit[a]);
    direction = direction.map(|d| if d.abs() < PARALLEL_TO_PLANE { 0.0 } else { d });
    let inverse = direction.map(|d| if d == 0.0 { 0.0 } else { 1.0 / d });
    Ray { origin, direction, inverse }
}

pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The first sample at or behind `t`, exactly.
#[inline(always)]
pub(crate) fn first_sample(step: f32, t: f32) -> f32 {
    // The quotient errs by a few units in the last place, the product decides.
    let mut k = rounded_up(t / step);
    for _ in 0..4 {
        if k > 0.0 && (k - 1.0) * step >= t {
            k -= 1.0;
        }
    }
    for _ in 0..4 {
        if k * step < t {
            k += 1.0;
        }
    }
    k
}

/// As `f32::ceil` but for the sign of zero; that is a call on processors of the oldest kind.
#[inline(always)]
pub(super) fn rounded_up(x: f32) -> f32 {
    // Larger ones are whole; NaN stays itself.
    if x.abs().partial_cmp(&1e9).is_none_or(|order| order.is_gt()) {
        return x;
    }
    let whole = (x as i32) as f32;
    if whole < x { whole + 1.0 } else { whole }
}

/// The samples of `ray`, `step` apart, in the brick's owned box (docs/definition.md, Sampling grid); `None` where there
/// are none.
#[must_use]
#[inline]
pub fn owned_segment(step: f32, brick: &BrickUniform, ray: &Ray) -> Option<Segment> {
    let (mut t_in, mut t_out) = (0.0_f32, FAR);
    for a in 0..3 {
        let (lo, hi) = (brick.owned_lo[a] as f32, brick.owned_hi[a] as f32);
        let origin = ray.origin[a];
        if ray.direction[a] == 0.0 {
            if origin < lo || origin >= hi {
                return None;
            }
            continue;
        }
        let at_lo = (lo - origin) * ray.inverse[a];
        let at_hi = (hi - origin) * ray.inverse[a];
        t_in = t_in.max(at_lo.min(at_hi));
        t_out = t_out.min(at_lo.max(at_hi));
    }
    if t_in >= t_out {
        return None;
    }
    let k = first_sample(step, t_in);
    (k * step < t_out).then_some(Segment { k, t_out })
}

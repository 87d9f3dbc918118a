//! `wgsl/scene/styled.wgsl` on the CPU: a scene with clips, whose rays may look beyond what a brick owns, and beyond
//! the volume.

use super::super::bindings::{Along, Bindings};
use super::super::part::Scene;
use super::super::ray::{FAR, Ray, Segment, first_sample};
use crate::layout::FrameUniform;
use crate::style::StyleUniform;

#[derive(Debug)]
pub struct Styled;

impl Scene for Styled {
    #[inline(always)]
    fn clipped(bound: &Bindings<'_>, ray: &Ray, owned: Segment) -> Segment {
        let (t_lo, t_hi) = clip_span(bound.scene.style, ray);
        let mut left = Segment { k: owned.k, t_out: owned.t_out.min(t_hi) };
        if t_lo > 0.0 {
            left.k = left.k.max(first_sample(bound.scene.frame.step, t_lo));
        }
        left
    }

    #[inline(always)]
    fn place_at(along: &Along<'_>, k: f32) -> [f32; 3] {
        place_at(along, k)
    }
}

/// The place at `k` steps, which need not be whole; index space, clamped to the volume.
#[inline(always)]
pub(crate) fn place_at(along: &Along<'_>, k: f32) -> [f32; 3] {
    let t = k * along.frame().step;
    inside(along.style(), std::array::from_fn(|a| along.ray.origin[a] + t * along.ray.direction[a]))
}

/// Clamped to the volume.
#[inline(always)]
pub(crate) fn inside(style: &StyleUniform, p: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|a| p[a].max(0.0).min(style.volume_hi[a] as f32))
}

/// What clips leave of a ray: `[t_lo, t_hi)`.
#[inline(always)]
pub(crate) fn clip_span(style: &StyleUniform, ray: &Ray) -> (f32, f32) {
    let (mut t_lo, mut t_hi) = (0.0_f32, FAR);
    for [nx, ny, nz, w] in &style.planes[..style.plane_count as usize] {
        let inside = nx * ray.origin[0] + ny * ray.origin[1] + nz * ray.origin[2] - w;
        let along = nx * ray.direction[0] + ny * ray.direction[1] + nz * ray.direction[2];
        if along == 0.0 {
            if inside < 0.0 {
                return (FAR, -1.0);
            }
            continue;
        }
        let t = -inside / along;
        if along > 0.0 {
            t_lo = t_lo.max(t);
        } else {
            t_hi = t_hi.min(t);
        }
    }
    (t_lo, t_hi)
}

/// Clips that end no deeper in the volume than this count as its own faces; in units of t.
pub const LEAST_CUT: f32 = 1e-3;

/// Where the ray enters the volume, were it endless; t.
#[inline(always)]
pub(crate) fn volume_entry(style: &StyleUniform, ray: &Ray) -> f32 {
    let mut t_in = 0.0_f32;
    for a in 0..3 {
        if ray.direction[a] != 0.0 {
            let at_lo = (0.0 - ray.origin[a]) * ray.inverse[a];
            let at_hi = (style.volume_hi[a] as f32 - ray.origin[a]) * ray.inverse[a];
            t_in = t_in.max(at_lo.min(at_hi));
        }
    }
    t_in
}

/// The first sample behind the cut by which clipping lets the ray in at `t_lo`; -1 where the volume's own face does, or
/// nothing.
#[inline(always)]
pub(crate) fn first_behind_cut(frame: &FrameUniform, style: &StyleUniform, ray: &Ray, t_lo: f32) -> f32 {
    if t_lo <= volume_entry(style, ray) + LEAST_CUT { -1.0 } else { first_sample(frame.step, t_lo) }
}

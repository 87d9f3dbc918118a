//! `wgsl/positions/` on the CPU: at which positions of a ray a brick takes something.
//!
//! Among bricks of its own level these are whole steps, and each is of the brick that owns it. Where levels meet, a
//! whole step of the coarser one may begin in the finer or end there. So what counts is the finest positions, of which
//! every one has one owner: *each stretch of them that one level owns is taken whole by that level*, in runs that begin
//! at its first position and at every whole step behind it, and end at the next run or where the stretch does. A
//! stretch may go through several bricks: a run is of the brick in which it begins, and a brick that a ray enters from
//! its own level begins at the first whole step in it, as without levels. Beyond the volume nothing is another level's.
//!
//! A finest position is a power-of-two part of a step, so that positions and their differences are exact.

use super::bindings::Bindings;
use super::jump::first_outside;
use super::part::{Scene, Take};
use super::ray::{Ray, Segment, owned_segment, rounded_up};

/// Which positions of a ray a brick visits: from `start` to below `k_end`; it owns those below `k_out`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Positions {
    pub(crate) start: f32,
    pub(crate) k_out: f32,
    pub(crate) k_end: f32,
    borders: bool,
}

impl Positions {
    /// `None` where there are none.
    #[inline(always)]
    pub(crate) fn new<T: Take>(bound: &Bindings<'_>, ray: &Ray) -> Option<Self> {
        let (step, borders) = (bound.scene.frame.step, bound.key.borders);
        let segment = if borders { segment(bound, ray) } else { owned_segment(step, bound.brick, ray) };
        let owned = T::Scene::clipped(bound, ray, segment?);
        if owned.k * step >= owned.t_out {
            return None;
        }
        let k_out = if borders { end_of(bound, ray, owned) } else { first_outside(step, owned.k, owned.t_out) };
        // The one at which the last slab ends, too.
        let k_end = if T::ends_beyond(bound) { k_out + 1.0 } else { k_out };
        Some(Self { start: owned.k, k_out, k_end, borders })
    }

    /// The position behind `k`.
    #[inline(always)]
    pub(crate) fn behind(&self, k: f32) -> f32 {
        match self.borders {
            false => k + 1.0,
            true if k < self.k_out => (whole_of(k) + 1.0).min(self.k_out),
            true => self.k_out + 1.0,
        }
    }

    /// The position before `k`.
    #[inline(always)]
    pub(crate) fn before(&self, k: f32) -> f32 {
        match self.borders {
            false => k - 1.0,
            true if k > self.k_out => self.k_out,
            true => (rounded_up(k) - 1.0).max(self.start),
        }
    }

    /// The position at which a jump from `k` ends that may go to the whole position `x`.
    #[inline(always)]
    pub(crate) fn ends_at(&self, k: f32, x: f32) -> f32 {
        match self.borders {
            false => x.min(self.k_end).max(k + 1.0),
            true if x > self.k_out => self.k_end.max(self.behind(k)),
            true => x.max(self.behind(k)),
        }
    }
}

/// The whole part of what is not below 0.
#[inline(always)]
fn whole_of(k: f32) -> f32 {
    (k as i32) as f32
}

/// Is another level drawn where the ray is at `t`, in or around the brick?
#[inline(always)]
fn is_elsewhere(bound: &Bindings<'_>, ray: &Ray, t: f32) -> bool {
    let brick = bound.brick;
    let mut side = 13;
    for (a, stride) in [1, 3, 9].into_iter().enumerate() {
        let d = ray.direction[a];
        if d == 0.0 {
            continue;
        }
        let at_lo = (brick.owned_lo[a] as f32 - ray.origin[a]) * ray.inverse[a];
        let at_hi = (brick.owned_hi[a] as f32 - ray.origin[a]) * ray.inverse[a];
        let forward = if d > 0.0 { stride } else { -stride };
        if t < at_lo.min(at_hi) {
            side -= forward;
        } else if t >= at_lo.max(at_hi) {
            side += forward;
        }
    }
    brick.borders >> side & 1 == 1
}

/// From the first position at which the brick takes something.
#[inline(always)]
fn segment(bound: &Bindings<'_>, ray: &Ray) -> Option<Segment> {
    let frame = bound.scene.frame;
    let fine = owned_segment(frame.step * frame.finest, bound.brick, ray)?;
    let k = fine.k * frame.finest;
    let comes = (fine.k - 1.0) * frame.finest * frame.step;
    let opens = fine.k > 0.0 && is_elsewhere(bound, ray, comes);
    Some(Segment { k: if opens { k } else { rounded_up(k) }, t_out: fine.t_out })
}

/// Where the last run of what the brick owns ends.
#[inline(always)]
fn end_of(bound: &Bindings<'_>, ray: &Ray, owned: Segment) -> f32 {
    let frame = bound.scene.frame;
    let mut k_out = first_outside(frame.step * frame.finest, owned.k / frame.finest, owned.t_out) * frame.finest;
    let whole = rounded_up(k_out);
    while k_out < whole && !is_elsewhere(bound, ray, k_out * frame.step) {
        k_out += frame.finest;
    }
    k_out
}

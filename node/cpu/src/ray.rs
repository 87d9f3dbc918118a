//! Rays side by side: through pixels, and which of their samples a brick owns. The same as the twin's, lane by lane
//! (`shaders/src/twin/ray.rs`, `jump.rs`, `scene/`).

use brickcast_shaders::layout::{BrickUniform, FrameUniform};
use brickcast_shaders::style::StyleUniform;
use brickcast_shaders::twin::ray::{FAR, PARALLEL_TO_PLANE};

use super::lanes::{Floats, Ints, Lanes, Mask};

/// Three lanes' worth of coordinates.
pub(crate) type Place<L> = [<L as Lanes>::F; 3];

/// As [`brickcast_shaders::twin::ray::Ray`], a ray in each lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rays<L: Lanes> {
    pub(crate) origin: Place<L>,
    pub(crate) direction: Place<L>,
    pub(crate) inverse: Place<L>,
}

/// The samples that a brick owns: `k` and on, below `t_out`, where `is_some`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segments<L: Lanes> {
    pub(crate) k: L::F,
    pub(crate) t_out: L::F,
    pub(crate) is_some: L::M,
}

#[inline(always)]
pub(crate) fn splat3<L: Lanes>(l: L, [x, y, z]: [f32; 3]) -> Place<L> {
    [l.splat(x), l.splat(y), l.splat(z)]
}

#[inline(always)]
pub(crate) fn dot<L: Lanes>([ax, ay, az]: Place<L>, [bx, by, bz]: Place<L>) -> L::F {
    ax * bx + ay * by + az * bz
}

/// `a + (b - a) t`: equal ends stay unchanged.
#[inline(always)]
pub(crate) fn between<F: Floats>(a: F, b: F, t: F) -> F {
    a + (b - a) * t
}

/// Into 0..=last.
#[inline(always)]
pub(crate) fn clamped<L: Lanes>(l: L, x: L::F, last: L::F) -> L::F {
    x.larger(l.splat(0.0)).smaller(last)
}

impl<L: Lanes> Rays<L> {
    /// Through the centres of pixels.
    #[inline(always)]
    pub(crate) fn of_pixels(l: L, frame: &FrameUniform, x: L::I, y: L::I) -> Self {
        let (one, two) = (l.splat_int(1), l.splat_int(2));
        let u = (two * x + one - l.splat_int(frame.width)).floats() * l.splat(frame.inverse_width);
        let v = (l.splat_int(frame.height - 1) - two * y).floats() * l.splat(frame.inverse_height);
        let (right, up, forward) = (splat3(l, frame.ray_right), splat3(l, frame.ray_up), splat3(l, frame.ray_forward));
        let q = [right[0] * u + up[0] * v, right[1] * u + up[1] * v, right[2] * u + up[2] * v];
        let (mut aside, mut direction) = (q, forward);
        if frame.parallel == 0 {
            let one = l.splat(1.0);
            direction = [forward[0] + q[0], forward[1] + q[1], forward[2] + q[2]];
            let far = dot::<L>(direction, direction).sqrt();
            let scale = one / far;
            // Without cancellation: scale - 1 = -q.q scale / (1 + far).
            let back = dot::<L>(q, q) * scale / (one + far);
            aside =
                [q[0] * scale - forward[0] * back, q[1] * scale - forward[1] * back, q[2] * scale - forward[2] * back];
            direction = [direction[0] * scale, direction[1] * scale, direction[2] * scale];
        }
        let (zero, one) = (l.splat(0.0), l.splat(1.0));
        let mut rays = Self { origin: aside, direction, inverse: direction };
        for a in 0..3 {
            let d = direction[a] * l.splat(frame.voxels_per_unit[a]);
            let d = L::F::select(d.abs().lt(l.splat(PARALLEL_TO_PLANE)), zero, d);
            rays.origin[a] = l.splat(frame.eye[a]) + aside[a] * l.splat(frame.fan[a]);
            rays.direction[a] = d;
            rays.inverse[a] = L::F::select(d.same(zero), zero, one / d);
        }
        rays
    }

    /// The samples in the brick's owned box, `step` apart, of the `wanted` rays; `None` where none of them has any, as
    /// for most rays of a tile in most bricks.
    #[inline(always)]
    pub(crate) fn owned(&self, l: L, step: f32, brick: &BrickUniform, wanted: L::M) -> Option<Segments<L>> {
        let zero = l.splat(0.0);
        let (mut t_in, mut t_out, mut is_out) = (zero, l.splat(FAR), zero.lt(zero));
        for a in 0..3 {
            let (lo, hi) = (l.splat(brick.owned_lo[a] as f32), l.splat(brick.owned_hi[a] as f32));
            let (origin, is_flat) = (self.origin[a], self.direction[a].same(zero));
            is_out = is_out | (is_flat & (origin.lt(lo) | hi.le(origin)));
            let (at_lo, at_hi) = ((lo - origin) * self.inverse[a], (hi - origin) * self.inverse[a]);
            t_in = L::F::select(is_flat, t_in, at_lo.smaller(at_hi).larger(t_in));
            t_out = L::F::select(is_flat, t_out, at_lo.larger(at_hi).smaller(t_out));
        }
        let meets = wanted & !is_out & t_in.lt(t_out);
        if !meets.any() {
            return None;
        }
        let k = first_sample(l, step, t_in);
        let is_some = meets & (k * l.splat(step)).lt(t_out);
        is_some.any().then_some(Segments { k, t_out, is_some })
    }

    /// What clipping leaves of rays: `[t_lo, t_hi)`.
    #[inline(always)]
    pub(crate) fn clipped(&self, l: L, style: &StyleUniform) -> (L::F, L::F) {
        let zero = l.splat(0.0);
        let (mut t_lo, mut t_hi, mut is_out) = (zero, l.splat(FAR), zero.lt(zero));
        for &[nx, ny, nz, w] in &style.planes[..style.plane_count as usize] {
            let (normal, w) = (splat3(l, [nx, ny, nz]), l.splat(w));
            let inside = dot::<L>(normal, self.origin) - w;
            let along = dot::<L>(normal, self.direction);
            is_out = is_out | (along.same(zero) & inside.lt(zero));
            let t = -inside / along;
            t_lo = L::F::select(zero.lt(along), t.larger(t_lo), t_lo);
            t_hi = L::F::select(along.lt(zero), t.smaller(t_hi), t_hi);
        }
        (L::F::select(is_out, l.splat(FAR), t_lo), L::F::select(is_out, l.splat(-1.0), t_hi))
    }

    /// Where rays enter the volume, were they endless; t.
    #[inline(always)]
    pub(crate) fn volume_entry(&self, l: L, style: &StyleUniform) -> L::F {
        let zero = l.splat(0.0);
        let mut t_in = zero;
        for a in 0..3 {
            let at_lo = (zero - self.origin[a]) * self.inverse[a];
            let at_hi = (l.splat(style.volume_hi[a] as f32) - self.origin[a]) * self.inverse[a];
            t_in = L::F::select(self.direction[a].same(zero), t_in, at_lo.smaller(at_hi).larger(t_in));
        }
        t_in
    }

    /// The first samples behind cubes about `center`, but for rounding.
    #[inline(always)]
    pub(crate) fn exit_of(&self, l: L, frame: &FrameUniform, center: Place<L>, half: L::F) -> L::F {
        let zero = l.splat(0.0);
        let mut t_out = l.splat(FAR);
        for a in 0..3 {
            let direction = self.direction[a];
            let plane = L::F::select(zero.lt(direction), center[a] + half, center[a] - half);
            let t = (plane - self.origin[a]) * self.inverse[a];
            t_out = L::F::select(direction.same(zero), t_out, t.smaller(t_out));
        }
        rounded_up(l, t_out / l.splat(frame.step))
    }
}

/// As `f32::ceil` but for the sign of zero.
#[inline(always)]
pub(crate) fn rounded_up<L: Lanes>(l: L, x: L::F) -> L::F {
    let whole = x.cut_off().floats();
    let up = L::F::select(whole.lt(x), whole + l.splat(1.0), whole);
    // Larger ones are whole.
    L::F::select(x.abs().le(l.splat(1e9)), up, x)
}

/// The first sample at or behind `t`, exactly.
#[inline(always)]
pub(crate) fn first_sample<L: Lanes>(l: L, step: f32, t: L::F) -> L::F {
    let (zero, one, step) = (l.splat(0.0), l.splat(1.0), l.splat(step));
    // The quotient errs by a few units in the last place, the product decides.
    let mut k = rounded_up(l, t / step);
    for _ in 0..4 {
        let is_late = zero.lt(k) & t.le((k - one) * step);
        if !is_late.any() {
            break;
        }
        k = L::F::select(is_late, k - one, k);
    }
    for _ in 0..4 {
        let is_early = (k * step).lt(t);
        if !is_early.any() {
            break;
        }
        k = L::F::select(is_early, k + one, k);
    }
    k
}

/// The first sample that the brick does not own: the first k with `k * step >= t_out`.
#[inline(always)]
pub(crate) fn first_outside<L: Lanes>(l: L, step: f32, k: L::F, t_out: L::F) -> L::F {
    let (one, step) = (l.splat(1.0), l.splat(step));
    let next = k + one;
    let mut k_out = rounded_up(l, t_out / step).larger(next);
    for _ in 0..2 {
        let is_late = next.lt(k_out) & t_out.le((k_out - one) * step);
        k_out = L::F::select(is_late, k_out - one, k_out);
    }
    for _ in 0..2 {
        k_out = L::F::select((k_out * step).lt(t_out), k_out + one, k_out);
    }
    k_out
}

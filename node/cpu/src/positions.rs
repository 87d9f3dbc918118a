//! At which positions of rays a brick takes something: the twin's `positions.rs`, a lane each.

use brickcast_shaders::KernelKey;
use brickcast_shaders::layout::{BrickUniform, FrameUniform};
use brickcast_shaders::twin::bindings::Bindings;

use super::lanes::{Floats, Ints, Lanes, Mask};
use super::ray::{Rays, Segments, first_outside, rounded_up};
use super::read::Reader;

/// Which positions of rays a brick visits: from `start` to below `k_end`; it owns those below `k_out`.
#[derive(Clone, Copy)]
pub(crate) struct Positions<L: Lanes> {
    l: L,
    start: L::F,
    pub(crate) k_out: L::F,
    /// 0 of rays that have none.
    pub(crate) k_end: L::F,
    borders: bool,
}

impl<L: Lanes> Positions<L> {
    /// Of what the brick owns of the rays that are `alive`.
    #[inline(always)]
    pub(crate) fn new(
        l: L,
        step: f32,
        key: KernelKey,
        (owned, alive): (&Segments<L>, L::M),
        borders: Option<&Borders<'_, L>>,
    ) -> Self {
        let k_out = match borders {
            None => first_outside(l, step, owned.k, owned.t_out),
            Some(borders) => borders.end_of(owned, alive),
        };
        // The one at which the last slab ends, too.
        let k_end = if key.take.ends_beyond() { k_out + l.splat(1.0) } else { k_out };
        let k_end = L::F::select(alive, k_end, l.splat(0.0));
        Self { l, start: owned.k, k_out, k_end, borders: borders.is_some() }
    }

    /// The positions behind those at `k`.
    #[inline(always)]
    pub(crate) fn behind(&self, k: L::F) -> L::F {
        let one = self.l.splat(1.0);
        if !self.borders {
            return k + one;
        }
        let whole = k.cut_off().floats() + one;
        L::F::select(k.lt(self.k_out), whole.smaller(self.k_out), self.k_out + one)
    }

    /// The positions before those at `k`.
    #[inline(always)]
    pub(crate) fn before(&self, k: L::F) -> L::F {
        let one = self.l.splat(1.0);
        if !self.borders {
            return k - one;
        }
        let whole = rounded_up(self.l, k) - one;
        L::F::select(self.k_out.lt(k), self.k_out, whole.larger(self.start))
    }

    /// Where jumps from `k` end that may go to the whole positions `x`.
    #[inline(always)]
    pub(crate) fn ends_at(&self, k: L::F, x: L::F) -> L::F {
        if !self.borders {
            return x.smaller(self.k_end).larger(k + self.l.splat(1.0));
        }
        L::F::select(self.k_out.lt(x), self.k_end, x).larger(self.behind(k))
    }

    /// How far it is from `k`: to `k_exit` where rays jump, else to the next position.
    #[inline(always)]
    pub(crate) fn run(&self, k: L::F, jumps: L::M, k_exit: L::F) -> L::F {
        if self.borders {
            return L::F::select(jumps, k_exit, self.behind(k)) - k;
        }
        L::F::select(jumps, k_exit - k, self.l.splat(1.0))
    }

    /// How far it is from the first position of a run of `n` from `k` to its last, where that is not `n - 1`.
    #[inline(always)]
    pub(crate) fn within(&self, k: L::F, n: L::F) -> L::F {
        if self.borders { self.before(k + n) - k } else { n }
    }
}

/// Where around a brick another level is drawn.
pub(crate) struct Borders<'a, L: Lanes> {
    l: L,
    frame: &'a FrameUniform,
    brick: &'a BrickUniform,
    rays: &'a Rays<L>,
    /// As the brick's reader has it.
    elsewhere: &'a [u32; 27],
}

impl<'a, L: Lanes> Borders<'a, L> {
    #[inline(always)]
    pub(crate) fn new(l: L, bound: &Bindings<'a>, reader: &'a Reader<'_>, rays: &'a Rays<L>) -> Self {
        Self { l, frame: bound.scene.frame, brick: bound.brick, rays, elsewhere: &reader.elsewhere }
    }

    /// Is another level drawn where rays are at `t`, in or around the brick?
    #[inline(always)]
    fn is_elsewhere(&self, t: L::F) -> L::M {
        let (l, rays, brick) = (self.l, self.rays, self.brick);
        let zero = l.splat(0.0);
        let mut side = l.splat_int(13);
        let strides = [1, 3, 9];
        for a in 0..3 {
            let d = rays.direction[a];
            let moves = !d.same(zero);
            let at_lo = (l.splat(brick.owned_lo[a] as f32) - rays.origin[a]) * rays.inverse[a];
            let at_hi = (l.splat(brick.owned_hi[a] as f32) - rays.origin[a]) * rays.inverse[a];
            let comes = moves & t.lt(at_lo.smaller(at_hi));
            let goes = moves & !comes & at_lo.larger(at_hi).le(t);
            let forward = L::I::select(zero.lt(d), l.splat_int(strides[a]), l.splat_int(-strides[a]));
            side = L::I::select(comes, side - forward, L::I::select(goes, side + forward, side));
        }
        // SAFETY: 13 and at most one of 1, of 3 and of 9 more or less: one of the 27.
        unsafe { l.words(self.elsewhere.as_ptr(), side) }.gt(l.splat_int(0))
    }

    /// As [`Rays::owned`], from the first positions at which the brick takes something.
    #[inline(always)]
    pub(crate) fn owned(&self, wanted: L::M) -> Option<Segments<L>> {
        let (l, frame) = (self.l, self.frame);
        let (zero, one) = (l.splat(0.0), l.splat(1.0));
        let (step, finest) = (l.splat(frame.step), l.splat(frame.finest));
        let fine = self.rays.owned(l, frame.step * frame.finest, self.brick, wanted)?;
        let comes = (fine.k - one) * finest * step;
        let opens = zero.lt(fine.k) & self.is_elsewhere(comes);
        let k = fine.k * finest;
        let k = L::F::select(opens, k, rounded_up(l, k));
        let is_some = fine.is_some & (k * step).lt(fine.t_out);
        is_some.any().then_some(Segments { k, t_out: fine.t_out, is_some })
    }

    /// Where the last runs of what the brick owns end.
    #[inline(always)]
    fn end_of(&self, owned: &Segments<L>, alive: L::M) -> L::F {
        let (l, frame) = (self.l, self.frame);
        let (step, finest) = (l.splat(frame.step), l.splat(frame.finest));
        let mut k_out = first_outside(l, frame.step * frame.finest, owned.k / finest, owned.t_out) * finest;
        let whole = rounded_up(l, k_out);
        loop {
            let goes_on = alive & k_out.lt(whole) & !self.is_elsewhere(k_out * step);
            if !goes_on.any() {
                return k_out;
            }
            k_out = L::F::select(goes_on, k_out + finest, k_out);
        }
    }
}

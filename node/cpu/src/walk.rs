//! Where rays go next, by the map of macrocells and by texels that hold leaps: the twin's `walk/map.rs` and
//! `walk/leap.rs`, a lane each.

use std::marker::PhantomData;

use brickcast_shaders::layout::RegionFlags;
use brickcast_shaders::twin::bindings::Bindings;
use brickcast_shaders::twin::walk::{ENTRY_PROBES, MARGIN, MARGIN_SHARE, NEARLY_EQUAL, NOTHING_YET};

use super::counts::Counts;
use super::known::Known;
use super::lanes::{Floats, Ints, Lanes, Mask};
use super::positions::Positions;
use super::probe::Probe;
use super::ray::Place;
use super::run::Step;

pub(crate) struct Walk<'a, L: Lanes, K: Known> {
    probe: &'a Probe<'a, L>,
    bound: &'a Bindings<'a>,
    at: Positions<L>,
    known: PhantomData<K>,
    /// The first position at which the map may say something new, and whether it is asked at the present one.
    k_look: L::F,
    looks: L::M,
    /// The positions just before were skipped: where the present one is not empty, the last of them must be read.
    has_skipped: L::M,
    /// The present position lies in an empty cell, and is read all the same; and the one before.
    reads_empty: L::M,
    front_is_empty: L::M,
    /// Voxels that a leap ends before the last place that is known.
    margin: L::F,
    /// Positions that are probed from here on, whatever their values.
    probes: L::F,
    /// The last value.
    last: L::F,
}

impl<'a, L: Lanes, K: Known> Walk<'a, L, K> {
    #[inline(always)]
    pub(crate) fn new(probe: &'a Probe<'a, L>, bound: &'a Bindings<'a>, at: Positions<L>, k: L::F) -> Self {
        let (l, none) = (probe.l, probe.l.mask(0));
        let mut margin = l.splat(MARGIN);
        if K::key(bound.key).leaps {
            let mut far_corner = l.splat(0.0);
            for a in 0..3 {
                let hi = l.splat(bound.brick.owned_hi[a] as f32);
                far_corner = probe.rays.origin[a].abs().larger(far_corner).larger(hi);
            }
            margin = (l.splat(MARGIN_SHARE) * far_corner).larger(margin);
        }
        Self {
            probe,
            bound,
            at,
            known: PhantomData,
            k_look: k,
            looks: !none,
            has_skipped: none,
            reads_empty: none,
            front_is_empty: none,
            margin,
            probes: l.splat(ENTRY_PROBES as f32),
            last: l.splat(NOTHING_YET),
        }
    }

    /// Asks the map, and jumps over what is empty, until every lane has a position to take, or none left; lanes that
    /// have one.
    #[inline(always)]
    pub(crate) fn ask_map(
        &mut self,
        step: &mut Step<L>,
        k: &mut L::F,
        follows: &mut L::M,
        (walking, live): (L::M, L::M),
        counts: &mut Counts<L>,
    ) -> L::M {
        let (l, bound, probe, at) = (self.probe.l, self.bound, self.probe, self.at);
        let (frame, brick, key) = (bound.scene.frame, bound.brick, K::key(bound.key));
        let Some((map, dims)) = bound.data.map else { return live };
        let none = l.mask(0);
        let edge = l.splat((1_u32 << brick.cell_shift) as f32);
        // Cells know no regions: their samples may need different tables.
        let hears_cubes = key.cubes && !(key.regions && brick.region_flags == RegionFlags::Texture as u32);
        let (takes_empty, ends_beyond) = (key.take.is_projection(), key.take.ends_beyond());
        let (mut live, mut walking) = (live, walking);
        let mut asks = walking & self.looks;
        while asks.any() {
            let p = probe.place(*k);
            let (mut center, mut place) = (p, l.splat_int(0));
            for a in [2, 1, 0] {
                let along = p[a].cut_off().shift_right(brick.cell_shift) - l.splat_int(brick.cell_lo[a]);
                let cell = along.larger(l.splat_int(0)).smaller(l.splat_int(dims[a] as i32 - 1));
                place = place * l.splat_int(dims[a] as i32) + cell;
                center[a] = ((cell + l.splat_int(brick.cell_lo[a])).floats() + l.splat(0.5)) * edge;
            }
            // SAFETY: cells were clamped to those of the map, which is whole (`Reader::new`).
            let texel = unsafe { l.words(map.as_ptr(), place) };
            let byte = l.splat_int(0xff);
            let empty = if key.skips { texel & byte } else { l.splat_int(0) };
            let alike = if hears_cubes { texel.shift_right(8) & byte } else { l.splat_int(0) };
            let is_empty = empty.gt(l.splat_int(0));
            let cells = L::I::select(is_empty, empty, alike.larger(l.splat_int(1)));
            let half = (cells.floats() - l.splat(0.5)) * edge;
            let k_exit = at.ends_at(*k, probe.rays.exit_of(l, frame, center, half));
            let mut skips = none;
            let mut stays = asks;
            if takes_empty {
                // Nothing there changes the pixel: a run of the code that says so.
                let neutral = asks & is_empty;
                let code = f32::from(key.take.pixel_kind().neutral_code()) / 65535.0;
                step.code = L::F::select(asks, l.splat(code), step.code);
                step.is_known = step.is_known | neutral;
            } else if ends_beyond {
                // Both ends of all slabs up to the one that leaves.
                skips = asks & is_empty & (!*follows | self.front_is_empty);
                // The slab that enters what shows starts in the empty.
                let backs = asks & !is_empty & self.has_skipped;
                stays = asks & !skips & !backs;
                counts.skips = counts.skips.count(skips & live).count(backs & live);
                self.reads_empty = (self.reads_empty & !asks) | (stays & is_empty) | backs;
                self.front_is_empty = self.front_is_empty & !(skips | backs);
                self.has_skipped = (self.has_skipped & !backs) | skips;
                self.looks = self.looks & !backs;
                *follows = *follows & !(skips | backs);
                *k = L::F::select(backs, at.before(*k), *k);
                self.forget(backs);
            } else {
                skips = asks & is_empty;
                stays = asks & !skips;
                counts.skips = counts.skips.count(skips & live);
                *follows = *follows & !skips;
            }
            *k = L::F::select(skips, k_exit, *k);
            self.forget(skips);
            let is_alike = stays & !is_empty & alike.gt(l.splat_int(0));
            if is_alike.any() {
                let value = texel.shift_right_unsigned(16).floats() / l.splat(65535.0);
                step.code = L::F::select(is_alike, value, step.code);
                step.is_flat = step.is_flat | is_alike;
                step.is_known = step.is_known | is_alike;
            }
            step.looked = step.looked | stays;
            step.k_exit = L::F::select(stays, k_exit, step.k_exit);
            let is_within = k.lt(at.k_end);
            (walking, live) = (walking & is_within, live & is_within);
            asks = skips & walking;
        }
        step.jumps = step.is_known;
        step.is_by_map = step.is_known;
        counts.skips = counts.skips.count(step.is_by_map & live);
        live
    }

    /// After positions that the map alone knew: they are probed behind.
    #[inline(always)]
    fn forget(&mut self, jumped: L::M) {
        if K::key(self.bound.key).leaps {
            let l = self.probe.l;
            self.probes = L::F::select(jumped, l.splat(ENTRY_PROBES as f32), self.probes);
            self.last = L::F::select(jumped, l.splat(0.0), self.last);
        }
    }

    /// After `n` positions from `k`; `shows`: something of them does. All rays that go on took some.
    #[inline(always)]
    pub(crate) fn leave_map(&mut self, step: &Step<L>, (k, n): (L::F, L::F), shows: L::M) {
        let l = self.probe.l;
        // A leap says nothing of its cell, nor does an empty one of the next position where this one is read.
        let is_short = (step.is_deep & step.jumps) | self.reads_empty;
        let next = L::F::select(is_short, k + l.splat(1.0), step.k_exit);
        self.k_look = L::F::select(step.looked, next, self.k_look);
        self.looks = self.k_look.le(k + n);
        if !K::key(self.bound.key).cubes {
            self.looks = self.looks & !shows;
        }
        self.has_skipped = l.mask(0);
        self.front_is_empty = self.reads_empty;
        self.reads_empty = l.mask(0);
    }

    /// Leaps where texels say how far.
    #[inline(always)]
    pub(crate) fn ask_code(
        &mut self,
        step: &mut Step<L>,
        p: Place<L>,
        k: L::F,
        (live, counts): (L::M, &mut Counts<L>),
    ) {
        let (l, frame) = (self.probe.l, self.bound.scene.frame);
        let (zero, one) = (l.splat(0.0), l.splat(1.0));
        let asks = live & !step.is_known & zero.lt(self.probes);
        if !asks.any() {
            return;
        }
        counts.samples = counts.samples.count(asks);
        let texel = self.probe.reader.coded(l, p);
        let (leaps, inner) = (asks & texel.is_leap, asks & texel.is_inner);
        if leaps.any() {
            let half = texel.distance - one - self.margin;
            let mut center = p;
            for a in 0..3 {
                center[a] = p[a].cut_off().floats() + l.splat(0.5);
            }
            let k_exit = self.at.ends_at(k, self.probe.rays.exit_of(l, frame, center, half));
            step.code = L::F::select(leaps, texel.mean, step.code);
            step.k_exit = L::F::select(leaps, k_exit, step.k_exit);
            step.jumps = step.jumps | leaps;
        }
        step.code = L::F::select(inner, texel.code, step.code);
        step.is_known = step.is_known | leaps | inner;
        step.is_deep = step.is_deep | leaps | inner;
        step.is_flat = step.is_flat | leaps | inner;
    }

    /// After positions of this code. All rays that go on took some.
    #[inline(always)]
    pub(crate) fn leave_code(&mut self, step: &Step<L>, code: L::F) {
        let l = self.probe.l;
        let (zero, one) = (l.splat(0.0), l.splat(1.0));
        let is_equal = (code - self.last).abs().le(l.splat(NEARLY_EQUAL));
        let fewer = self.probes.larger(one) - one;
        let needed = L::F::select(is_equal | step.is_deep, one, zero);
        self.probes = L::F::select(step.is_by_map, l.splat(ENTRY_PROBES as f32), fewer.larger(needed));
        self.last = code;
    }
}

//! What runs add to their pixels: the twin's `take/`, a lane each.

use std::marker::PhantomData;

use brickcast_shaders::layout::{SHOWS_REGIONS, SHOWS_RESIDUAL};
use brickcast_shaders::twin::bindings::Bindings;
use brickcast_shaders::twin::scene::LEAST_CUT;
use brickcast_shaders::{KernelKey, TakeKind};
use brickcast_volume::PixelKind;

use super::known::Known;
use super::lanes::{Floats, Ints, Lanes, Mask};
use super::probe::{Lit, Probe};
use super::ray::{Place, first_sample};
use super::run::Run;
use super::slab::{Closing, End, Sum, add, entry_of, lit_color};
use super::slab_table::Slabs;
use super::surface::{close_slabs, enter_surfaces};
use super::table::Table;

pub(crate) struct Take<'a, L: Lanes, K: Known> {
    probe: &'a Probe<'a, L>,
    bound: &'a Bindings<'a>,
    known: PhantomData<K>,
    /// For single samples, outside regions and in them.
    table: Table<'a, L>,
    region: Table<'a, L>,
    slabs: Option<&'a [Slabs<'a, L>; 2]>,
    /// The position before the present one, where it was taken.
    front: End<L>,
    front_in_region: L::M,
    /// The position by which rays enter the volume, or what clips leave of it.
    k_entry: L::F,
    /// The first behind the cut by which clips let rays in; -1 where nothing is lit as a cut.
    k_cut: L::F,
}

impl<'a, L: Lanes, K: Known> Take<'a, L, K> {
    #[inline(always)]
    pub(crate) fn new(
        probe: &'a Probe<'a, L>,
        bound: &'a Bindings<'a>,
        slabs: Option<&'a [Slabs<'a, L>; 2]>,
        t_lo: L::F,
    ) -> Self {
        let (l, frame, style) = (probe.l, bound.scene.frame, bound.scene.style);
        let (zero, none, never) = (l.splat(0.0), l.mask(0), l.splat(-1.0));
        let kind = K::key(bound.key).take.slab_kind();
        let (mut k_entry, mut k_cut) = (never, never);
        let may_cut = kind.light.is_some() && style.plane_count > 0;
        if kind.surfaces || may_cut {
            let entry = probe.rays.volume_entry(l, style);
            if kind.surfaces {
                k_entry = first_sample(l, frame.step, entry.larger(t_lo));
            }
            if may_cut {
                let is_face = t_lo.le(entry + l.splat(LEAST_CUT));
                k_cut = L::F::select(is_face, never, first_sample(l, frame.step, t_lo));
            }
        }
        let at = (l.splat_int(0), zero);
        let front = End { code: zero, k: zero, at, light: Lit::none(l), is_lit: none, is_cut: none };
        let (tables, shown) = (bound.scene.tables, probe.reader.shown);
        let table = Table::new(l, tables.table, (frame.table_first, frame.table_scale), shown.table);
        let inside = tables.region.unwrap_or(tables.table);
        let region = Table::new(l, inside, (frame.region_first, frame.region_scale), shown.region);
        Self { probe, bound, known: PhantomData, table, region, slabs, front, front_in_region: none, k_entry, k_cut }
    }

    #[inline(always)]
    fn key(&self) -> KernelKey {
        K::key(self.bound.key)
    }

    /// Adds runs whose first positions lie at `p`, where `taken`; where something of them shows.
    #[inline(always)]
    pub(crate) fn take(&mut self, p: Place<L>, run: &Run<L>, taken: L::M, sum: &mut Sum<L>) -> L::M {
        let shown = taken & self.shows(run.in_region);
        match self.key().take {
            TakeKind::Sampled => self.sample(run, shown, sum),
            TakeKind::Slabs(_) => self.slabs(p, run, (taken, shown), sum),
            TakeKind::Projection(pixel) => {
                self.project(pixel, run, shown, sum);
                self.probe.l.mask(0)
            }
        }
    }

    /// Does the view show samples that lie in regions, or do not?
    #[inline(always)]
    fn shows(&self, in_region: L::M) -> L::M {
        let l = self.probe.l;
        if !self.key().regions {
            return l.mask(u32::MAX);
        }
        match self.bound.scene.frame.shown {
            SHOWS_REGIONS => in_region,
            SHOWS_RESIDUAL => !in_region,
            _ => l.mask(u32::MAX),
        }
    }

    /// Into the pixel of a projection, as [`PixelKind::take`] does.
    #[inline(always)]
    fn project(&self, pixel: PixelKind, run: &Run<L>, shown: L::M, sum: &mut Sum<L>) {
        let l = self.probe.l;
        let is_first = sum[3].same(l.splat(0.0));
        match pixel {
            PixelKind::Over => {}
            PixelKind::Largest => {
                let more = L::F::select(is_first, run.code, run.code.larger(sum[0]));
                sum[0] = L::F::select(shown, more, sum[0]);
            }
            PixelKind::Smallest => {
                let more = L::F::select(is_first, run.code, run.code.smaller(sum[0]));
                sum[0] = L::F::select(shown, more, sum[0]);
            }
            PixelKind::Mean => {
                let weight = run.n * l.splat(self.bound.scene.frame.weight);
                sum[0] = L::F::select(shown, sum[0] + run.code * weight, sum[0]);
                sum[1] = L::F::select(shown, sum[1] + weight, sum[1]);
            }
        }
        sum[3] = L::F::select(shown, l.splat(1.0), sum[3]);
    }

    /// Straight colour and opacity of one step, and where that shows anything; `None` where no lane does.
    #[inline(always)]
    fn classify(&self, in_region: L::M, code: L::F, shown: L::M) -> Option<([L::F; 4], L::M)> {
        let l = self.probe.l;
        let outside = self.table.entry(l, code);
        let mut may = outside.may_show;
        let sample = if self.key().regions && in_region.any() {
            let inside = self.region.entry(l, code);
            may = (inside.may_show & in_region) | (may & !in_region);
            if !(may & shown).any() {
                return None;
            }
            let (outside, inside) = (self.table.between(l, &outside), self.region.between(l, &inside));
            let [r, g, b, alpha] = inside;
            [
                L::F::select(in_region, r, outside[0]),
                L::F::select(in_region, g, outside[1]),
                L::F::select(in_region, b, outside[2]),
                L::F::select(in_region, alpha, outside[3]),
            ]
        } else {
            if !(may & shown).any() {
                return None;
            }
            self.table.between(l, &outside)
        };
        // Adding nothing changes no bit.
        let shown = shown & l.splat(0.0).lt(sample[3]);
        shown.any().then_some((sample, shown))
    }

    /// Single samples, colours as they are.
    #[inline(always)]
    fn sample(&self, run: &Run<L>, shown: L::M, sum: &mut Sum<L>) -> L::M {
        let l = self.probe.l;
        if !shown.any() {
            return shown;
        }
        let Some(([r, g, b, alpha], shown)) = self.classify(run.in_region & shown, run.code, shown) else {
            return l.mask(0);
        };
        let alpha = if run.jumps { opacity_of(l, alpha, run.n, shown, self.key().borders) } else { alpha };
        // Colours are finite, and no sum is -0: adding zeros changes no bit.
        let weight = ((l.splat(1.0) - sum[3]) * alpha).only(shown);
        sum[0] = sum[0] + r * weight;
        sum[1] = sum[1] + g * weight;
        sum[2] = sum[2] + b * weight;
        sum[3] = sum[3] + weight;
        shown
    }

    /// What lies between samples, isosurfaces, and single samples under light or clips.
    #[inline(always)]
    fn slabs(&mut self, p: Place<L>, run: &Run<L>, (taken, shown): (L::M, L::M), sum: &mut Sum<L>) -> L::M {
        let (l, take) = (self.probe.l, self.key().take);
        let (kind, borders) = (take.slab_kind(), self.key().borders);
        let (zero, one, none) = (l.splat(0.0), l.splat(1.0), l.mask(0));
        let mut opacity = zero;
        let is_cut = if kind.light.is_some() { taken & run.k.same(self.k_cut) } else { none };
        let mut back = End {
            code: run.code,
            k: run.k,
            at: entry_of(l, self.slabs, self.key().regions, run.code),
            light: Lit::none(l),
            is_lit: run.is_flat,
            is_cut: is_cut & if borders { run.within.same(zero) } else { run.n.same(one) },
        };
        if take.ends_beyond() {
            let closed = taken & run.follows & self.shows(self.front_in_region);
            if closed.any() {
                opacity = self.close(run, &mut back, closed, sum);
            }
        }
        if kind.surfaces {
            let enters = shown & run.k.same(self.k_entry);
            if enters.any() {
                enter_surfaces(self.probe, kind, sum, run.code, enters);
            }
        }
        if kind.preintegrated {
            // The slabs within the run.
            let within = shown & if borders { zero.lt(run.within) } else { one.lt(run.n) };
            if within.any() {
                let length = if borders { run.within } else { run.n - one };
                self.closing(run.in_region).add_flat(sum, run.code, length, (within, is_cut));
                opacity = L::F::select(within, one, opacity);
            }
        } else {
            self.lit_sample(p, (run, &mut back), (shown & zero.lt(run.owns), is_cut), (sum, &mut opacity));
        }
        if take.ends_beyond() {
            back.k = if borders { run.k + run.within } else { run.k + run.n - one };
            // Of no meaning where nothing was taken: no slab follows there.
            self.front = back;
            self.front_in_region = run.in_region;
        }
        taken & zero.lt(opacity)
    }

    #[inline(always)]
    fn closing(&self, in_region: L::M) -> Closing<'a, L> {
        let key = self.key();
        let (kind, tells_regions_apart) = (key.take.slab_kind(), key.regions);
        Closing { probe: self.probe, slabs: self.slabs, kind, borders: key.borders, in_region, tells_regions_apart }
    }

    /// Closes the slabs that end at the run's first position; their opacity.
    #[inline(always)]
    fn close(&mut self, run: &Run<L>, back: &mut End<L>, closed: L::M, sum: &mut Sum<L>) -> L::F {
        let closing = self.closing(self.front_in_region);
        if !self.key().regions {
            // What the far end learns of its light is the next slab's near end's.
            return close_slabs(&closing, sum, (&mut self.front, back), closed);
        }
        // A slab is of one kind, its front's: colours do not run from one kind into the other.
        let is_same = (self.front_in_region & run.in_region) | (!self.front_in_region & !run.in_region);
        let mut far = *back;
        far.code = L::F::select(is_same, far.code, self.front.code);
        let opacity = close_slabs(&closing, sum, (&mut self.front, &mut far), closed);
        let learned = closed & is_same;
        back.light = Lit::select(learned, far.light, back.light);
        back.is_lit = back.is_lit | (far.is_lit & learned);
        opacity
    }

    /// The run's positions as samples, under light and cuts.
    #[inline(always)]
    fn lit_sample(
        &self,
        p: Place<L>,
        (run, back): (&Run<L>, &mut End<L>),
        (shown, is_cut): (L::M, L::M),
        (sum, opacity): (&mut Sum<L>, &mut L::F),
    ) {
        if !shown.any() {
            return;
        }
        let (l, has_light) = (self.probe.l, self.key().take.slab_kind().light.is_some());
        let (zero, one) = (l.splat(0.0), l.splat(1.0));
        let Some(([r, g, b, alpha], mut shown)) = self.classify(run.in_region & shown, run.code, shown) else {
            return;
        };
        *opacity = L::F::select(shown, alpha.larger(*opacity), *opacity);
        let (mut color, mut rest) = ([r, g, b], run.owns);
        let cut = shown & is_cut;
        if cut.any() {
            let [r, g, b] = lit_color::<L>(color, self.probe.light_of_entry(), one, one);
            let borders = self.key().borders;
            let first = if borders { rest.smaller(one) } else { one };
            let alpha = if borders { opacity_of(l, alpha, first, cut, true) } else { alpha };
            add(l, sum, cut, [r * alpha, g * alpha, b * alpha, alpha]);
            rest = L::F::select(cut, rest - first, rest);
            shown = shown & zero.lt(rest);
        }
        if has_light {
            let lit = shown & !run.is_flat;
            back.learn_at(self.probe, lit, p);
            let [r, g, b] = lit_color::<L>(color, back.light, one, one);
            color[0] = L::F::select(lit, r, color[0]);
            color[1] = L::F::select(lit, g, color[1]);
            color[2] = L::F::select(lit, b, color[2]);
        }
        let alpha = if run.jumps { opacity_of(l, alpha, rest, shown, self.key().borders) } else { alpha };
        add(l, sum, shown, [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha]);
    }
}

/// The opacity of `n` samples of opacity `alpha`: by squaring, as exact as n single ones. What is left of `n` beyond
/// whole numbers is a sum of halves of halves, and taken by square roots; only on `borders` is there any.
#[inline(always)]
fn opacity_of<L: Lanes>(l: L, alpha: L::F, n: L::F, wanted: L::M, borders: bool) -> L::F {
    let one = l.splat(1.0);
    let many = wanted & !n.same(one);
    if !many.any() {
        return alpha;
    }
    let (mut clear, mut square, mut left) = (one, one - alpha, n.cut_off());
    let (mut root, mut part) = (square, n - left.floats());
    while (left.gt(l.splat_int(0)) & many).any() {
        let is_odd = (left & l.splat_int(1)).gt(l.splat_int(0));
        clear = L::F::select(is_odd, clear * square, clear);
        square = square * square;
        left = left.shift_right(1);
    }
    let zero = l.splat(0.0);
    while borders && (zero.lt(part) & many).any() {
        root = root.sqrt();
        part = part + part;
        let is_in = one.le(part);
        clear = L::F::select(is_in, clear * root, clear);
        part = L::F::select(is_in, part - one, part);
    }
    L::F::select(many, one - clear, alpha)
}

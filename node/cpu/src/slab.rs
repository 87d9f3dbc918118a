//! What lies between two places of rays, and isosurfaces in it. The same as the twin's, lane by lane
//! (`shaders/src/twin/slab.rs`, `surface.rs`).

use brickcast_shaders::SlabKind;
use brickcast_volume::style::Lighting;

use super::lanes::{Floats, Ints, Lanes, Mask};
use super::power::power;
use super::probe::{Lit, Probe};
use super::ray::Place;
use super::slab_table::{Nodes, Slabs};

/// Premultiplied, or what else accumulators hold.
pub(crate) type Sum<L> = [<L as Lanes>::F; 4];

/// An end of a slab, or a place between.
#[derive(Debug, Clone, Copy)]
pub(crate) struct End<L: Lanes> {
    pub(crate) code: L::F,
    /// In steps along the ray.
    pub(crate) k: L::F,
    /// Where `code` lies in the table of slabs, where there is but one.
    pub(crate) at: (L::I, L::F),
    pub(crate) light: Lit<L>,
    pub(crate) is_lit: L::M,
    /// What follows, up to the next sample, is lit as the cut by which the ray enters.
    pub(crate) is_cut: L::M,
}

impl<L: Lanes> End<L> {
    /// By lane.
    #[inline(always)]
    pub(crate) fn select(mask: L::M, yes: &Self, no: &Self) -> Self {
        Self {
            code: L::F::select(mask, yes.code, no.code),
            k: L::F::select(mask, yes.k, no.k),
            at: (L::I::select(mask, yes.at.0, no.at.0), L::F::select(mask, yes.at.1, no.at.1)),
            light: Lit::select(mask, yes.light, no.light),
            is_lit: (yes.is_lit & mask) | (no.is_lit & !mask),
            is_cut: (yes.is_cut & mask) | (no.is_cut & !mask),
        }
    }

    /// Finds the light of the places that `wants` it and know none.
    #[inline(always)]
    pub(crate) fn learn(&mut self, probe: &Probe<'_, L>, wants: L::M) {
        self.learn_at(probe, wants, probe.place(self.k));
    }

    /// The same, of ends whose places are known to be `p`.
    #[inline(always)]
    pub(crate) fn learn_at(&mut self, probe: &Probe<'_, L>, wants: L::M, p: Place<L>) {
        let unknown = wants & !self.is_lit;
        if unknown.any() {
            self.light = Lit::select(unknown, probe.light(p), self.light);
            self.is_lit = self.is_lit | unknown;
        }
    }
}

/// Adds to `sum` where `shows`, behind what is there; premultiplied.
#[inline(always)]
pub(crate) fn add<L: Lanes>(l: L, sum: &mut Sum<L>, shows: L::M, more: Sum<L>) {
    let through = l.splat(1.0) - sum[3];
    // No sum is -0: adding zeros changes no bit.
    sum[0] = sum[0] + (through * more[0]).only(shows);
    sum[1] = sum[1] + (through * more[1]).only(shows);
    sum[2] = sum[2] + (through * more[2]).only(shows);
    sum[3] = sum[3] + (through * more[3]).only(shows);
}

/// Colour under a light, no brighter than `most`; `white` of the light's glint.
#[inline(always)]
pub(crate) fn lit_color<L: Lanes>(color: [L::F; 3], light: Lit<L>, white: L::F, most: L::F) -> [L::F; 3] {
    let glint = white * light.glint;
    [
        (color[0] * light.factor + glint).smaller(most),
        (color[1] * light.factor + glint).smaller(most),
        (color[2] * light.factor + glint).smaller(most),
    ]
}

/// Premultiplied, of slabs, as of those that are `length` times as long.
#[inline(always)]
fn of_length<L: Lanes>(l: L, slab: Sum<L>, length: L::F) -> Sum<L> {
    let (zero, one) = (l.splat(0.0), l.splat(1.0));
    let is_same = length.same(one);
    if !(!is_same).any() {
        return slab;
    }
    let clear = one - slab[3];
    let longer = one - L::F::select(zero.lt(clear), power(l, clear, length), zero);
    let scale = L::F::select(l.splat(1e-6).lt(slab[3]), longer / slab[3], length);
    [
        L::F::select(is_same, slab[0], slab[0] * scale),
        L::F::select(is_same, slab[1], slab[1] * scale),
        L::F::select(is_same, slab[2], slab[2] * scale),
        L::F::select(is_same, slab[3], longer),
    ]
}

/// Where codes lie in the table of slabs, if there is but one; else of no meaning.
#[inline(always)]
pub(crate) fn entry_of<L: Lanes>(
    l: L,
    slabs: Option<&[Slabs<'_, L>; 2]>,
    tells_regions_apart: bool,
    code: L::F,
) -> (L::I, L::F) {
    match slabs {
        Some([table, _]) if !tells_regions_apart => table.entry(l, code),
        _ => (l.splat_int(0), l.splat(0.0)),
    }
}

/// What closes slabs: where, of which kind, with which tables.
pub(crate) struct Closing<'a, L: Lanes> {
    pub(crate) probe: &'a Probe<'a, L>,
    pub(crate) slabs: Option<&'a [Slabs<'a, L>; 2]>,
    pub(crate) kind: SlabKind,
    /// Runs have other lengths than steps.
    pub(crate) borders: bool,
    /// Slabs that lie in regions, where tables differ.
    pub(crate) in_region: L::M,
    /// They do: ends know no place in a table.
    pub(crate) tells_regions_apart: bool,
}

impl<'a, L: Lanes> Closing<'a, L> {
    /// Where codes lie in the table, if there is but one; else of no meaning.
    #[inline(always)]
    pub(crate) fn entry(&self, code: L::F) -> (L::I, L::F) {
        entry_of(self.probe.l, self.slabs, self.tells_regions_apart, code)
    }

    /// For slabs outside regions, and in them, those that are `wanted`; nothing where slabs are single samples.
    #[inline(always)]
    fn tables(&self, wanted: L::M) -> Option<[(&'a Slabs<'a, L>, L::M); 2]> {
        let [outside, inside] = self.slabs?;
        let in_region = if self.tells_regions_apart { self.in_region } else { self.probe.l.mask(0) };
        Some([(outside, wanted & !in_region), (inside, wanted & in_region)])
    }

    /// Adds slabs from `front` to `back`, `length` steps long, where `wanted`; returns their opacity. Learns the light
    /// of their ends.
    #[inline(always)]
    pub(crate) fn add_slab(
        &self,
        sum: &mut Sum<L>,
        (front, back): (&mut End<L>, &mut End<L>),
        length: L::F,
        wanted: L::M,
    ) -> L::F {
        let mut opacity = self.probe.l.splat(0.0);
        for (table, wanted) in self.tables(wanted).into_iter().flatten() {
            if wanted.any() {
                let kind = self.add_slab_of(table, sum, (&mut *front, &mut *back), length, wanted);
                opacity = L::F::select(wanted, kind, opacity);
            }
        }
        opacity
    }

    #[inline(always)]
    fn add_slab_of(
        &self,
        table: &Slabs<'_, L>,
        sum: &mut Sum<L>,
        (front, back): (&mut End<L>, &mut End<L>),
        length: L::F,
        wanted: L::M,
    ) -> L::F {
        let l = self.probe.l;
        let zero = l.splat(0.0);
        let mut nodes = Nodes { front: front.at, back: back.at };
        if self.tells_regions_apart {
            nodes = Nodes { front: table.entry(l, front.code), back: table.entry(l, back.code) };
        }
        if !(wanted & table.shows(l, &nodes)).any() {
            return zero;
        }
        let slab = table.look_up(l, table.front, &nodes);
        // Adding nothing changes no bit, and light on nothing need not be known.
        let shown = wanted & zero.lt(slab[3]);
        if !shown.any() {
            return zero;
        }
        let mut lit = slab;
        if self.kind.light.is_some() {
            lit = self.lit(table, &nodes, slab, (front, back), shown);
        }
        add(l, sum, shown, of_length(l, lit, length));
        L::F::select(shown, slab[3], zero)
    }

    #[inline(always)]
    fn lit(
        &self,
        table: &Slabs<'_, L>,
        nodes: &Nodes<L>,
        slab: Sum<L>,
        (front, back): (&mut End<L>, &mut End<L>),
        shown: L::M,
    ) -> Sum<L> {
        let (probe, kind, l) = (self.probe, self.kind, self.probe.l);
        let alpha = slab[3];
        let far = if kind.has_weights() { table.look_up(l, table.back, nodes) } else { [l.splat(0.0); 4] };
        let plain = shown & !front.is_cut;
        let mut color = [slab[0], slab[1], slab[2]];
        match kind.light {
            Some(Lighting::Interpolated) => {
                front.learn(probe, plain);
                back.learn(probe, plain);
                let glint = (alpha - far[3]) * front.light.glint + far[3] * back.light.glint;
                for c in 0..3 {
                    let both = slab[c] * front.light.factor + far[c] * back.light.factor;
                    color[c] = (both + glint).smaller(alpha);
                }
            }
            lighting => {
                let mut k = l.splat(0.5) * (front.k + back.k);
                if lighting == Some(Lighting::Centroid) {
                    k = front.k + (back.k - front.k) * (far[3] / alpha);
                    color = self.whole(slab, far);
                }
                // Both ends deep in a region: so is what lies between.
                let wants = plain & !(front.is_lit & back.is_lit);
                let mut light = Lit::none(l);
                if wants.any() {
                    light = Lit::select(wants, probe.light(probe.place(k)), light);
                }
                color = lit_color::<L>(color, light, alpha, alpha);
            }
        }
        let cut = shown & front.is_cut;
        if cut.any() {
            let on_cut = self.cut(slab, far);
            for c in 0..3 {
                color[c] = L::F::select(cut, on_cut[c], color[c]);
            }
        }
        [color[0], color[1], color[2], alpha]
    }

    /// The colour of slabs, of both tables where light is weighted by either end.
    #[inline(always)]
    fn whole(&self, slab: Sum<L>, far: Sum<L>) -> [L::F; 3] {
        if !self.kind.has_weights() {
            return [slab[0], slab[1], slab[2]];
        }
        [slab[0] + far[0], slab[1] + far[1], slab[2] + far[2]]
    }

    /// Slabs, looked up already, under the light of the cut by which rays enter.
    #[inline(always)]
    fn cut(&self, slab: Sum<L>, far: Sum<L>) -> [L::F; 3] {
        lit_color::<L>(self.whole(slab, far), self.probe.light_of_entry(), slab[3], slab[3])
    }

    /// Adds `n` slabs, both ends of each deep in one region, where nothing is lit but, on `cut`, the first.
    #[inline(always)]
    pub(crate) fn add_flat(&self, sum: &mut Sum<L>, code: L::F, n: L::F, (wanted, cut): (L::M, L::M)) {
        let (l, kind) = (self.probe.l, self.kind);
        let zero = l.splat(0.0);
        for (table, wanted) in self.tables(wanted).into_iter().flatten() {
            if !wanted.any() {
                continue;
            }
            let end = table.entry(l, code);
            let nodes = Nodes { front: end, back: end };
            let slab = table.look_up(l, table.front, &nodes);
            let shown = wanted & zero.lt(slab[3]);
            let mut far = [zero; 4];
            if kind.has_weights() {
                far = table.look_up(l, table.back, &nodes);
            }
            let mut n = n;
            if kind.light.is_some() && (cut & shown).any() {
                let [r, g, b] = self.cut(slab, far);
                let (one, on_cut) = (l.splat(1.0), [r, g, b, slab[3]]);
                let first = if self.borders { n.smaller(one) } else { one };
                let on_cut = if self.borders { of_length(l, on_cut, first) } else { on_cut };
                add(l, sum, cut & shown, on_cut);
                n = L::F::select(cut, n - first, n);
            }
            let [r, g, b] = self.whole(slab, far);
            add(l, sum, shown, of_length(l, [r, g, b, slab[3]], n));
        }
    }
}

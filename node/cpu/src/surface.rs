//! Isosurfaces between two places of rays. The same as the twin's, lane by lane (`shaders/src/twin/surface.rs`,
//! `take/slabs.rs`).

use brickcast_shaders::SlabKind;
use brickcast_shaders::twin::surface::BISECTIONS;

use super::lanes::{Floats, Lanes, Mask, Task};
use super::probe::{Lit, Probe};
use super::ray::clamped;
use super::slab::{Closing, End, Sum, add, lit_color};

/// A part of a slab, between two isosurfaces.
struct AddPart<'a, 'b, L: Lanes> {
    closing: &'a Closing<'b, L>,
    sum: &'a mut Sum<L>,
    front: &'a mut End<L>,
    back: &'a mut End<L>,
    length: L::F,
    wanted: L::M,
}

impl<L: Lanes> Task for AddPart<'_, '_, L> {
    type Output = L::F;

    #[inline(always)]
    fn run<Same: Lanes>(self, _: Same) -> L::F {
        let Self { closing, sum, front, back, length, wanted } = self;
        closing.add_slab(sum, (front, back), length, wanted)
    }
}

/// Closes the slabs between positions where `wanted`, isosurfaces in them; the opacity that they add, surfaces and all.
#[inline(always)]
pub(crate) fn close_slabs<L: Lanes>(
    closing: &Closing<'_, L>,
    sum: &mut Sum<L>,
    ends: (&mut End<L>, &mut End<L>),
    wanted: L::M,
) -> L::F {
    let l = closing.probe.l;
    if !closing.kind.surfaces {
        let length = if closing.borders { ends.1.k - ends.0.k } else { l.splat(1.0) };
        return closing.add_slab(sum, ends, length, wanted);
    }
    let (front, back) = ends;
    l.enter(CloseSurfaces { closing, sum, front, back, wanted })
}

struct CloseSurfaces<'a, 'b, L: Lanes> {
    closing: &'a Closing<'b, L>,
    sum: &'a mut Sum<L>,
    front: &'a mut End<L>,
    back: &'a mut End<L>,
    wanted: L::M,
}

impl<L: Lanes> Task for CloseSurfaces<'_, '_, L> {
    type Output = L::F;

    #[inline(always)]
    fn run<Same: Lanes>(self, _: Same) -> L::F {
        let Self { closing, sum, front, back, wanted } = self;
        let (probe, l) = (closing.probe, closing.probe.l);
        let (zero, one) = (l.splat(0.0), l.splat(1.0));
        let style = probe.style;
        let count = style.surface_count as usize;
        let (first, rises) = (*front, front.code.lt(back.code));
        let mut any = wanted & one.lt(zero);
        for i in 0..count {
            let j = count - 1 - i;
            let value = L::F::select(rises, l.splat(style.codes[i][0]), l.splat(style.codes[j][0]));
            let (is_above, ends_above) = (value.le(first.code), value.le(back.code));
            let met = wanted & ((is_above & !ends_above) | (!is_above & ends_above));
            if !met.any() {
                continue;
            }
            let (k, has_data) = crossing(probe, (&first, back), value);
            let met = met & has_data;
            let k = k.larger(front.k);
            let at = closing.entry(value);
            let (light, is_cut) = (Lit::none(l), first.is_cut);
            let mut here = End { code: value, k, at, light, is_lit: one.lt(zero), is_cut };
            if closing.kind.preintegrated {
                let length = k - front.k;
                l.enter(AddPart { closing, sum, front: &mut *front, back: &mut here, length, wanted: met });
            }
            let mut shown = [zero; 4];
            for c in 0..4 {
                shown[c] = L::F::select(rises, l.splat(style.colors[i][c]), l.splat(style.colors[j][c]));
            }
            let mut light = Lit::none(l);
            if closing.kind.light.is_some() {
                light = probe.light(probe.place(k));
            }
            meet(l, sum, met, shown, light);
            *front = End::select(met, &here, front);
            any = any | met;
        }
        let mut opacity = zero;
        if closing.kind.preintegrated {
            let whole = if closing.borders { back.k - front.k } else { one };
            let length = L::F::select(any, back.k - front.k, whole);
            opacity = l.enter(AddPart { closing, sum, front, back, length, wanted });
        }
        L::F::select(any, one, opacity)
    }
}

/// Adds isosurfaces of a colour and opacity where rays meet them.
#[inline(always)]
fn meet<L: Lanes>(l: L, sum: &mut Sum<L>, met: L::M, [r, g, b, alpha]: Sum<L>, light: Lit<L>) {
    let one = l.splat(1.0);
    let [r, g, b] = lit_color::<L>([r, g, b], light, one, one);
    add(l, sum, met, [r * alpha, g * alpha, b * alpha, alpha]);
}

/// Adds the isosurfaces whose insides rays enter where they enter the volume.
#[inline(always)]
pub(crate) fn enter_surfaces<L: Lanes>(
    probe: &Probe<'_, L>,
    kind: SlabKind,
    sum: &mut Sum<L>,
    code: L::F,
    enters: L::M,
) {
    let (l, style) = (probe.l, probe.style);
    for (&[value, ..], &[r, g, b, alpha]) in style.codes.iter().zip(&style.colors).take(style.surface_count as usize) {
        let met = enters & l.splat(value).le(code);
        if met.any() {
            let shown = [l.splat(r), l.splat(g), l.splat(b), l.splat(alpha)];
            let mut light = Lit::none(l);
            if kind.light.is_some() {
                light = probe.light_of_entry();
            }
            meet(l, sum, met, shown, light);
        }
    }
}

/// Where rays have `value` between two samples on either side of it: bisection, then a line; and whether all places
/// between hold data.
#[inline(always)]
fn crossing<L: Lanes>(probe: &Probe<'_, L>, (front, back): (&End<L>, &End<L>), value: L::F) -> (L::F, L::M) {
    let l = probe.l;
    let (zero, one, half) = (l.splat(0.0), l.splat(1.0), l.splat(0.5));
    let (mut lo, mut hi, mut at_lo, mut at_hi) = (zero, one, front.code, back.code);
    let is_above = value.le(at_lo);
    let mut has_data = zero.lt(one);
    for _ in 0..BISECTIONS {
        let middle = half * (lo + hi);
        let code = probe.value(probe.place(front.k + middle));
        has_data = has_data & zero.le(code);
        let above = value.le(code);
        let is_near = (above & is_above) | (!above & !is_above);
        (lo, at_lo) = (L::F::select(is_near, middle, lo), L::F::select(is_near, code, at_lo));
        (hi, at_hi) = (L::F::select(is_near, hi, middle), L::F::select(is_near, at_hi, code));
    }
    let rise = at_hi - at_lo;
    let part = L::F::select(rise.same(zero), half, clamped(l, (value - at_lo) / rise, one));
    (front.k + lo + (hi - lo) * part, has_data)
}

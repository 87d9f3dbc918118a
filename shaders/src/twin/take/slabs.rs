//! `wgsl/take/slabs.wgsl` on the CPU: what lies between samples (Lum, Wilson & Ma 2004), with light and isosurfaces
//! (Krueger & Westermann 2003); and single samples under light or clips.
//!
//! Every run closes the slab that ends at its first position, and adds the slabs within it. So slab k, from `t_k` to
//! `t_(k+1)`, belongs to the owner of `t_k`, is closed once, and sees the same two values whatever the partition
//! (docs/adr/0006-integral.md).

use brickcast_volume::Premul;

use super::super::bindings::{Along, Bindings};
use super::super::classify::{classify, is_shown};
use super::super::jump::opacity_of;
use super::super::light::{UNLIT, light_at, light_of_entry, lit_color};
use super::super::part::Take;
use super::super::ray::first_sample;
use super::super::run::Run;
use super::super::scene::Styled;
use super::super::scene::styled::{clip_span, first_behind_cut, volume_entry};
use super::super::slab::{End, add, cut_slab, flat_slabs, look_up, nodes_of, of_length, slab_between};
use super::super::surface::{crossing, surface_at};

#[derive(Debug)]
pub struct Slabs {
    /// The position before the present one, where it was taken.
    pub(in super::super) front: End,
    front_in_region: bool,
    /// The position by which the ray enters the volume, or what clips leave of it.
    k_entry: f32,
    /// The first behind the cut by which clips let the ray in; -1 where nothing is lit as a cut.
    k_cut: f32,
}

impl Take for Slabs {
    type Scene = Styled;
    const TAKES_EMPTY: bool = false;

    #[inline(always)]
    fn ends_beyond(bound: &Bindings<'_>) -> bool {
        bound.key.take.ends_beyond()
    }

    #[inline(always)]
    fn neutral_code(_: &Bindings<'_>) -> f32 {
        0.0
    }

    #[inline(always)]
    fn enter_take(along: &Along<'_>) -> Self {
        let (frame, style, ray) = (along.frame(), along.style(), along.ray);
        let kind = along.bound.key.take.slab_kind();
        let (t_lo, _) = clip_span(style, ray);
        // As its brick computes it.
        let k_entry = if kind.surfaces { first_sample(frame.step, volume_entry(style, ray).max(t_lo)) } else { -1.0 };
        let k_cut = if kind.light.is_some() { first_behind_cut(frame, style, ray, t_lo) } else { -1.0 };
        let front = End { code: 0.0, k: 0.0, light: None, is_cut: false };
        Self { front, front_in_region: false, k_entry, k_cut }
    }

    #[inline(always)]
    fn take(&mut self, along: &Along<'_>, p: [f32; 3], run: Run, sum: &mut Premul) -> bool {
        let (bound, style) = (along.bound, along.style());
        let kind = bound.key.take.slab_kind();
        let mut opacity = 0.0;
        let shows = is_shown(bound, run.in_region);
        let is_cut = kind.light.is_some() && run.k == self.k_cut;
        let mut back =
            End { code: run.code, k: run.k, light: run.is_flat.then_some(UNLIT), is_cut: is_cut && run.within == 0.0 };
        if Self::ends_beyond(bound) && run.follows && is_shown(bound, self.front_in_region) {
            // A slab is of one kind, its front's: colours do not run from one kind into the other.
            let mut far = back;
            let is_same = !bound.key.regions || self.front_in_region == run.in_region;
            far.code = if is_same { far.code } else { self.front.code };
            let mut front = self.front;
            opacity = close_slab(along, self.front_in_region, &mut front, &mut far, sum);
            if kind.preintegrated && is_same {
                back.light = far.light;
            }
        }
        if kind.surfaces && run.k == self.k_entry && shows {
            for surface in 0..style.surface_count as usize {
                if run.code >= style.codes[surface][0] {
                    add(sum, surface_at(along, surface, run.k, true));
                }
            }
        }
        if kind.preintegrated {
            // The slabs within the run.
            if run.within > 0.0 && shows {
                let mut within = run.within;
                if is_cut {
                    let nodes = nodes_of(bound, run.in_region, run.code, run.code);
                    let slab = look_up(bound, false, run.in_region, nodes);
                    let first = within.min(1.0);
                    add(sum, of_length(cut_slab(along, run.in_region, nodes, slab), first));
                    within -= first;
                }
                add(sum, flat_slabs(bound, run.in_region, run.code, within));
                opacity = 1.0;
            }
        } else if run.owns > 0.0 && shows {
            let [r, g, b, alpha] = classify(bound, run.in_region, run.code);
            let mut color = [r, g, b];
            opacity = alpha.max(opacity);
            let mut rest = run.owns;
            if is_cut && alpha > 0.0 {
                let [r, g, b] = lit_color(color, light_of_entry(along));
                let first = rest.min(1.0);
                let alpha = if first == 1.0 { alpha } else { opacity_of(alpha, first) };
                add(sum, [r * alpha, g * alpha, b * alpha, alpha]);
                rest -= first;
            }
            if alpha > 0.0 && rest > 0.0 {
                if kind.light.is_some() && !run.is_flat {
                    let light = *back.light.get_or_insert_with(|| light_at(along, p));
                    color = lit_color(color, light);
                }
                let alpha = if rest == 1.0 { alpha } else { opacity_of(alpha, rest) };
                add(sum, [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha]);
            }
        }
        back.k = run.k + run.within;
        self.front = back;
        self.front_in_region = run.in_region;
        opacity > 0.0
    }
}

/// Closes the slab between two positions, isosurfaces in it; the opacity that it adds, surfaces and all.
#[inline(always)]
fn close_slab(along: &Along<'_>, in_region: bool, front: &mut End, back: &mut End, sum: &mut Premul) -> f32 {
    let kind = along.bound.key.take.slab_kind();
    let mut opacity = 0.0;
    if kind.surfaces {
        let style = along.style();
        let (first, count) = (*front, style.surface_count as usize);
        let rises = back.code > first.code;
        for i in 0..count {
            let surface = if rises { i } else { count - 1 - i };
            let value = style.codes[surface][0];
            if (first.code >= value) == (back.code >= value) {
                continue;
            }
            let Some(met) = crossing(along, &first, back, value) else { continue };
            let mut here = End { code: value, k: met.max(front.k), light: None, is_cut: first.is_cut };
            if kind.preintegrated {
                let length = here.k - front.k;
                add(sum, slab_between(along, in_region, front, &mut here, length));
            }
            add(sum, surface_at(along, surface, here.k, false));
            opacity = 1.0;
            *front = here;
        }
    }
    if kind.preintegrated {
        let rest = slab_between(along, in_region, front, back, back.k - front.k);
        add(sum, rest);
        opacity = rest[3].max(opacity);
    }
    opacity
}

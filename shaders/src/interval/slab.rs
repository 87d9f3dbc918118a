//! What a single sample and a slab may add, where their values and their light are only known to lie between ends.

use brickcast_volume::preintegration::extremes::{Channels, few};
use brickcast_volume::style::Lighting;
use brickcast_volume::transfer_function::Shown;
use brickcast_volume::transfer_function::extremes::{Span, around};

use super::light::{LitSpan, UNLIT, light_at, light_between};
use super::pixel::Sample;
use super::read::SpanReader;
use super::tables::IntervalTables;
use crate::twin::bindings::Along;
use crate::twin::light::light_of_entry;
use crate::twin::scene::styled::place_at;

/// An end of a slab.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    pub(super) span: Span,
    /// In steps along the ray.
    pub(super) k: f32,
    pub(super) light: Option<LitSpan>,
    pub(super) in_region: bool,
    /// What follows, up to the next sample, is lit as the cut by which the ray enters.
    pub(super) is_cut: bool,
}

/// What all samples of a ray in a brick share.
#[derive(Debug)]
pub(super) struct Scenery<'a> {
    pub(super) along: &'a Along<'a>,
    pub(super) reader: SpanReader<'a>,
    pub(super) tables: &'a IntervalTables,
    /// None: colours as they are.
    pub(super) lighting: Option<Lighting>,
}

impl Scenery<'_> {
    /// Which tables serve.
    pub(super) fn kind(&self, in_region: bool) -> bool {
        self.along.bound.key.regions && in_region
    }

    /// The light at an end, computed once.
    fn light_of(&self, end: &mut End) -> LitSpan {
        let light = || light_at(self.along, &self.reader, place_at(self.along, end.k));
        *end.light.get_or_insert_with(light)
    }

    /// One single sample of the values of an end, at its place.
    pub(super) fn sample(&self, end: &mut End) -> Option<Sample> {
        let shown = self.tables.single(self.kind(end.in_region)).over(end.span);
        if shown.is_clear() || self.lighting.is_none() {
            return Sample::of(shown);
        }
        let light = if end.is_cut { LitSpan::known(light_of_entry(self.along)) } else { self.light_of(end) };
        lit(shown, light)
    }

    /// The slab from one end to another; one of two kinds is the front's.
    pub(super) fn slab(&self, front: &mut End, back: &mut End) -> Option<Sample> {
        let (kind, is_same) = (self.kind(front.in_region), self.kind(front.in_region) == self.kind(back.in_region));
        let tables = self.tables.slabs(kind)?;
        let place = |span: Span| span.map(|code| tables.place(code));
        let (x, y) = (place(front.span), if is_same { place(back.span) } else { place(front.span) });
        let slab = tables.over(x, y);
        if slab.shown.is_clear() {
            return None;
        }
        let Some(lighting) = self.lighting else {
            return Some(Sample { alpha: slab.shown.alpha, color: slab.shown.color, premul: slab.premul });
        };
        let weights = || {
            let slabs = tables.slabs();
            let lit = slabs.lit.as_ref()?;
            Some((few(&lit.front, slabs.size, x, y)?, few(&lit.back, slabs.size, x, y)?))
        };
        let alpha = slab.shown.alpha;
        let all = |light| under(slab.premul, alpha, light);
        let (light, premul) = match lighting {
            _ if front.is_cut => {
                let light = LitSpan::known(light_of_entry(self.along));
                (light, Some(all(light)))
            }
            Lighting::Interpolated => {
                let ends = [self.light_of(front), self.light_of(back)];
                let of_weights = |(near, far): (Channels, Channels)| interpolated(near, far, alpha, ends);
                let premul = if ends == [UNLIT; 2] { Some(all(UNLIT)) } else { weights().map(of_weights) };
                (ends[0].or(ends[1]), premul)
            }
            Lighting::Center => {
                let light = light_at(self.along, &self.reader, place_at(self.along, 0.5 * (front.k + back.k)));
                (light, Some(all(light)))
            }
            Lighting::Centroid => {
                let share = weights().map_or([0.0, 1.0], |(_, far)| {
                    let least = far[3][0] / alpha[1];
                    let most = if alpha[0] > 0.0 { far[3][1] / alpha[0] } else { 1.0 };
                    [least.clamp(0.0, 1.0), most.clamp(0.0, 1.0)]
                });
                let [from, to] = share.map(|part| place_at(self.along, front.k + (back.k - front.k) * part));
                let light = light_between(self.along, &self.reader, from, to);
                (light, Some(all(light)))
            }
        };
        let sample = lit(slab.shown, light)?;
        let narrower = |(a, b): (Span, Span)| [a[0].max(b[0]), a[1].min(b[1])];
        let premul = premul.map_or(sample.premul, |p| std::array::from_fn(|c| narrower((p[c], sample.premul[c]))));
        Some(Sample { premul, ..sample })
    }
}

fn lit(shown: Shown, light: LitSpan) -> Option<Sample> {
    Sample::of(Shown { color: shown.color.map(|c| light.on(c)), ..shown })
}

/// A slab under one light: no brighter than its opacity.
fn under(premul: [Span; 3], alpha: Span, light: LitSpan) -> [Span; 3] {
    premul.map(|c| std::array::from_fn(|i| (c[i] * light.factor[i] + alpha[i] * light.glint[i]).min(alpha[i])))
}

/// A slab under the light of both ends, from the parts of it that go with either.
fn interpolated(near: Channels, far: Channels, alpha: Span, [first, second]: [LitSpan; 2]) -> [Span; 3] {
    let far_opacity = far[3];
    let near_opacity = [(alpha[0] - far_opacity[1]).max(0.0), (alpha[1] - far_opacity[0]).max(0.0)];
    std::array::from_fn(|c| {
        std::array::from_fn(|i| {
            let glint = near_opacity[i] * first.glint[i] + far_opacity[i] * second.glint[i];
            (near[c][i] * first.factor[i] + far[c][i] * second.factor[i] + glint).min(alpha[i])
        })
    })
}

/// What an isosurface adds by which a ray enters the volume, where the value there is above it, or may be.
pub(super) fn surface_of_entry(along: &Along<'_>, surface: usize, span: Span) -> Option<Sample> {
    let style = along.style();
    let (value, [r, g, b, alpha]) = (style.codes[surface][0], style.colors[surface]);
    let light =
        if along.bound.key.take.slab_kind().light.is_some() { LitSpan::known(light_of_entry(along)) } else { UNLIT };
    let least = if span[0] >= value { alpha } else { 0.0 };
    let most = if span[1] >= value { alpha } else { 0.0 };
    lit(Shown { color: [r, g, b].map(|c| [c, c]), alpha: around([least; 2], [most; 2]) }, light)
}

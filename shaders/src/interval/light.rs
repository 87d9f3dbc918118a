//! Between which factors light lies at a place whose gradient is only known to lie in a box.

use brickcast_volume::transfer_function::extremes::{Span, around};

use super::read::SpanReader;
use crate::twin::bindings::Along;
use crate::twin::light::Lit;
use crate::twin::power::power;
use crate::twin::ray::dot;
use crate::twin::read::clamped;
use crate::twin::scene::styled::inside;

/// Between which ends a [`Lit`] lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LitSpan {
    /// What a colour is multiplied by ...
    pub(super) factor: Span,
    /// ... and how much white is added per opacity.
    pub(super) glint: Span,
}

/// Where the gradient vanishes.
pub(super) const UNLIT: LitSpan = LitSpan { factor: [1.0; 2], glint: [0.0; 2] };

/// Rounding of what is computed here and there in another order.
const ROUNDING: f32 = 2e-6;

impl LitSpan {
    pub(super) fn known(Lit { factor, glint }: Lit) -> Self {
        Self { factor: [factor; 2], glint: [glint; 2] }
    }

    pub(super) fn or(self, other: Self) -> Self {
        Self { factor: around(self.factor, other.factor), glint: around(self.glint, other.glint) }
    }

    /// A straight colour under it, no brighter than white.
    pub(super) fn on(&self, color: Span) -> Span {
        std::array::from_fn(|i| (color[i] * self.factor[i] + self.glint[i]).min(1.0))
    }
}

/// Of a place.
pub(super) fn light_at(along: &Along<'_>, reader: &SpanReader<'_>, p: [f32; 3]) -> LitSpan {
    let style = along.style();
    let mut gradient = [[0.0; 2]; 3];
    for (a, part) in gradient.iter_mut().enumerate() {
        let (mut ahead, mut behind) = (p, p);
        ahead[a] += 1.0;
        behind[a] -= 1.0;
        let ends = (reader.at(inside(style, ahead)), reader.at(inside(style, behind)));
        let (Some(ahead), Some(behind)) = ends else { return UNLIT };
        *part = difference(along, a, ahead, behind);
    }
    let lit = of_gradient(along, gradient);
    // A leap counts as unlit, up to where its support ends.
    if reader.may_be_leapt(p) { lit.or(UNLIT) } else { lit }
}

/// Of all places between two.
pub(super) fn light_between(along: &Along<'_>, reader: &SpanReader<'_>, from: [f32; 3], to: [f32; 3]) -> LitSpan {
    if from == to {
        return light_at(along, reader, from);
    }
    let (style, mut may_be_unlit, mut gradient) = (along.style(), false, [[0.0; 2]; 3]);
    for (a, part) in gradient.iter_mut().enumerate() {
        let moved = |by: f32| {
            let [from, to] = [from, to].map(|mut p| {
                p[a] += by;
                inside(style, p)
            });
            reader.hull(from, to)
        };
        let (ahead, behind) = (moved(1.0), moved(-1.0));
        may_be_unlit |= ahead.lacks_data || behind.lacks_data || ahead.meets_regions || behind.meets_regions;
        *part = difference(along, a, ahead.span, behind.span);
    }
    let lit = of_gradient(along, gradient);
    if may_be_unlit { lit.or(UNLIT) } else { lit }
}

fn difference(along: &Along<'_>, axis: usize, ahead: Span, behind: Span) -> Span {
    let half = 0.5 * along.frame().voxels_per_unit[axis];
    [(ahead[0] - behind[1]) * half, (ahead[1] - behind[0]) * half]
}

/// `1 + s (F - 1)`, s by the gradient's length and F by its direction, each between its ends.
fn of_gradient(along: &Along<'_>, gradient: [Span; 3]) -> LitSpan {
    let (style, per_unit) = (along.style(), along.frame().voxels_per_unit);
    let most = gradient.map(|[lo, hi]| lo.abs().max(hi.abs()));
    let least = gradient.map(|[lo, hi]| if lo <= 0.0 && hi >= 0.0 { 0.0 } else { lo.abs().min(hi.abs()) });
    let length = [dot(least, least).sqrt(), dot(most, most).sqrt()];
    let strength = length.map(|length| {
        let part = clamped(length * (1.0 + ROUNDING) / style.light_from - 1.0, 1.0);
        part * part * (3.0 - 2.0 * part)
    });
    if strength[1] == 0.0 {
        return UNLIT;
    }
    let to_eye: [f32; 3] = std::array::from_fn(|a| -along.ray.direction[a] / per_unit[a]);
    let to_light = if style.light == [0.0; 3] { to_eye } else { style.light };
    let half: [f32; 3] = std::array::from_fn(|a| to_light[a] + to_eye[a]);
    let half_length = dot(half, half).sqrt().max(1e-6);
    let facing = cosine(gradient, to_light, length);
    let side = |[lo, hi]: Span, flips: bool| if flips { [-hi, -lo] } else { [lo, hi] };
    let shining = cosine(gradient, half.map(|h| h / half_length), length);
    let shine = match facing {
        [lo, _] if lo > 0.0 => shining,
        [_, hi] if hi < 0.0 => side(shining, true),
        _ => around(shining, side(shining, true)),
    };
    let diffuse = if facing[0] <= 0.0 && facing[1] >= 0.0 {
        [0.0, facing[1].max(-facing[0])]
    } else {
        let ends = facing.map(f32::abs);
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    };
    let change = diffuse.map(|part| style.ambient + style.diffuse * part.min(1.0) - 1.0);
    let products = [strength[0] * change[0], strength[0] * change[1], strength[1] * change[0], strength[1] * change[1]];
    let least = products.into_iter().fold(f32::INFINITY, f32::min);
    let most = products.into_iter().fold(f32::NEG_INFINITY, f32::max);
    let glint = |i: usize| style.specular * power(clamped(shine[i], 1.0), style.shininess) * strength[i];
    LitSpan {
        factor: [(1.0 + least - ROUNDING).max(0.0), 1.0 + most + ROUNDING],
        glint: [(glint(0) - ROUNDING).max(0.0), glint(1) + ROUNDING],
    }
}

/// Of the angle between a gradient and a direction of length one.
fn cosine(gradient: [Span; 3], direction: [f32; 3], [least, most]: Span) -> Span {
    let (mut lo, mut hi) = (0.0, 0.0);
    for (part, d) in gradient.into_iter().zip(direction) {
        let ends = part.map(|g| g * d);
        lo += ends[0].min(ends[1]);
        hi += ends[0].max(ends[1]);
    }
    let share = |dot: f32, length: f32| if length > 0.0 { dot / length } else { dot.signum() };
    let lo = if lo >= 0.0 { share(lo, most) } else { share(lo, least) };
    let hi = if hi <= 0.0 { share(hi, most) } else { share(hi, least) };
    [(lo - ROUNDING).max(-1.0), (hi + ROUNDING).min(1.0)]
}

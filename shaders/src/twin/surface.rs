//! `wgsl/shared/surface.wgsl` on the CPU: isosurfaces (Krueger & Westermann 2003, section 4).

use super::bindings::Along;
use super::holes::is_no_data;
use super::light::{light_at, light_of_entry, lit_color, value_at};
use super::read::clamped;
use super::scene::styled::place_at;
use super::slab::End;

/// Halvings of a slab in which an isosurface lies: to 1/64 step, before the last interpolation.
pub const BISECTIONS: u32 = 6;

/// Where the ray has `value` between two samples on either side of it, in steps: bisection, then a line. None where a
/// place between holds no data.
pub(super) fn crossing(along: &Along<'_>, front: &End, back: &End, value: f32) -> Option<f32> {
    let (mut lo, mut hi) = (0.0_f32, 1.0_f32);
    let (mut at_lo, mut at_hi) = (front.code, back.code);
    let is_above = at_lo >= value;
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (lo + hi);
        let code = value_at(along, place_at(along, front.k + middle));
        if is_no_data(code) {
            return None;
        }
        if (code >= value) == is_above {
            (lo, at_lo) = (middle, code);
        } else {
            (hi, at_hi) = (middle, code);
        }
    }
    let rise = at_hi - at_lo;
    let part = if rise == 0.0 { 0.5 } else { clamped((value - at_lo) / rise, 1.0) };
    Some(front.k + lo + (hi - lo) * part)
}

/// An isosurface that the ray meets at `k` steps, or with its entry; premultiplied.
#[inline(always)]
pub(super) fn surface_at(along: &Along<'_>, surface: usize, k: f32, is_entry: bool) -> [f32; 4] {
    let [r, g, b, alpha] = along.style().colors[surface];
    let mut color = [r, g, b];
    if along.bound.key.take.slab_kind().light.is_some() {
        let light = if is_entry { light_of_entry(along) } else { light_at(along, place_at(along, k)) };
        color = lit_color(color, light);
    }
    [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha]
}

//! `wgsl/shared/surface.wgsl` on the CPU: isosurfaces (Krueger & Westermann 2003, section 4).

use brickcast_volume::Premul;

use super::accelerated::Watch;
use super::holes::is_no_data;
use super::integral::Integrals;
use super::light::{Lit, Probe};
use super::raycast::clamped;
use super::slab::{End, add, lit_color};

/// Halvings of a slab in which an isosurface lies: to 1/64 step, before the last interpolation.
const BISECTIONS: u32 = 6;

/// Where the ray has `value` between two samples on either side of it: bisection, then a line. Nowhere where a place
/// between holds no data.
pub(super) fn crossing(probe: &Probe<'_>, (front, back): (&End, &End), value: f32) -> Option<f32> {
    let (mut lo, mut hi) = (0.0_f32, 1.0_f32);
    let (mut at_lo, mut at_hi) = (front.code, back.code);
    let is_above = at_lo >= value;
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (lo + hi);
        let code = probe.value(probe.place(front.k + middle));
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

/// Adds an isosurface that the ray meets at `k` steps.
#[inline(always)]
pub(super) fn meet<W: Watch>(
    sum: &mut Premul,
    with: &Integrals<'_>,
    surface: usize,
    (k, step): (f32, f32),
    light: impl FnOnce() -> Lit,
    watch: &mut W,
) {
    watch.meets(surface, k * step);
    let [r, g, b, alpha] = with.style.colors[surface];
    let mut color = [r, g, b];
    if with.take.slab_kind().light.is_some() {
        color = lit_color(color, light());
    }
    add(sum, [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha]);
}

//! `wgsl/shared/slab.wgsl` on the CPU: the integral of the transfer function between two values, and what it adds to a
//! ray.

use brickcast_volume::Premul;
use brickcast_volume::style::Lighting;

use super::bindings::{Along, Bindings, SlabTable};
use super::classify::entry_at;
use super::light::{Lit, UNLIT, light_at, light_of_entry};
use super::power::power;
use super::read::{between, clamped};
use super::scene::styled::place_at;

/// An end of a slab, or a place between.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    pub(super) code: f32,
    /// In steps along the ray.
    pub(super) k: f32,
    pub(super) light: Option<Lit>,
    /// What follows, up to the next sample, is lit as the cut by which the ray enters.
    pub(super) is_cut: bool,
}

/// A node of a table, and how far on to the next one.
pub(super) type Node = (usize, f32);

/// Premultiplied, behind what is there.
#[inline(always)]
pub(super) fn add(sum: &mut Premul, [r, g, b, a]: [f32; 4]) {
    let through = 1.0 - sum.a;
    sum.r += through * r;
    sum.g += through * g;
    sum.b += through * b;
    sum.a += through * a;
}

/// `color` premultiplied, of a slab of opacity `a`, as of one that is `length` times as long (docs/algorithms.md,
/// Integration).
#[inline(always)]
pub(super) fn of_length([r, g, b, a]: [f32; 4], length: f32) -> [f32; 4] {
    if length == 1.0 {
        return [r, g, b, a];
    }
    let clear = 1.0 - a;
    let longer = 1.0 - if clear > 0.0 { power(clear, length) } else { 0.0 };
    let scale = if a > 1e-6 { longer / a } else { length };
    [r * scale, g * scale, b * scale, longer]
}

/// Where a code stands among the nodes of the slabs.
#[inline(always)]
pub(super) fn node_of(table: &SlabTable<'_>, code: f32) -> Node {
    let at = clamped(code * table.scale, table.warp.len() as f32);
    let i = (at as i32).min(table.warp.len() as i32 - 1);
    let [start, growth] = table.warp.get(i as usize).copied().unwrap_or_default();
    entry_at(start + (at - i as f32) * growth, table.size - 1)
}

/// The table for slabs of a kind.
#[inline(always)]
fn table_of<'a>(bound: &Bindings<'a>, in_region: bool) -> Option<&'a SlabTable<'a>> {
    bound.scene.slabs.as_ref().map(|tables| &tables[usize::from(bound.key.regions && in_region)])
}

/// Of the front value, and of the back value.
#[inline(always)]
pub(super) fn nodes_of(bound: &Bindings<'_>, in_region: bool, front: f32, back: f32) -> [Node; 2] {
    table_of(bound, in_region).map_or([(0, 0.0); 2], |table| [node_of(table, front), node_of(table, back)])
}

#[inline(always)]
pub(super) fn look_up(bound: &Bindings<'_>, is_back: bool, in_region: bool, nodes: [Node; 2]) -> [f32; 4] {
    let Some(table) = table_of(bound, in_region) else { return [0.0; 4] };
    slab_of(if is_back { table.back } else { table.front }, table.size, nodes)
}

/// A slab of one step between two nodes: bilinear.
#[inline(always)]
fn slab_of(slabs: &[[f32; 4]], size: usize, [(i, u), (j, v)]: [Node; 2]) -> [f32; 4] {
    let at = i * size + j;
    let Some(support) = slabs.get(at..at + size + 2) else { return [0.0; 4] };
    let [a, b, c, d] = [support[0], support[1], support[size], support[size + 1]];
    std::array::from_fn(|n| between(between(a[n], b[n], v), between(c[n], d[n], v), u))
}

/// A slab, looked up already, under the light of the cut by which the ray enters.
pub(super) fn cut_slab(along: &Along<'_>, in_region: bool, nodes: [Node; 2], [r, g, b, a]: [f32; 4]) -> [f32; 4] {
    let mut color = [r, g, b];
    if along.bound.key.take.slab_kind().has_weights() {
        let far = look_up(along.bound, true, in_region, nodes);
        color = [r + far[0], g + far[1], b + far[2]];
    }
    let light = light_of_entry(along);
    let [r, g, b] = color.map(|c| (c * light.factor + a * light.glint).min(a));
    [r, g, b, a]
}

/// The slab from `front` to `back`, `length` steps long, premultiplied; learns the light of its ends.
#[inline(always)]
pub(super) fn slab_between(
    along: &Along<'_>,
    in_region: bool,
    front: &mut End,
    back: &mut End,
    length: f32,
) -> [f32; 4] {
    let bound = along.bound;
    let nodes = nodes_of(bound, in_region, front.code, back.code);
    let slab = look_up(bound, false, in_region, nodes);
    // Light on nothing need not be known.
    if slab[3] <= 0.0 {
        return [0.0; 4];
    }
    let [r, g, b, a] = slab;
    let premul = match bound.key.take.slab_kind().light {
        None => slab,
        _ if front.is_cut => cut_slab(along, in_region, nodes, slab),
        Some(Lighting::Interpolated) => {
            let far = look_up(bound, true, in_region, nodes);
            let light_of = |end: &mut End| *end.light.get_or_insert_with(|| light_at(along, place_at(along, end.k)));
            let (first, second) = (light_of(front), light_of(back));
            let glint = (a - far[3]) * first.glint + far[3] * second.glint;
            let mix = |c: usize| (slab[c] * first.factor + far[c] * second.factor + glint).min(a);
            [mix(0), mix(1), mix(2), a]
        }
        Some(Lighting::Center) => {
            // Both ends deep in a region: so is what lies between.
            let is_flat = front.light == Some(UNLIT) && back.light == Some(UNLIT);
            let light = if is_flat { UNLIT } else { light_at(along, place_at(along, 0.5 * (front.k + back.k))) };
            let under = |c: f32| (c * light.factor + a * light.glint).min(a);
            [under(r), under(g), under(b), a]
        }
        Some(Lighting::Centroid) => {
            let far = look_up(bound, true, in_region, nodes);
            let is_flat = front.light == Some(UNLIT) && back.light == Some(UNLIT);
            let k = front.k + (back.k - front.k) * (far[3] / a);
            let light = if is_flat { UNLIT } else { light_at(along, place_at(along, k)) };
            let under = |c: usize| ((slab[c] + far[c]) * light.factor + a * light.glint).min(a);
            [under(0), under(1), under(2), a]
        }
    };
    of_length(premul, length)
}

/// `n` slabs, both ends of each deep in one region, where nothing is lit; premultiplied.
#[inline(always)]
pub(super) fn flat_slabs(bound: &Bindings<'_>, in_region: bool, code: f32, n: f32) -> [f32; 4] {
    let nodes = nodes_of(bound, in_region, code, code);
    let mut slab = look_up(bound, false, in_region, nodes);
    if slab[3] <= 0.0 {
        return [0.0; 4];
    }
    if bound.key.take.slab_kind().has_weights() {
        let far = look_up(bound, true, in_region, nodes);
        for c in 0..3 {
            slab[c] += far[c];
        }
    }
    of_length(slab, n)
}

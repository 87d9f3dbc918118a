//! `wgsl/shared/slab.wgsl` on the CPU: the integral of the transfer function between two values, and what it adds to a
//! ray.

use brickcast_volume::Premul;
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::style::Lighting;
use glam::Vec4;

use super::lanes::{self, entries_at};
use super::light::{Lit, Probe, UNLIT};
use super::processor::{cut_off, indices, prefetch, whole};
use super::raycast::{clamped, entry_at};
use crate::key::SlabKind;

/// Pre-integrated slabs: by node of the front value, then of the back value.
#[derive(Debug, Clone, Copy)]
pub struct SlabTable<'a> {
    pub size: usize,
    /// Premultiplied colour and opacity of one step. With interpolated light, what the front end's light counts for,
    /// and the opacity.
    pub front: &'a [[f32; 4]],
    /// What the back end's light counts for, and the part of the opacity that goes with it; empty without interpolated
    /// light.
    pub back: &'a [[f32; 4]],
    /// [`brickcast_volume::preintegration::Preintegrated::shown_before`].
    pub shown_before: &'a [u32],
    /// [`Preintegrated::warp`].
    warp: &'a [[f32; 2]],
    /// Blocks of the warp per code (0..=1).
    scale: f32,
}

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

impl<'a> SlabTable<'a> {
    /// `tables`: front and back, of `slabs`.
    #[must_use]
    pub fn new(slabs: &'a Preintegrated, [front, back]: [&'a [[f32; 4]]; 2]) -> Self {
        let (size, shown_before, warp) = (slabs.size, &slabs.shown_before[..], &slabs.warp[..]);
        // All blocks are 65,536 codes.
        Self { size, front, back, shown_before, warp, scale: warp.len() as f32 * (65535.0 / 65536.0) }
    }
}

impl SlabTable<'_> {
    /// The node below a code, and how far on to the next it lies.
    #[inline(always)]
    pub(super) fn entry(&self, code: f32) -> (usize, f32) {
        let at = clamped(code * self.scale, self.warp.len() as f32);
        let i = cut_off(at).min(self.warp.len() as i32 - 1);
        let [start, growth] = self.warp.get(i as usize).copied().unwrap_or_default();
        entry_at(start + (at - i as f32) * growth, self.size - 1)
    }

    /// [`SlabTable::entry`] in every lane.
    #[inline(always)]
    pub(super) fn entries(&self, codes: Vec4) -> (Vec4, Vec4) {
        let blocks = self.warp.len() as f32;
        let at = lanes::clamped(codes * Vec4::splat(self.scale), blocks);
        let i = whole(at).min(Vec4::splat(blocks - 1.0));
        let of = indices(i).map(|i| self.warp.get(i).copied().unwrap_or_default());
        let start = Vec4::new(of[0][0], of[1][0], of[2][0], of[3][0]);
        let growth = Vec4::new(of[0][1], of[1][1], of[2][1], of[3][1]);
        entries_at(start + (at - i) * growth, self.size - 1)
    }

    #[inline(always)]
    fn look_up(&self, table: &[[f32; 4]], front: f32, back: f32) -> [f32; 4] {
        self.between(table, self.entry(front), self.entry(back)).to_array()
    }

    /// Do slabs from entries within lo..=hi to such show anything?
    #[inline(always)]
    pub(super) fn shows(&self, lo: usize, hi: usize) -> bool {
        self.shown_before.get(hi + 2).is_none_or(|after| *after != self.shown_before[lo])
    }

    /// Says that the slab between two entries will be looked up.
    #[inline(always)]
    pub(super) fn prefetch(&self, i: usize, j: usize) {
        for row in [i, i + 1] {
            prefetch(self.front.as_ptr().wrapping_add(row * self.size + j));
        }
    }

    /// Bilinear.
    #[inline(always)]
    pub(super) fn between(&self, table: &[[f32; 4]], (i, u): (usize, f32), (j, v): (usize, f32)) -> Vec4 {
        let at = i * self.size + j;
        let Some(support) = table.get(at..at + self.size + 2) else { return Vec4::ZERO };
        let [a, b] = [support[0], support[1]].map(Vec4::from_array);
        let [c, d] = [support[self.size], support[self.size + 1]].map(Vec4::from_array);
        let (near, far) = (a + (b - a) * v, c + (d - c) * v);
        near + (far - near) * u
    }
}

/// `color` premultiplied, of a slab of opacity `a`, as of one that is `length` times as long (docs/algorithms.md,
/// Integration).
#[inline(always)]
fn of_length([r, g, b, a]: [f32; 4], length: f32) -> [f32; 4] {
    if length == 1.0 {
        return [r, g, b, a];
    }
    let clear = 1.0 - a;
    let longer = 1.0 - if clear > 0.0 { clear.powf(length) } else { 0.0 };
    let scale = if a > 1e-6 { longer / a } else { length };
    [r * scale, g * scale, b * scale, longer]
}

/// Premultiplied, behind what is there.
#[inline(always)]
pub(super) fn add(sum: &mut Premul, [r, g, b, a]: [f32; 4]) {
    let through = 1.0 - sum.a;
    sum.r += through * r;
    sum.g += through * g;
    sum.b += through * b;
    sum.a += through * a;
}

/// Straight colour under a light; no brighter than white.
#[inline(always)]
pub(super) fn lit_color([r, g, b]: [f32; 3], light: Lit) -> [f32; 3] {
    [r, g, b].map(|c| (c * light.factor + light.glint).min(1.0))
}

/// Adds the slab from `front` to `back`, `length` steps long; returns its opacity.
#[inline(always)]
pub(super) fn add_slab(
    sum: &mut Premul,
    table: &SlabTable<'_>,
    kinds: SlabKind,
    probe: &Probe<'_>,
    (front, back): (&mut End, &mut End),
    length: f32,
) -> f32 {
    let slab = table.look_up(table.front, front.code, back.code);
    // Adding nothing changes no bit, and light on nothing need not be known.
    if slab[3] <= 0.0 {
        return 0.0;
    }
    let [r, g, b, a] = slab;
    let premul = match kinds.light {
        None => slab,
        _ if front.is_cut => cut_slab(table, kinds, probe, (front.code, back.code), slab),
        Some(Lighting::Interpolated) => {
            let far = table.look_up(table.back, front.code, back.code);
            let at = |end: &mut End| *end.light.get_or_insert_with(|| probe.light(probe.place(end.k)));
            let (first, second) = (at(front), at(back));
            let glint = (a - far[3]) * first.glint + far[3] * second.glint;
            let mix = |c: usize| (slab[c] * first.factor + far[c] * second.factor + glint).min(a);
            [mix(0), mix(1), mix(2), a]
        }
        Some(Lighting::Centroid) => {
            let far = table.look_up(table.back, front.code, back.code);
            let is_flat = front.light == Some(UNLIT) && back.light == Some(UNLIT);
            let k = front.k + (back.k - front.k) * (far[3] / a);
            let light = if is_flat { UNLIT } else { probe.light(probe.place(k)) };
            let under = |c: usize| ((slab[c] + far[c]) * light.factor + a * light.glint).min(a);
            [under(0), under(1), under(2), a]
        }
        Some(Lighting::Center) => {
            // Both ends deep in a region: so is what lies between.
            let is_flat = front.light == Some(UNLIT) && back.light == Some(UNLIT);
            let light = if is_flat { UNLIT } else { probe.light(probe.place(0.5 * (front.k + back.k))) };
            let under = |c: f32| (c * light.factor + a * light.glint).min(a);
            [under(r), under(g), under(b), a]
        }
    };
    add(sum, of_length(premul, length));
    a
}

/// A slab, looked up already, under the light of the cut by which the ray enters.
fn cut_slab(
    table: &SlabTable<'_>,
    kinds: SlabKind,
    probe: &Probe<'_>,
    (front, back): (f32, f32),
    [r, g, b, a]: [f32; 4],
) -> [f32; 4] {
    let mut color = [r, g, b];
    if kinds.has_weights() {
        let far = table.look_up(table.back, front, back);
        color = [r + far[0], g + far[1], b + far[2]];
    }
    let light = probe.light_of_entry();
    let [r, g, b] = color.map(|c| (c * light.factor + a * light.glint).min(a));
    [r, g, b, a]
}

/// Adds the first of a run's slabs where it is a cut's, both ends of it deep in one region.
pub(super) fn add_cut(sum: &mut Premul, table: &SlabTable<'_>, kinds: SlabKind, probe: &Probe<'_>, code: f32) {
    let slab = table.look_up(table.front, code, code);
    if slab[3] > 0.0 {
        add(sum, cut_slab(table, kinds, probe, (code, code), slab));
    }
}

/// Adds `n` slabs, both ends of each deep in one region, where nothing is lit.
#[inline(always)]
pub(super) fn add_flat(sum: &mut Premul, table: &SlabTable<'_>, kinds: SlabKind, code: f32, n: f32) {
    let mut slab = table.look_up(table.front, code, code);
    if slab[3] <= 0.0 {
        return;
    }
    if kinds.has_weights() {
        let far = table.look_up(table.back, code, code);
        for c in 0..3 {
            slab[c] += far[c];
        }
    }
    add(sum, of_length(slab, n));
}

#[cfg(test)]
mod tests {
    use brickcast_volume::preintegration::Preintegrated;
    use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};

    use super::SlabTable;

    #[test]
    fn what_is_not_looked_up_shows_nothing() {
        let color = |x: f64| ColorPoint { x, rgb: [0.5, 0.25, 1.0] };
        // A ramp, two spikes, and a last one that rises.
        let opacity = |(x, opacity): (f64, f64)| OpacityPoint { x, opacity };
        let points =
            [(0.0, 0.3), (10.0, 0.0), (20.2, 0.0), (20.5, 0.9), (20.8, 0.0), (40.0, 0.0), (41.0, 0.2), (42.0, 0.0)];
        let points = points.into_iter().chain([(62.5, 0.0), (63.0, 0.5)]);
        let function = TransferFunction::new(vec![color(0.0), color(63.0)], points.map(opacity).collect()).unwrap();
        let slabs = Preintegrated::with_entries(&function, (0.0, 63.0), 1.0, 64, false);
        let n = slabs.size;
        let table = SlabTable::new(&slabs, [&slabs.total, &[]]);
        let (mut dark, mut shown) = (0, 0);
        for (front, back) in (0..n - 1).flat_map(|front| (0..n - 1).map(move |back| (front, back))) {
            let entries = [(0, 0), (0, 1), (1, 0), (1, 1)];
            let is_dark = entries.iter().all(|(i, j)| slabs.total[(front + i) * n + back + j] == [0.0; 4]);
            let shows = table.shows(front.min(back), front.max(back));
            assert!(is_dark || shows, "slab from entry {front} to {back}");
            dark += u32::from(is_dark);
            shown += u32::from(is_dark && shows);
        }
        // Those that end just before something shows are looked up for nothing.
        assert!(dark > 100 && shown * 5 < dark, "{shown} of {dark} of {n} nodes");
    }
}

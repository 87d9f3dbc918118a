//! `wgsl/integral.wgsl` on the CPU: rays that integrate between samples (Lum, Wilson & Ma 2004), light what they meet,
//! find isosurfaces (Krueger & Westermann 2003), project, and are clipped; with the leaps and skips of the accelerated
//! kernel.
//!
//! The invariant: a brick visits the positions of its owned samples and, where slabs matter, the first one beyond.
//! Every turn takes a run of positions that have one value, closes the slab that ends at the run's first position, and
//! adds the slabs within the run. So slab k, from `t_k` to `t_(k+1)`, belongs to the owner of `t_k`, is closed once,
//! and sees the same two values whatever the partition (docs/adr/0006-integral.md).

use brickcast_volume::Premul;
use brickcast_volume::macrocell::MapTexel;
use brickcast_volume::regions::code::{CodedTexel, MAX_DENSITY};

use super::accelerated::{
    BrickData, Classifier, MARGIN, MARGIN_SHARE, NEARLY_EQUAL, NOTHING_YET, RayCounts, Tables, Watch, first_outside,
    leaves, opacity_of, sample_at,
};
use super::holes::is_no_data;
use super::light::{Probe, UNLIT};
use super::processor::cut_off;
use super::raycast::{FAR, Ray, first_sample, owned_segment};
use super::slab::{End, SlabTable, add, add_cut, add_flat, add_slab, lit_color};
use super::surface::{crossing, meet};
use crate::key::TakeKind;
use crate::layout::{BrickUniform, FrameUniform, MAP_EMPTY, RegionFlags, SHOWS_REGIONS, SHOWS_RESIDUAL};
use crate::style::StyleUniform;

/// What a ray reads that is not its brick's.
#[derive(Debug, Clone, Copy)]
pub struct Integrals<'a> {
    /// For single samples.
    pub tables: Tables<'a>,
    /// For slabs outside and inside regions.
    pub slabs: Option<[SlabTable<'a>; 2]>,
    pub style: &'a StyleUniform,
    pub take: TakeKind,
}

/// What clipping leaves of a ray: `[t_lo, t_hi)`.
#[inline(always)]
pub(super) fn clipped(style: &StyleUniform, ray: &Ray) -> (f32, f32) {
    let (mut t_lo, mut t_hi) = (0.0_f32, FAR);
    for [nx, ny, nz, w] in &style.planes[..style.plane_count as usize] {
        let inside = nx * ray.origin[0] + ny * ray.origin[1] + nz * ray.origin[2] - w;
        let along = nx * ray.direction[0] + ny * ray.direction[1] + nz * ray.direction[2];
        if along == 0.0 {
            if inside < 0.0 {
                return (FAR, -1.0);
            }
            continue;
        }
        let t = -inside / along;
        if along > 0.0 {
            t_lo = t_lo.max(t);
        } else {
            t_hi = t_hi.min(t);
        }
    }
    (t_lo, t_hi)
}

/// Clips that end no deeper in the volume than this count as its own faces; in units of t.
const LEAST_CUT: f32 = 1e-3;

/// Where the ray enters the volume, were it endless; t.
#[inline(always)]
fn volume_entry(style: &StyleUniform, ray: &Ray) -> f32 {
    let mut t_in = 0.0_f32;
    for a in 0..3 {
        if ray.direction[a] != 0.0 {
            let at_lo = (0.0 - ray.origin[a]) * ray.inverse[a];
            let at_hi = (style.volume_hi[a] as f32 - ray.origin[a]) * ray.inverse[a];
            t_in = t_in.max(at_lo.min(at_hi));
        }
    }
    t_in
}

/// The first sample behind the cut by which clipping lets the ray in at `t_lo`; -1 where the volume's own face does, or
/// nothing.
#[inline(always)]
fn first_behind_cut(frame: &FrameUniform, style: &StyleUniform, ray: &Ray, t_lo: f32) -> f32 {
    if t_lo <= volume_entry(style, ray) + LEAST_CUT { -1.0 } else { first_sample(frame, t_lo) }
}

/// The position before the present one.
#[derive(Clone, Copy)]
struct Front {
    end: End,
    in_region: bool,
    /// In an empty macrocell.
    is_empty: bool,
}

/// The samples and slabs of `brick` along `ray`, into `sum`: the four f32 of an accumulator, whose meaning
/// [`TakeKind::pixel_kind`] says.
#[must_use]
pub fn integral_ray<W: Watch>(
    frame: &FrameUniform,
    brick: &BrickUniform,
    data: &BrickData<'_>,
    with: &Integrals<'_>,
    ray: &Ray,
    mut sum: Premul,
    watch: &mut W,
) -> (Premul, RayCounts) {
    let mut counts = RayCounts::default();
    let Integrals { tables, style, take, .. } = *with;
    let (kinds, pixel_kind) = (take.slab_kind(), take.pixel_kind());
    // Most rays of a tile miss most bricks.
    let Some(mut owned) = owned_segment(frame, brick, ray) else { return (sum, counts) };
    let (t_lo, t_hi) = if style.plane_count == 0 { (0.0, FAR) } else { clipped(style, ray) };
    owned.t_out = owned.t_out.min(t_hi);
    if t_lo > 0.0 {
        owned.k = owned.k.max(first_sample(frame, t_lo));
    }
    if sum.a >= frame.stop_alpha || tables.table.len() < 2 || owned.k * frame.step >= owned.t_out {
        return (sum, counts);
    }
    let main = Classifier { table: tables.table, first: frame.table_first, scale: frame.table_scale };
    let region = Classifier {
        table: tables.region.unwrap_or(tables.table),
        first: frame.region_first,
        scale: frame.region_scale,
    };
    let probe = Probe::new(frame, style, brick, data, ray);
    let k_out = first_outside(frame, owned.k, owned.t_out);
    let has_slabs = take.ends_beyond();
    let is_projection = take.is_projection();
    let k_last = if has_slabs { k_out } else { k_out - 1.0 };
    let largest = (0..3).fold(0.0_f32, |m, a| m.max(ray.origin[a].abs()).max(brick.owned_hi[a] as f32));
    let margin = MARGIN.max(MARGIN_SHARE * largest);
    let edge = (1_u32 << brick.cell_shift) as f32;
    let has_flags = brick.region_flags == RegionFlags::Texture as u32;
    // Else all samples are of one kind.
    let tells_apart = frame.shown != SHOWS_RESIDUAL | SHOWS_REGIONS || tables.region.is_some();
    let shows = |in_region: bool| frame.shown & if in_region { SHOWS_REGIONS } else { SHOWS_RESIDUAL } != 0;
    // As its brick computes it.
    let k_entry = if kinds.surfaces { first_sample(frame, volume_entry(style, ray).max(t_lo)) } else { -1.0 };
    let may_cut = kinds.light.is_some() && !is_projection && style.plane_count > 0;
    let k_cut = if may_cut { first_behind_cut(frame, style, ray, t_lo) } else { -1.0 };

    let mut k = owned.k;
    let has_leaps = data.means.is_some();
    let mut probes = if has_leaps { W::ENTRY_PROBES } else { 0 };
    let mut last = NOTHING_YET;
    let (mut k_look, mut look) = (k, data.map.is_some());
    let asks_always = data.map.is_some() && brick.map_mask > MAP_EMPTY;
    let mut front: Option<Front> = None;
    // The positions just before k were skipped: where k is not empty, the last of them must be read.
    let mut has_skipped = false;
    // The position at k lies in an empty cell, and is read all the same.
    let mut is_empty = false;
    while k <= k_last && sum.a < frame.stop_alpha {
        // Always the product, never accumulated: the same sample in every brick.
        let p = probe.place(k);
        let (mut code, mut n) = (0.0, 0.0);
        let mut in_region = brick.region_flags == RegionFlags::EveryVoxel as u32;
        // Deep in a region or a homogeneous cube: no gradient.
        let mut is_flat = false;
        if look && let Some((map, dims)) = data.map {
            let cell: [i32; 3] = std::array::from_fn(|a| {
                ((cut_off(p[a]) >> brick.cell_shift) - brick.cell_lo[a]).clamp(0, dims[a] as i32 - 1)
            });
            let at = cell[0] as usize + dims[0] as usize * (cell[1] as usize + dims[1] as usize * cell[2] as usize);
            let MapTexel { empty, cube } = MapTexel::unpack(map[at] & brick.map_mask);
            let empty = i32::from(empty);
            // Cells know no regions: their samples may need different tables.
            let alike = if has_flags { 0 } else { i32::from(cube.distance) };
            let reach = if empty > 0 { empty } else { alike.max(1) } - 1;
            let lo = std::array::from_fn(|a| (cell[a] + brick.cell_lo[a] - reach) as f32 * edge);
            let hi = std::array::from_fn(|a| (cell[a] + brick.cell_lo[a] + 1 + reach) as f32 * edge);
            let k_exit = sample_at(frame, leaves(ray, lo, hi), k_last + 1.0).max(k + 1.0);
            if empty > 0 && is_projection {
                // Nothing there changes the projection: a run of the code that says so.
                (code, n) = (f32::from(pixel_kind.neutral_code()) / 65535.0, k_exit - k);
                counts.skips += 1;
            } else if empty > 0 && (!has_slabs || front.is_none_or(|f| f.is_empty)) {
                // Both ends of all slabs up to the one that leaves.
                counts.skips += 1;
                (k, front, has_skipped) = (k_exit, None, has_slabs);
                probes = if has_leaps { W::ENTRY_PROBES } else { 0 };
                last = NOTHING_YET;
                continue;
            } else if empty == 0 && has_skipped {
                // The slab that enters what shows starts in the empty.
                counts.skips += 1;
                (k, has_skipped, look, is_empty) = (k - 1.0, false, false, true);
                continue;
            } else {
                is_empty = empty > 0;
                k_look = if is_empty { k + 1.0 } else { k_exit };
                if !is_empty && alike > 0 {
                    (code, n, is_flat) = (f32::from(cube.value) / 65535.0, k_exit - k, true);
                    counts.leapt += n as u32;
                    counts.skips += 1;
                }
            }
        }
        if has_leaps && n == 0.0 && probes > 0 {
            counts.samples += 1;
            match CodedTexel::unpack(probe.volume.nearest(p)) {
                CodedTexel::Leap { distance, slot } => {
                    let reach = f32::from(distance) - 1.0 - margin;
                    let lo = std::array::from_fn(|a| (p[a] as i32) as f32 + 0.5 - reach);
                    let hi = std::array::from_fn(|a| (p[a] as i32) as f32 + 0.5 + reach);
                    n = (sample_at(frame, leaves(ray, lo, hi), k_last + 1.0) - k).max(1.0);
                    n = (n + W::LEAP_EXTRA).min(k_last + 1.0 - k);
                    code = data.means.and_then(|m| m.get(usize::from(slot))).copied().unwrap_or(0.0);
                    (in_region, is_flat) = (true, true);
                    counts.leapt += n as u32;
                    probes = probes.max(2) - 1;
                }
                CodedTexel::Value { density, inner: true } => {
                    (code, n) = (f32::from(density) / f32::from(MAX_DENSITY), 1.0);
                    (in_region, is_flat) = (true, true);
                    probes = probes.max(2) - 1;
                }
                CodedTexel::Value { .. } => {}
            }
        }
        if n == 0.0 {
            code = probe.trilinear(p);
            n = 1.0;
            counts.samples += 1;
            if has_flags {
                in_region = data.flags[probe.volume.nearest_index(p)] != 0;
                counts.samples += 1;
            }
            if has_leaps {
                let equal = (code - last).abs() <= NEARLY_EQUAL;
                probes = probes.saturating_sub(1).max(u32::from(equal));
            }
        }
        last = code;
        in_region &= tells_apart;
        // Positions that the brick owns.
        let taken = n.min(k_out - k).max(0.0);
        counts.positions += taken as u32;
        if is_no_data(code) {
            // No sample, and no slab ends or starts here.
            k += n;
            (front, is_empty) = (None, false);
            look = data.map.is_some() && k >= k_look;
            continue;
        }
        watch.takes(k, n, code);
        let mut opacity = 0.0;
        if is_projection {
            if shows(in_region) {
                let mut pixel = sum.to_array();
                pixel_kind.take(&mut pixel, code, n);
                sum = Premul::from_array(pixel);
            }
            look = data.map.is_some() && k + n >= k_look;
            k += n;
            continue;
        }
        let is_cut = k == k_cut;
        let mut back = End { code, k, light: is_flat.then_some(UNLIT), is_cut: is_cut && n == 1.0 };
        if let Some(front) = &mut front
            && shows(front.in_region)
        {
            let mut far = back;
            // A slab is of one kind, its front's: colours do not run from one kind into the other.
            if front.in_region != in_region {
                far.code = front.end.code;
            }
            let table = if kinds.preintegrated { with.slabs.map(|s| s[usize::from(front.in_region)]) } else { None };
            opacity = slab(&mut sum, with, table.as_ref(), &probe, (&mut front.end, &mut far), watch);
            back.light = back.light.or(if front.in_region == in_region { far.light } else { None });
        }
        if k == k_entry && shows(in_region) {
            for surface in 0..style.surface_count as usize {
                if code >= style.codes[surface][0] {
                    meet(&mut sum, with, surface, (k, probe.step), || probe.light_of_entry(), watch);
                }
            }
        }
        if kinds.preintegrated {
            // The slabs within the run.
            if n > 1.0
                && shows(in_region)
                && let Some(slabs) = with.slabs
            {
                let (slabs, mut within) = (&slabs[usize::from(in_region)], n - 1.0);
                if is_cut {
                    add_cut(&mut sum, slabs, kinds, &probe, code);
                    within -= 1.0;
                }
                add_flat(&mut sum, slabs, kinds, code, within);
                opacity = 1.0;
            }
        } else if taken > 0.0 && shows(in_region) {
            let [r, g, b, alpha] = if in_region { region.classify(code) } else { main.classify(code) };
            opacity = opacity.max(alpha);
            // Adding nothing changes no bit.
            if alpha > 0.0 {
                let mut color = [r, g, b];
                let mut rest = taken;
                if is_cut {
                    let [r, g, b] = lit_color(color, probe.light_of_entry());
                    add(&mut sum, [r * alpha, g * alpha, b * alpha, alpha]);
                    rest -= 1.0;
                }
                if rest > 0.0 {
                    if kinds.light.is_some() && !is_flat {
                        let light = *back.light.get_or_insert_with(|| probe.light(p));
                        color = lit_color(color, light);
                    }
                    let alpha = if rest == 1.0 { alpha } else { opacity_of(alpha, rest) };
                    add(&mut sum, [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha]);
                }
            }
        }
        k += n;
        back.k = k - 1.0;
        front = has_slabs.then_some(Front { end: back, in_region, is_empty });
        is_empty = false;
        look = data.map.is_some() && k >= k_look && (asks_always || opacity == 0.0);
    }
    (sum, counts)
}

/// Closes the slab between two positions, isosurfaces in it; the opacity that it adds, surfaces and all.
#[inline(always)]
fn slab<W: Watch>(
    sum: &mut Premul,
    with: &Integrals<'_>,
    table: Option<&SlabTable<'_>>,
    probe: &Probe<'_>,
    (front, back): (&mut End, &mut End),
    watch: &mut W,
) -> f32 {
    let kinds = with.take.slab_kind();
    let mut opacity = 0.0;
    if kinds.surfaces {
        let count = with.style.surface_count as usize;
        let (first, rises) = (*front, back.code > front.code);
        let mut from = first;
        for i in 0..count {
            let surface = if rises { i } else { count - 1 - i };
            let value = with.style.codes[surface][0];
            if (first.code >= value) == (back.code >= value) {
                continue;
            }
            let Some(k) = crossing(probe, (&first, back), value) else { continue };
            let k = k.max(from.k);
            let mut here = End { code: value, k, light: None, is_cut: first.is_cut };
            if let Some(table) = table {
                let length = k - from.k;
                add_slab(sum, table, kinds, probe, (&mut from, &mut here), length);
            }
            meet(sum, with, surface, (k, probe.step), || probe.light(probe.place(k)), watch);
            opacity = 1.0;
            from = here;
        }
        if opacity > 0.0 {
            if let Some(table) = table {
                let length = back.k - from.k;
                add_slab(sum, table, kinds, probe, (&mut from, back), length);
            }
            return opacity;
        }
    }
    table.map_or(opacity, |table| add_slab(sum, table, kinds, probe, (front, back), 1.0))
}

//! `wgsl/accelerated.wgsl` on the CPU: rays that leap (Frey & Ertl 2009) and skip (Krueger & Westermann 2003).
//!
//! What a sample is worth is the plain loop's business; this one only takes several positions at once where it knows
//! that they have one value (`docs/adr/0002-leaping.md`).

use brickcast_volume::Premul;
use brickcast_volume::macrocell::MapTexel;
use brickcast_volume::regions::code::{CodedTexel, MAX_DENSITY};

use super::holes::is_no_data;
use super::processor::cut_off;
use super::raycast::{FAR, Ray, VolumeReader, between, entry_at, owned_segment, rounded_up};
use crate::layout::{BrickUniform, FrameUniform, MAP_EMPTY, RegionFlags, SHOWS_REGIONS, SHOWS_RESIDUAL};

/// Filtered values that differ by less may both come from guards: 1.25 of 16383.
pub const NEARLY_EQUAL: f32 = 1.25 / 16383.0;
/// The last value where there is none: far from all codes, so that nothing is like it.
pub(super) const NOTHING_YET: f32 = 9.0;
/// Voxels that a leap ends before the last place that is known; more where positions are large numbers.
pub(super) const MARGIN: f32 = 1e-3;
/// Of the largest coordinate: what positions and planes may round by, with room.
pub(super) const MARGIN_SHARE: f32 = 1e-6;

/// What a brick holds beyond its texels.
#[derive(Debug, Clone, Copy)]
pub struct BrickData<'a> {
    /// Of the stored box, x fastest.
    pub texels: &'a [u16],
    /// True where texels hold leaps: mean codes (0..=1) by slot.
    pub means: Option<&'a [f32]>,
    /// Macrocell map, x fastest, and its cells per axis.
    pub map: Option<(&'a [u32], [u32; 3])>,
    /// 1 for texels of a region; read where the uniform says so.
    pub flags: &'a [u8],
}

/// Tables that a ray may read; `region` is for samples in regions.
#[derive(Debug, Clone, Copy)]
pub struct Tables<'a> {
    pub table: &'a [[f32; 4]],
    pub region: Option<&'a [[f32; 4]]>,
}

/// What a ray took from a brick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// Reads of texels: values, codes and region flags.
    pub samples: u32,
    /// Sample positions integrated; a leap counts all of its.
    pub positions: u32,
    /// Positions that leaps covered.
    pub leapt: u32,
    /// Jumps by the map alone: turns of the loop that read no texel.
    pub skips: u32,
}

/// Who watches a ray, and which rules it breaks: tests watch the production loop, and show that each rule is needed.
pub trait Watch {
    /// Samples of a brick that are probed whatever their values.
    const ENTRY_PROBES: u32 = 2;
    /// Samples that a leap takes beyond those it may.
    const LEAP_EXTRA: f32 = 0.0;
    /// Leaps by the paper's isotropic length in place of the way out of the cube.
    const ISOTROPIC: bool = false;

    /// `n` samples from the `k`th have the value `code`.
    #[inline(always)]
    fn takes(&mut self, _k: f32, _n: f32, _code: f32) {}

    /// The ray meets the isosurface `surface` (by ascending value) at `t`.
    #[inline(always)]
    fn meets(&mut self, _surface: usize, _t: f32) {}
}

/// Nobody watches, all rules hold.
#[derive(Debug, Clone, Copy)]
pub struct Unwatched;

impl Watch for Unwatched {}

/// Transfer function of one table.
pub(super) struct Classifier<'a> {
    pub(super) table: &'a [[f32; 4]],
    pub(super) first: f32,
    pub(super) scale: f32,
}

impl Classifier<'_> {
    /// Straight colour and opacity of one step.
    #[inline(always)]
    pub(super) fn classify(&self, code: f32) -> [f32; 4] {
        let (i, w) = entry_at((code - self.first) * self.scale, self.table.len() - 1);
        let [a, b] = [self.table[i], self.table[i + 1]];
        std::array::from_fn(|c| between(a[c], b[c], w))
    }
}

/// The opacity of `n` samples of opacity `alpha`: by squaring, as exact as n single ones.
#[inline(always)]
pub(super) fn opacity_of(alpha: f32, n: f32) -> f32 {
    let (mut clear, mut square, mut left) = (1.0, 1.0 - alpha, n as u32);
    while left > 0 {
        if left & 1 == 1 {
            clear *= square;
        }
        square *= square;
        left >>= 1;
    }
    1.0 - clear
}

/// Where the ray leaves a box; t.
#[inline(always)]
pub(super) fn leaves(ray: &Ray, lo: [f32; 3], hi: [f32; 3]) -> f32 {
    let mut t_out = FAR;
    for a in 0..3 {
        let d = ray.direction[a];
        if d != 0.0 {
            let plane = if d > 0.0 { hi[a] } else { lo[a] };
            t_out = t_out.min((plane - ray.origin[a]) * ray.inverse[a]);
        }
    }
    t_out
}

/// The first sample at or behind `t`, but for rounding: never more than `most`.
#[inline(always)]
pub(super) fn sample_at(frame: &FrameUniform, t: f32, most: f32) -> f32 {
    rounded_up((t / frame.step).min(most))
}

/// Like [`super::raycast::raycast_ray`], for bricks that can do more than be sampled.
#[must_use]
pub fn accelerated_ray<W: Watch>(
    frame: &FrameUniform,
    brick: &BrickUniform,
    data: &BrickData<'_>,
    tables: &Tables<'_>,
    ray: &Ray,
    mut sum: Premul,
    watch: &mut W,
) -> (Premul, RayCounts) {
    let mut counts = RayCounts::default();
    let Some(owned) = owned_segment(frame, brick, ray) else { return (sum, counts) };
    if sum.a >= frame.stop_alpha || tables.table.len() < 2 {
        return (sum, counts);
    }
    let main = Classifier { table: tables.table, first: frame.table_first, scale: frame.table_scale };
    let region = Classifier {
        table: tables.region.unwrap_or(tables.table),
        first: frame.region_first,
        scale: frame.region_scale,
    };
    let volume = VolumeReader::new(frame, brick, data.texels);
    let k_out = first_outside(frame, owned.k, owned.t_out);
    let largest = (0..3).fold(0.0_f32, |m, a| m.max(ray.origin[a].abs()).max(brick.owned_hi[a] as f32));
    let margin = MARGIN.max(MARGIN_SHARE * largest);
    let edge = (1_u32 << brick.cell_shift) as f32;
    let has_flags = brick.region_flags == RegionFlags::Texture as u32;

    let mut k = owned.k;
    let mut probes = if data.means.is_some() { W::ENTRY_PROBES } else { 0 };
    let mut last = NOTHING_YET;
    // The first sample at which the map may say something new, and whether it is asked there.
    let (mut k_look, mut look) = (k, data.map.is_some());
    let asks_always = data.map.is_some() && brick.map_mask > MAP_EMPTY;
    while k < k_out && sum.a < frame.stop_alpha {
        // Always the product, never accumulated: the same sample in every brick.
        let t = k * frame.step;
        let p: [f32; 3] = std::array::from_fn(|a| ray.origin[a] + t * ray.direction[a]);
        let (mut code, mut n) = (0.0, 0.0);
        let mut in_region = brick.region_flags == RegionFlags::EveryVoxel as u32;
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
            let k_exit = sample_at(frame, leaves(ray, lo, hi), k_out).max(k + 1.0);
            counts.skips += u32::from(empty > 0 || alike > 0);
            if empty > 0 {
                k = k_exit;
                probes = if data.means.is_some() { W::ENTRY_PROBES } else { 0 };
                continue;
            }
            k_look = k_exit;
            if alike > 0 {
                (code, n) = (f32::from(cube.value) / 65535.0, k_exit - k);
                counts.leapt += n as u32;
            }
        }
        if n == 0.0 && probes > 0 {
            counts.samples += 1;
            match CodedTexel::unpack(volume.nearest(p)) {
                CodedTexel::Leap { distance, slot } => {
                    let reach = f32::from(distance) - 1.0 - margin;
                    n = if W::ISOTROPIC {
                        let h = (0..3).fold(0.0_f32, |m, a| m.max((frame.step * ray.direction[a]).abs()));
                        ((reach - 0.5) / h).floor().max(1.0)
                    } else {
                        let lo = std::array::from_fn(|a| (p[a] as i32) as f32 + 0.5 - reach);
                        let hi = std::array::from_fn(|a| (p[a] as i32) as f32 + 0.5 + reach);
                        (sample_at(frame, leaves(ray, lo, hi), k_out) - k).max(1.0)
                    };
                    n = (n + W::LEAP_EXTRA).min(k_out - k);
                    code = data.means.and_then(|m| m.get(usize::from(slot))).copied().unwrap_or(0.0);
                    in_region = true;
                    counts.leapt += n as u32;
                    probes = probes.max(2) - 1;
                }
                CodedTexel::Value { density, inner: true } => {
                    (code, n) = (f32::from(density) / f32::from(MAX_DENSITY), 1.0);
                    in_region = true;
                    probes = probes.max(2) - 1;
                }
                CodedTexel::Value { .. } => {}
            }
        }
        if n == 0.0 {
            code = volume.read_data(p) * brick.code_scale;
            n = 1.0;
            counts.samples += 1;
            if is_no_data(code) {
                counts.positions += 1;
                k += 1.0;
                look = k >= k_look && data.map.is_some();
                continue;
            }
            if has_flags {
                in_region = data.flags[volume.nearest_index(p)] != 0;
                counts.samples += 1;
            }
            if data.means.is_some() {
                let equal = (code - last).abs() <= NEARLY_EQUAL;
                probes = probes.saturating_sub(1).max(u32::from(equal));
            }
        }
        last = code;
        watch.takes(k, n, code);
        let [r, g, b, opacity] = if in_region { region.classify(code) } else { main.classify(code) };
        let shown = frame.shown & if in_region { SHOWS_REGIONS } else { SHOWS_RESIDUAL } != 0;
        let opacity = if shown { opacity } else { 0.0 };
        counts.positions += n as u32;
        k += n;
        look = k >= k_look && (asks_always || opacity == 0.0) && data.map.is_some();
        // Adding nothing changes no bit.
        if opacity > 0.0 {
            let alpha = if n == 1.0 { opacity } else { opacity_of(opacity, n) };
            let weight = (1.0 - sum.a) * alpha;
            sum.r += r * weight;
            sum.g += g * weight;
            sum.b += b * weight;
            sum.a += weight;
        }
    }
    (sum, counts)
}

/// The first sample that the brick does not own: the first k with `k * step >= t_out`.
#[inline(always)]
pub(super) fn first_outside(frame: &FrameUniform, k: f32, t_out: f32) -> f32 {
    let mut k_out = rounded_up(t_out / frame.step).max(k + 1.0);
    // The quotient errs by a unit in the last place, the product decides.
    for _ in 0..2 {
        if k_out > k + 1.0 && (k_out - 1.0) * frame.step >= t_out {
            k_out -= 1.0;
        }
    }
    for _ in 0..2 {
        if k_out * frame.step < t_out {
            k_out += 1.0;
        }
    }
    k_out
}

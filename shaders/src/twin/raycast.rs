//! `wgsl/raycast.wgsl` on the CPU, in f32 with the kernel's order of operations and no fused multiply-add.
//!
//! Both filters of the GPU are one here: interpolation is at full precision. Value codes stay 0..=65535 until they are
//! interpolated, which is the one difference in order.

use std::ops::{Add, Mul, Sub};

use brickcast_volume::Premul;
use glam::Vec4;

use super::processor::cut_off;
use crate::layout::{BrickUniform, FrameUniform};

/// Slower than this per unit of t, a ray moves by less than 3e-7 voxel over the longest reach: it runs inside the
/// plane.
const PARALLEL_TO_PLANE: f32 = 1e-12;
pub(super) const FAR: f32 = 3e38;
pub(super) const CODE: f32 = 1.0 / 65535.0;

/// Index space; t in units of the smallest spacing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    pub origin: [f32; 3],
    /// Index space per unit of t; components parallel to a plane are exactly zero.
    pub direction: [f32; 3],
    /// 1 / direction, zero where direction is zero.
    pub inverse: [f32; 3],
}

/// The samples of a ray that a brick owns: k, k + 1, ... while `k * step < t_out`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// An integer, exact in f32 up to 2^24.
    pub k: f32,
    pub t_out: f32,
}

/// The ray through the centre of pixel (x, y) of the picture.
#[must_use]
pub fn pixel_ray(frame: &FrameUniform, x: u32, y: u32) -> Ray {
    let u = (2 * x as i32 + 1 - frame.width) as f32 * frame.inverse_width;
    let v = (frame.height - 1 - 2 * y as i32) as f32 * frame.inverse_height;
    let q: [f32; 3] = std::array::from_fn(|a| frame.ray_right[a] * u + frame.ray_up[a] * v);
    let mut direction = frame.ray_forward;
    let mut aside = q;
    if frame.parallel == 0 {
        direction = std::array::from_fn(|a| direction[a] + q[a]);
        let far = dot(direction, direction).sqrt();
        let scale = 1.0 / far;
        // Without cancellation: scale - 1 = -q.q scale / (1 + far).
        let back = dot(q, q) * scale / (1.0 + far);
        aside = std::array::from_fn(|a| q[a] * scale - frame.ray_forward[a] * back);
        direction = direction.map(|d| d * scale);
    }
    let origin = std::array::from_fn(|a| frame.eye[a] + aside[a] * frame.fan[a]);
    direction = std::array::from_fn(|a| direction[a] * frame.voxels_per_unit[a]);
    direction = direction.map(|d| if d.abs() < PARALLEL_TO_PLANE { 0.0 } else { d });
    let inverse = direction.map(|d| if d == 0.0 { 0.0 } else { 1.0 / d });
    Ray { origin, direction, inverse }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The first sample at or behind `t`, exactly.
#[inline(always)]
pub(super) fn first_sample(frame: &FrameUniform, t: f32) -> f32 {
    // The quotient errs by a few units in the last place, the product decides.
    let mut k = rounded_up(t / frame.step);
    for _ in 0..4 {
        if k > 0.0 && (k - 1.0) * frame.step >= t {
            k -= 1.0;
        }
    }
    for _ in 0..4 {
        if k * frame.step < t {
            k += 1.0;
        }
    }
    k
}

/// As `f32::ceil` but for the sign of zero; that is a call on processors of the oldest kind.
#[inline(always)]
pub(super) fn rounded_up(x: f32) -> f32 {
    // Larger ones are whole; NaN stays itself.
    if x.abs().partial_cmp(&1e9).is_none_or(|order| order.is_gt()) {
        return x;
    }
    let whole = cut_off(x) as f32;
    if whole < x { whole + 1.0 } else { whole }
}

/// The samples of `ray` in the brick's owned box (docs/definition.md, Sampling grid); `None` where there are none.
#[must_use]
#[inline]
pub fn owned_segment(frame: &FrameUniform, brick: &BrickUniform, ray: &Ray) -> Option<Segment> {
    let (mut t_in, mut t_out) = (0.0_f32, FAR);
    for a in 0..3 {
        let (lo, hi) = (brick.owned_lo[a] as f32, brick.owned_hi[a] as f32);
        let origin = ray.origin[a];
        if ray.direction[a] == 0.0 {
            if origin < lo || origin >= hi {
                return None;
            }
            continue;
        }
        let at_lo = (lo - origin) * ray.inverse[a];
        let at_hi = (hi - origin) * ray.inverse[a];
        t_in = t_in.max(at_lo.min(at_hi));
        t_out = t_out.min(at_lo.max(at_hi));
    }
    if t_in >= t_out {
        return None;
    }
    let k = first_sample(frame, t_in);
    (k * frame.step < t_out).then_some(Segment { k, t_out })
}

/// Value code of the brick's texels at a global position: trilinear, or the nearest voxel's. The loops that never ask
/// for holes are not for bricks that have some.
pub(super) struct VolumeReader<'a> {
    pub(super) codes: &'a [u16],
    /// Subtract from a global position + 0.5, rounded down, for the texel of the support's low corner.
    pub(super) first_texel: [i32; 3],
    /// -1 where one texel is the whole brick: nothing to interpolate between.
    pub(super) last_corner: [i32; 3],
    pub(super) row: usize,
    pub(super) slice: usize,
    /// Values are those of voxels, never between.
    pub(super) is_nearest: bool,
    /// No texel is missing, and along each axis there are two and no more than f32 tells apart.
    pub(super) is_whole: bool,
    /// Texels of code 0 hold no data.
    pub(super) has_holes: bool,
}

impl<'a> VolumeReader<'a> {
    pub(super) fn new(frame: &FrameUniform, brick: &BrickUniform, codes: &'a [u16]) -> Self {
        let dims = brick.stored_dims;
        let voxels = dims.iter().try_fold(1_usize, |n, &side| n.checked_mul(side as usize));
        Self {
            codes,
            is_nearest: frame.nearest != 0,
            is_whole: voxels.is_some_and(|n| codes.len() >= n) && dims.iter().all(|side| (2..=1 << 24).contains(side)),
            has_holes: brick.holes != 0,
            first_texel: brick.stored_lo.map(|lo| lo + 1),
            last_corner: dims.map(|n| n as i32 - 2),
            row: dims[0] as usize,
            slice: dims[0] as usize * dims[1] as usize,
        }
    }

    /// The code, 0..=1.
    #[inline(always)]
    pub(super) fn read(&self, p_voxel: [f32; 3]) -> f32 {
        if self.is_nearest {
            return f32::from(self.nearest(p_voxel)) * CODE;
        }
        let mut w = [0.0; 3];
        let mut corner = [0; 3];
        for a in 0..3 {
            // Half a voxel up in place of down: never negative, so that cutting off rounds down.
            let p = p_voxel[a] + 0.5;
            let whole = cut_off(p);
            w[a] = p - whole as f32;
            corner[a] =
                (whole.wrapping_sub(self.first_texel[a]).max(0) as u32).min(self.last_corner[a] as u32) as usize;
        }
        let at = corner[0] + corner[1] * self.row + corner[2] * self.slice;
        let Some(support) = self.codes.get(at..at + self.slice + self.row + 2) else { return 0.0 };
        // SAFETY: the slice was cut to reach from the first of these to the last.
        let code = |i: usize| f32::from(unsafe { *support.get_unchecked(i) });
        let (y, z) = (self.row, self.slice);
        // Written out: closures over arrays become calls.
        let near = Vec4::new(code(0), code(y), code(z), code(y + z));
        let far = Vec4::new(code(1), code(y + 1), code(z + 1), code(y + z + 1));
        let [y0z0, y1z0, y0z1, y1z1] = (near + (far - near) * w[0]).to_array();
        between(between(y0z0, y1z0, w[1]), between(y0z1, y1z1, w[1]), w[2]) * CODE
    }
}

impl VolumeReader<'_> {
    /// Index of the voxel that holds a global position.
    #[inline(always)]
    pub(super) fn nearest_index(&self, p_voxel: [f32; 3]) -> usize {
        let at: [usize; 3] = std::array::from_fn(|a| {
            (p_voxel[a] as i32 + 1 - self.first_texel[a]).min(self.last_corner[a] + 1).max(0) as usize
        });
        at[0] + at[1] * self.row + at[2] * self.slice
    }

    /// The texel of the voxel that holds a global position.
    #[inline(always)]
    pub(super) fn nearest(&self, p_voxel: [f32; 3]) -> u16 {
        self.codes.get(self.nearest_index(p_voxel)).copied().unwrap_or(0)
    }
}

/// Returns equal ends unchanged; of numbers or of lanes.
#[inline(always)]
pub(super) fn between<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T>>(a: T, b: T, t: T) -> T {
    a + (b - a) * t
}

/// The entry below a position in a table of `last + 1` entries, and how far on it lies; `last` is at least 1.
#[inline(always)]
pub(super) fn entry_at(position: f32, last: usize) -> (usize, f32) {
    let entry = clamped(position, last as f32);
    let i = cut_off(entry).min(last as i32 - 1);
    (i as usize, entry - i as f32)
}

/// Into 0..=last; in this form one instruction a side, which `f32::clamp` is not.
#[inline(always)]
pub(super) fn clamped(x: f32, last: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < last { x } else { last }
}

/// Takes the brick's samples along `ray` into `sum`; returns it and how many they were. `codes` are the stored box's, x
/// fastest, at least one voxel wider than the owned box on every side; `table` has at least two entries (without them
/// the brick is empty). Not for bricks in which voxels lack data.
#[must_use]
pub fn raycast_ray(
    frame: &FrameUniform,
    brick: &BrickUniform,
    codes: &[u16],
    table: &[[f32; 4]],
    ray: &Ray,
    mut sum: Premul,
) -> (Premul, u32) {
    let Some(owned) = owned_segment(frame, brick, ray) else { return (sum, 0) };
    if sum.a >= frame.stop_alpha || table.len() < 2 {
        return (sum, 0);
    }
    let volume = VolumeReader::new(frame, brick, codes);
    let last_entry = table.len() - 1;
    let (first, scale) = (frame.table_first, frame.table_scale);
    let ([ox, oy, oz], [dx, dy, dz]) = (ray.origin, ray.direction);
    let mut k = owned.k;
    loop {
        // Always the product, never accumulated: the same sample in every brick.
        let t = k * frame.step;
        if t >= owned.t_out || sum.a >= frame.stop_alpha {
            break;
        }
        let code = volume.read([ox + t * dx, oy + t * dy, oz + t * dz]);
        let (i, w) = entry_at((code - first) * scale, last_entry);
        let [a, b] = [table[i], table[i + 1]];
        let alpha = between(a[3], b[3], w);
        // Adding nothing changes no bit.
        if alpha > 0.0 {
            let weight = (1.0 - sum.a) * alpha;
            sum.r += between(a[0], b[0], w) * weight;
            sum.g += between(a[1], b[1], w) * weight;
            sum.b += between(a[2], b[2], w) * weight;
            sum.a += weight;
        }
        k += 1.0;
    }
    (sum, (k - owned.k) as u32)
}

/// One invocation of the kernel: [`raycast_ray`] for the pixel (x, y) of the picture.
#[must_use]
pub fn raycast_pixel(
    frame: &FrameUniform,
    brick: &BrickUniform,
    codes: &[u16],
    table: &[[f32; 4]],
    (x, y): (u32, u32),
    sum: Premul,
) -> (Premul, u32) {
    raycast_ray(frame, brick, codes, table, &pixel_ray(frame, x, y), sum)
}

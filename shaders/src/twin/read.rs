//! `wgsl/read/exact.wgsl` on the CPU: the value code at a global position, trilinear or the nearest voxel's.
//!
//! Value codes stay 0..=65535 until they are interpolated, which is the one difference in order.

use std::ops::{Add, Mul, Sub};

use super::holes::NO_DATA;
use crate::layout::{BrickUniform, FrameUniform};

pub(crate) const CODE: f32 = 1.0 / 65535.0;

/// What does not change along a ray.
#[derive(Debug)]
pub struct Reader<'a> {
    pub(crate) codes: &'a [u16],
    /// Subtract from a global position + 0.5, rounded down, for the texel of the support's low corner.
    pub(crate) first_texel: [i32; 3],
    /// -1 where one texel is the whole brick: nothing to interpolate between.
    pub(crate) last_corner: [i32; 3],
    pub(crate) row: usize,
    pub(crate) slice: usize,
    /// Values are those of voxels, never between.
    pub(crate) is_nearest: bool,
    /// Texels of code 0 hold no data.
    pub(crate) has_holes: bool,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(frame: &FrameUniform, brick: &BrickUniform, codes: &'a [u16]) -> Self {
        let dims = brick.stored_dims;
        Self {
            codes,
            is_nearest: frame.nearest != 0,
            has_holes: brick.holes != 0,
            first_texel: brick.stored_lo.map(|lo| lo + 1),
            last_corner: dims.map(|n| n as i32 - 2),
            row: dims[0] as usize,
            slice: dims[0] as usize * dims[1] as usize,
        }
    }
}

impl Reader<'_> {
    /// Index of the voxel that holds a global position.
    #[inline(always)]
    pub(crate) fn nearest_index(&self, p_voxel: [f32; 3]) -> usize {
        let at: [usize; 3] = std::array::from_fn(|a| {
            (p_voxel[a] as i32 + 1 - self.first_texel[a]).min(self.last_corner[a] + 1).max(0) as usize
        });
        at[0] + at[1] * self.row + at[2] * self.slice
    }

    /// The texel of the voxel that holds a global position.
    #[inline(always)]
    pub(crate) fn nearest(&self, p_voxel: [f32; 3]) -> u16 {
        self.codes.get(self.nearest_index(p_voxel)).copied().unwrap_or(0)
    }

    /// The value code of the voxel that holds a global position; [`NO_DATA`] where it has none.
    #[inline(always)]
    fn read_nearest(&self, p_voxel: [f32; 3]) -> f32 {
        let texel = self.nearest(p_voxel);
        if self.has_holes && texel == 0 { NO_DATA } else { f32::from(texel) * CODE }
    }

    /// The texel of the support's low corner, and the weights of what lies beyond it.
    #[inline(always)]
    pub(crate) fn corner(&self, p_voxel: [f32; 3]) -> (usize, [f32; 3]) {
        let mut w = [0.0; 3];
        let mut corner = [0; 3];
        for a in 0..3 {
            // Half a voxel up in place of down: never negative, so that cutting off rounds down.
            let p = p_voxel[a] + 0.5;
            let whole = p as i32;
            w[a] = p - whole as f32;
            corner[a] =
                (whole.wrapping_sub(self.first_texel[a]).max(0) as u32).min(self.last_corner[a] as u32) as usize;
        }
        (corner[0] + corner[1] * self.row + corner[2] * self.slice, w)
    }

    /// The value code, 0..=1, at a global position; [`NO_DATA`] where it has none.
    #[inline(always)]
    pub(crate) fn read_volume(&self, p_voxel: [f32; 3]) -> f32 {
        if self.is_nearest {
            return self.read_nearest(p_voxel);
        }
        if self.has_holes {
            return self.read_with_holes(p_voxel);
        }
        let (at, w) = self.corner(p_voxel);
        let (y, z) = (self.row, self.slice);
        let Some(support) = self.codes.get(at..at + z + y + 2) else { return 0.0 };
        let load = |i: usize| f32::from(support[i]);
        let y0z0 = between(load(0), load(1), w[0]);
        let y1z0 = between(load(y), load(y + 1), w[0]);
        let y0z1 = between(load(z), load(z + 1), w[0]);
        let y1z1 = between(load(z + y), load(z + y + 1), w[0]);
        between(between(y0z0, y1z0, w[1]), between(y0z1, y1z1, w[1]), w[2]) * CODE
    }
}

/// Returns equal ends unchanged; of numbers or of lanes.
#[inline(always)]
pub(super) fn between<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T>>(a: T, b: T, t: T) -> T {
    a + (b - a) * t
}

/// Into 0..=last; in this form one instruction a side, which `f32::clamp` is not.
#[inline(always)]
pub(crate) fn clamped(x: f32, last: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < last { x } else { last }
}

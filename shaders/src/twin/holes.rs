//! `wgsl/shared/holes.wgsl` on the CPU: reads of bricks in which some voxels hold no data. Other bricks never come
//! here.

use super::read::{CODE, Reader, between};

/// What a place has in which a voxel of no data has weight; no code is below 0.
pub const NO_DATA: f32 = -1.0;

/// Has a sample this code?
#[inline(always)]
pub(crate) fn is_no_data(code: f32) -> bool {
    code < 0.0
}

impl Reader<'_> {
    /// The code at a place, or [`NO_DATA`] where a texel of code 0 has weight. With data everywhere the very bits of
    /// [`Reader::read_volume`].
    pub(super) fn read_with_holes(&self, p_voxel: [f32; 3]) -> f32 {
        let (at, w) = self.corner(p_voxel);
        let Some(support) = self.codes.get(at..at + self.slice + self.row + 2) else { return NO_DATA };
        let mut codes = [0.0; 8];
        for (i, code) in codes.iter_mut().enumerate() {
            let far = [i & 1, i >> 1 & 1, i >> 2];
            // The near corner always has weight: fractions are below 1.
            let counts = (0..3).all(|a| far[a] == 0 || w[a] > 0.0);
            let texel = support[far[0] + far[1] * self.row + far[2] * self.slice];
            if counts && texel == 0 {
                return NO_DATA;
            }
            *code = f32::from(texel);
        }
        let along_x = |i: usize| between(codes[i], codes[i + 1], w[0]);
        let near = between(along_x(0), along_x(2), w[1]);
        let far = between(along_x(4), along_x(6), w[1]);
        between(near, far, w[2]) * CODE
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::OwnedBox;
    use glam::UVec3;

    use super::*;
    use bytemuck::Zeroable as _;

    use crate::layout::{BrickUniform, FrameUniform};

    /// A hole has weight all around its centre up to the centres of its neighbours, and none beyond: voxel by voxel.
    #[test]
    fn a_place_has_data_where_every_voxel_with_weight_has() {
        let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(5) };
        let stored = owned.stored(1);
        let brick = BrickUniform::of_boxes(&owned, &stored);
        let dims = stored.dims();
        let hole = UVec3::new(2, 3, 1);
        let mut codes: Vec<u16> = (0..stored.voxel_count()).map(|i| 1 + (i * 7919 % 60_000) as u16).collect();
        let at = hole + 1;
        codes[(at.x + dims.x * (at.y + dims.y * at.z)) as usize] = 0;
        let volume = Reader::new(&FrameUniform::zeroed(), &brick, &codes);
        let (mut with, mut without) = (0, 0);
        let quarters: Vec<f32> = (0..20).map(|i| i as f32 * 0.25).collect();
        for (&x, &y, &z) in quarters
            .iter()
            .flat_map(|x| quarters.iter().map(move |y| (x, y)))
            .flat_map(|(x, y)| quarters.iter().map(move |z| (x, y, z)))
        {
            let p = [x, y, z];
            let has_weight = (0..3).all(|a| (p[a] - (hole[a] as f32 + 0.5)).abs() < 1.0);
            let code = volume.read_with_holes(p);
            assert_eq!(is_no_data(code), has_weight, "{p:?}: {code}");
            if !has_weight {
                assert_eq!(code.to_bits(), volume.read_volume(p).to_bits(), "{p:?}");
            }
            with += u32::from(!has_weight);
            without += u32::from(has_weight);
        }
        assert!(with > 7000 && without == 7 * 7 * 7, "{with} {without}");
        // Texels that are missing are no data either.
        assert!(is_no_data(Reader::new(&FrameUniform::zeroed(), &brick, &codes[..10]).read_with_holes([4.0; 3])));
    }
}

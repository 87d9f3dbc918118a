//! Four samples of a ray at once: every lane has the bits that the scalar functions give for it, for positions below
//! 2^24.

use glam::Vec4;

use super::processor::{indices, pairs, whole};
use super::read::{CODE, Reader, between};

/// Positions of four samples, an axis each.
pub(super) type Places = [Vec4; 3];

/// [`super::read::clamped`] in every lane.
#[inline(always)]
pub(super) fn clamped(x: Vec4, last: f32) -> Vec4 {
    x.max(Vec4::ZERO).min(Vec4::splat(last))
}

/// [`super::classify::entry_at`] in every lane; entries as whole numbers.
#[inline(always)]
pub(super) fn entries_at(position: Vec4, last: usize) -> (Vec4, Vec4) {
    let entry = clamped(position, last as f32);
    let i = whole(entry).min(Vec4::splat(last as f32 - 1.0));
    (i, entry - i)
}

impl Reader<'_> {
    /// [`Reader::read_volume`] in every lane.
    #[inline(always)]
    pub(super) fn read_lanes(&self, at: Places) -> Vec4 {
        if self.is_whole && !self.is_nearest {
            return self.read_whole(at);
        }
        Vec4::from_array(std::array::from_fn(|lane| self.read_volume(at.map(|p| p[lane]))))
    }

    /// Of a brick that has all its texels, two or more along each axis.
    #[inline(always)]
    fn read_whole(&self, at: Places) -> Vec4 {
        let axis = |a: usize| {
            let p = at[a] + Vec4::splat(0.5);
            let low = whole(p);
            // Exact: both are integers below 2^24.
            let corner = clamped(low - Vec4::splat(self.first_texel[a] as f32), self.last_corner[a] as f32);
            (p - low, indices(corner))
        };
        let [(wx, x), (wy, y), (wz, z)] = [axis(0), axis(1), axis(2)];
        let texel = |lane: usize| x[lane] + y[lane] * self.row + z[lane] * self.slice;
        let texels = [texel(0), texel(1), texel(2), texel(3)];
        // Between two neighbours along x.
        let along_x = |offset: usize| {
            // SAFETY: corners were clamped to dims - 2, so that they and the next texel along each axis lie within the
            // brick, of which `codes` holds all (`is_whole`).
            let (near, far) = unsafe { pairs(self.codes, texels.map(|texel| texel + offset)) };
            between(near, far, wx)
        };
        let near = between(along_x(0), along_x(self.row), wy);
        let far = between(along_x(self.slice), along_x(self.slice + self.row), wy);
        between(near, far, wz) * Vec4::splat(CODE)
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::OwnedBox;
    use brickcast_volume::brick::StoredBox;
    use bytemuck::Zeroable;
    use glam::UVec3;

    use super::super::classify::entry_at;
    use super::*;
    use crate::layout::{BrickUniform, FrameUniform};

    /// A brick that stores as much as it owns.
    fn brick(lo: UVec3, dims: UVec3) -> BrickUniform {
        let owned = OwnedBox { lo, hi: lo + dims };
        BrickUniform::of_boxes(&owned, &StoredBox { lo: owned.lo.as_ivec3(), hi: owned.hi.as_ivec3() })
    }

    /// Codes and positions without order.
    fn numbers(seed: u64) -> impl Iterator<Item = f32> {
        let mut state = seed;
        std::iter::repeat_with(move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32
        })
    }

    #[test]
    fn lanes_have_the_bits_of_single_reads() {
        let mut differing = 0;
        for (dims, last) in [([9, 7, 12], 255), ([2, 2, 2], 1), ([1, 5, 4], 1023), ([70, 3, 2], 4095)] {
            let lo = UVec3::new(40, 0, 1000);
            let brick = brick(lo, dims.into());
            let codes: Vec<u16> =
                numbers(7).take(dims.iter().product::<u32>() as usize).map(|x| (x * 65535.0) as u16).collect();
            // All texels, and a brick that lacks some.
            for texels in [&codes[..], &codes[..codes.len() - 1]] {
                let volume = Reader::new(&FrameUniform::zeroed(), &brick, texels);
                let mut number = numbers(3);
                for _ in 0..2000 {
                    let places: Places = std::array::from_fn(|a| {
                        // Up to two voxels outside.
                        let place = |x: f32| lo[a] as f32 - 2.0 + x * (dims[a] + 4) as f32;
                        Vec4::from_array(std::array::from_fn(|_| place(number.next().unwrap())))
                    });
                    let read = volume.read_lanes(places);
                    let position = read * last as f32 * 1.5 - 3.0;
                    let (entry, weight) = entries_at(position, last);
                    let entries = indices(entry);
                    for lane in 0..4 {
                        let want = volume.read_volume(places.map(|p| p[lane]));
                        assert_eq!(read[lane].to_bits(), want.to_bits(), "{dims:?} {places:?} lane {lane}");
                        let (i, w) = entry_at(position[lane], last);
                        assert_eq!((entries[lane], weight[lane].to_bits()), (i, w.to_bits()), "{position}");
                        differing += usize::from(want != read[0]);
                    }
                }
            }
        }
        assert!(differing > 10_000, "{differing}");
    }

    #[test]
    fn lanes_stay_in_the_brick_whatever_the_position() {
        let codes = [65535_u16; 27];
        let brick = brick(UVec3::ZERO, UVec3::splat(3));
        let volume = Reader::new(&FrameUniform::zeroed(), &brick, &codes);
        for p in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 3e9, -3e9] {
            for axis in 0..3 {
                let mut places = [Vec4::splat(1.2); 3];
                places[axis] = Vec4::new(p, 0.0, p, 2.9);
                let read = volume.read_lanes(places);
                assert!(read[1] == 1.0 && read[3] == 1.0, "{p}: {read}");
            }
        }
    }
}

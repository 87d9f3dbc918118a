//! Macrocells: small cubes of a brick with the range of the values that a sample in them can have (Krueger & Westermann
//! 2003). They lie on the global voxel grid, so that every brick and every step sees the same cells.

use glam::{IVec3, UVec3};
use rayon::prelude::*;

use crate::brick::{OwnedBox, StoredBox};

/// Distances between cells are cut off here: 8 bits of [`MapTexel`].
pub const MAX_CELL_DISTANCE: u32 = 255;

/// The cells that meet a brick's owned box.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Macrocells {
    /// Voxels per edge: a power of two.
    pub edge: u32,
    /// First cell, in cells of the global grid.
    pub lo: IVec3,
    /// Cells per axis.
    pub dims: UVec3,
    /// Smallest and largest code that a sample in the cell and the owned box can have; x fastest. The first above the
    /// second where no sample has one: nothing there holds data.
    pub ranges: Vec<[u16; 2]>,
}

/// The cube of cells around one cell that may be taken for one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HomogeneousCube {
    /// All cells less than this away (Chebyshev, in cells) share the range; 0 where not even the cell itself does.
    pub distance: u8,
    /// The middle of that range.
    pub value: u16,
}

/// What the 32-bit texel of a macrocell map says of its cell. `shaders/wgsl/shared/texel.wgsl` takes the same bits
/// apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MapTexel {
    /// 8 bits: cells to the nearest that is not empty, 0 for itself.
    pub empty: u8,
    /// 8 bits distance, 16 bits value.
    pub cube: HomogeneousCube,
}

impl MapTexel {
    #[must_use]
    #[inline]
    pub const fn pack(self) -> u32 {
        self.empty as u32 | (self.cube.distance as u32) << 8 | (self.cube.value as u32) << 16
    }

    #[must_use]
    #[inline(always)]
    pub const fn unpack(texel: u32) -> Self {
        let cube = HomogeneousCube { distance: (texel >> 8 & 0xff) as u8, value: (texel >> 16) as u16 };
        Self { empty: (texel & 0xff) as u8, cube }
    }
}

impl From<HomogeneousCube> for MapTexel {
    /// Of a cell of which nothing more is known.
    fn from(cube: HomogeneousCube) -> Self {
        Self { empty: 0, cube }
    }
}

impl Macrocells {
    /// `codes` are the stored box's, x fastest; it reaches at least one voxel beyond the owned box on every side (that
    /// voxel is the apron: a sample at a cell's face reads it).
    #[must_use]
    pub fn of(owned: &OwnedBox, stored: &StoredBox, codes: &[u16], edge: u32) -> Self {
        Self::over(owned, stored, codes, edge, None)
    }

    /// The same of a brick in which some voxels hold no data, by their code: ranges are over the others. Such cells
    /// must not be taken for one value.
    #[must_use]
    pub fn over(owned: &OwnedBox, stored: &StoredBox, codes: &[u16], edge: u32, no_data: Option<u16>) -> Self {
        let (lo, hi) = (owned.lo / edge, (owned.hi + (edge - 1)) / edge);
        let dims = hi - lo;
        let slice = |z: u32| {
            let cell =
                move |x: u32, y: u32| cell_range(owned, stored, codes, (edge, no_data), lo + UVec3::new(x, y, z));
            (0..dims.y).flat_map(move |y| (0..dims.x).map(move |x| cell(x, y))).collect::<Vec<_>>()
        };
        let ranges = (0..dims.z).into_par_iter().flat_map_iter(slice).collect();
        Self { edge, lo: lo.as_ivec3(), dims, ranges }
    }

    /// For values that may be `below` less and `above` more than the codes that the ranges were taken over.
    #[must_use]
    pub fn widened(mut self, below: u16, above: u16) -> Self {
        for [min, max] in &mut self.ranges {
            (*min, *max) = (min.saturating_sub(below), max.saturating_add(above));
        }
        self
    }

    /// For every cell the largest cube of cells about it whose joint range spans at most `width` codes. Cells outside
    /// the brick do not count: rays end there.
    #[must_use]
    pub fn homogeneous(&self, width: u16) -> Vec<HomogeneousCube> {
        let mut cubes = vec![HomogeneousCube::default(); self.ranges.len()];
        let mut joint = self.ranges.clone();
        let most = self.dims.max_element().min(MAX_CELL_DISTANCE);
        for distance in 1..=most {
            let mut any = false;
            for (cube, [min, max]) in cubes.iter_mut().zip(&joint) {
                if u32::from(cube.distance) + 1 == distance && max - min <= width {
                    *cube = HomogeneousCube { distance: distance as u8, value: min + (max - min) / 2 };
                    any = true;
                }
            }
            if !any {
                break;
            }
            for axis in 0..3 {
                joint = joined_along(&joint, self.dims, axis);
            }
        }
        cubes
    }
}

fn cell_range(
    owned: &OwnedBox,
    stored: &StoredBox,
    codes: &[u16],
    (edge, no_data): (u32, Option<u16>),
    cell: UVec3,
) -> [u16; 2] {
    let lo = (cell * edge).max(owned.lo).as_ivec3() - 1 - stored.lo;
    let hi = ((cell + 1) * edge).min(owned.hi).as_ivec3() + 1 - stored.lo;
    let dims = stored.dims().as_ivec3();
    let mut range = [u16::MAX, u16::MIN];
    for z in lo.z..hi.z {
        for y in lo.y..hi.y {
            let row = ((z * dims.y + y) * dims.x) as usize;
            for &code in codes.get(row + lo.x as usize..row + hi.x as usize).unwrap_or_default() {
                if Some(code) == no_data {
                    continue;
                }
                range = [range[0].min(code), range[1].max(code)];
            }
        }
    }
    range
}

/// Every cell's range joined with those of its two neighbours along `axis`.
fn joined_along(ranges: &[[u16; 2]], dims: UVec3, axis: usize) -> Vec<[u16; 2]> {
    let strides = [1, dims.x as usize, dims.x as usize * dims.y as usize];
    let (stride, count) = (strides[axis], dims[axis] as usize);
    let join = |[a, b]: [u16; 2], [c, d]: [u16; 2]| [a.min(c), b.max(d)];
    (0..ranges.len())
        .map(|i| {
            let at = i / stride % count;
            let below = if at > 0 { ranges[i - stride] } else { ranges[i] };
            let above = if at + 1 < count { ranges[i + stride] } else { ranges[i] };
            join(join(below, ranges[i]), above)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u32) -> u16 {
        let x = seed.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
        ((x ^ x >> 15).wrapping_mul(0x85eb_ca6b) >> 16) as u16
    }

    #[test]
    fn a_map_texel_is_packed_again_as_it_was() {
        let texel = MapTexel { empty: 0x12, cube: HomogeneousCube { distance: 0x34, value: 0x5678 } };
        assert_eq!((texel.pack(), MapTexel::unpack(texel.pack())), (0x5678_3412, texel));
        assert_eq!(MapTexel::unpack(u32::MAX).pack(), u32::MAX);
    }

    /// Odd boxes, a first cell that the brick only shares, cells cut at the high end.
    #[test]
    fn ranges_hold_every_voxel_that_a_sample_in_the_cell_reads() {
        for (lo, hi) in [([0, 0, 0], [8, 8, 8]), ([5, 8, 3], [18, 21, 14]), ([8, 16, 24], [9, 23, 32])] {
            let owned = OwnedBox { lo: lo.into(), hi: hi.into() };
            let stored = owned.stored(2);
            let dims = stored.dims();
            let codes: Vec<u16> = (0..stored.voxel_count() as u32).map(noise).collect();
            for edge in [4, 8] {
                let cells = Macrocells::of(&owned, &stored, &codes, edge);
                assert_eq!(cells.ranges.len() as u32, cells.dims.element_product());
                let mut want = vec![[u16::MAX, 0]; cells.ranges.len()];
                for (i, &code) in codes.iter().enumerate() {
                    let i = i as u32;
                    let voxel = stored.lo + UVec3::new(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y).as_ivec3();
                    for (j, range) in want.iter_mut().enumerate() {
                        let j = j as u32;
                        let d = cells.dims;
                        let cell = cells.lo + UVec3::new(j % d.x, j / d.x % d.y, j / d.x / d.y).as_ivec3();
                        let from = (cell * edge as i32).max(owned.lo.as_ivec3()) - 1;
                        let to = ((cell + 1) * edge as i32).min(owned.hi.as_ivec3()) + 1;
                        if voxel.cmpge(from).all() && voxel.cmplt(to).all() {
                            *range = [range[0].min(code), range[1].max(code)];
                        }
                    }
                }
                assert_eq!(cells.ranges, want);
            }
        }
    }

    #[test]
    fn homogeneous_cubes_are_the_largest_and_no_wider_than_asked() {
        let dims = UVec3::new(7, 5, 6);
        let count = dims.element_product();
        // Mostly flat, some cells far off.
        let ranges: Vec<[u16; 2]> = (0..count)
            .map(|i| {
                let n = noise(i);
                let min = if n.is_multiple_of(61) { 30_000 } else { 1000 + n % 50 };
                [min, min + n % 40]
            })
            .collect();
        let cells = Macrocells { edge: 4, lo: IVec3::ZERO, dims, ranges };
        let at = |i: u32| UVec3::new(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y).as_ivec3();
        for width in [0, 39, 60, 90, u16::MAX] {
            let cubes = cells.homogeneous(width);
            for i in 0..count {
                let joint = |distance: i32| {
                    (0..count)
                        .filter(|&j| (at(j) - at(i)).abs().max_element() < distance)
                        .map(|j| cells.ranges[j as usize])
                        .fold([u16::MAX, 0], |[a, b], [c, d]| [a.min(c), b.max(d)])
                };
                let cube = cubes[i as usize];
                let want = (1..=7).take_while(|&d| joint(d)[1] - joint(d)[0] <= width).last().unwrap_or(0);
                assert_eq!(i32::from(cube.distance), want, "cell {i}, width {width}");
                if want > 0 {
                    let [min, max] = joint(want);
                    assert!(cube.value - min <= width && max - cube.value <= width);
                }
            }
        }
    }
}

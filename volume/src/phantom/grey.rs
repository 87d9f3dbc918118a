//! The grey values: coverage by material, mild beam hardening, noise.

use glam::DVec3;

use super::part::Part;
use super::pores::{Pore, mix};

pub(super) const AIR: f64 = 2_000.0;
const MATERIAL: f64 = 40_000.0;
/// Noise in air against noise in material.
const NOISE_AIR: f64 = 3.0 / 7.0;

/// The voxels' values as a function of their place.
#[derive(Debug)]
pub(super) struct Grey<'a> {
    part: Part,
    /// Per plane, the pores that reach it.
    pores_of_plane: Vec<Vec<&'a Pore>>,
    noise_key: u64,
    /// Standard deviation in full material, grey values.
    noise: f64,
}

impl<'a> Grey<'a> {
    /// `noise`: standard deviation in material, percent of its grey value.
    pub(super) fn new(part: Part, pores: &'a [Pore], seed: u64, noise: f64) -> Self {
        let depth = part.dims().z as usize;
        let mut pores_of_plane = vec![Vec::new(); depth];
        for pore in pores {
            let (lo, hi) = reach(pore, 2, depth);
            pores_of_plane[lo..hi].iter_mut().for_each(|plane| plane.push(pore));
        }
        Self { part, pores_of_plane, noise_key: mix(mix(seed) ^ 1), noise: noise * 0.01 * MATERIAL }
    }

    /// The voxels of a row from `x0` on, at `y` and `z`.
    pub(super) fn fill_row(&self, [x0, y, z]: [u32; 3], row: &mut [u16]) {
        let at = |i: usize| DVec3::new(f64::from(x0) + i as f64, f64::from(y), f64::from(z)) + 0.5;
        let pores: Vec<&Pore> = self.pores_of_plane[z as usize]
            .iter()
            .copied()
            .filter(|pore| {
                let (lo, hi) = reach(pore, 1, self.part.dims().y as usize);
                (lo..hi).contains(&(y as usize))
            })
            .collect();
        let [nx, ny] = [self.part.dims().x, self.part.dims().y].map(|n| n as u64);
        let first = (u64::from(z) * ny + u64::from(y)) * nx + u64::from(x0);
        let mut done = 0;
        while done < row.len() {
            // The surface is 1-Lipschitz: so many voxels on, it cannot have come within half a voxel.
            let distance = self.part.distance_voxels(at(done));
            let same = ((distance.abs() - 0.5).max(1.0) as usize).min(row.len() - done);
            let covered = (0.5 - distance).clamp(0.0, 1.0);
            let run = (done..).zip(&mut row[done..done + same]);
            if covered > 0.0 {
                for (i, voxel) in run {
                    let holes: f64 = pores.iter().map(|pore| pore.share_of_voxel(at(i))).sum();
                    *voxel = self.value(at(i), covered - holes, first + i as u64);
                }
            } else {
                // What `value` is where nothing is covered, without asking what the material would be.
                let deviation = self.noise * NOISE_AIR;
                for (i, voxel) in run {
                    *voxel = self.noisy(AIR, deviation, first + i as u64);
                }
            }
            done += same;
        }
    }

    /// `covered`: share of the voxel that is material.
    fn value(&self, p_voxel: DVec3, covered: f64, index: u64) -> u16 {
        let covered = covered.clamp(0.0, 1.0);
        let material = material_at(self.part.part_from_voxel(p_voxel));
        let mean = AIR + (material - AIR) * covered;
        self.noisy(mean, self.noise * (NOISE_AIR + (1.0 - NOISE_AIR) * covered), index)
    }

    #[inline(always)]
    fn noisy(&self, mean: f64, deviation: f64, index: u64) -> u16 {
        rounded(mean + deviation * gaussian(mix(self.noise_key ^ index)))
    }
}

/// The nearest number of 16 bits, halves up. Not by `round`, which is a call where the processor has no instruction for
/// it.
#[inline(always)]
fn rounded(value: f64) -> u16 {
    let value = value.clamp(0.0, 65_535.0);
    let whole = value as u32;
    (whole + u32::from(value - f64::from(whole) >= 0.5)) as u16
}

/// Grey value of full material, part space. Cupping: rays through the middle have lost their soft part (beam
/// hardening), so the middle looks lighter than it is; two percent of it are left, as after a usual correction.
pub(super) fn material_at(p: DVec3) -> f64 {
    let from_axis = (p.x * p.x + p.z * p.z).min(1.5);
    MATERIAL * (0.99 + 0.02 * from_axis)
}

/// Voxels along an axis that a pore reaches, half-open.
fn reach(pore: &Pore, axis: usize, size: usize) -> (usize, usize) {
    let (center, radius) = (pore.center_voxel[axis], pore.radii_voxel[axis]);
    (((center - radius).floor().max(0.0) as usize).min(size), ((center + radius).ceil().max(0.0) as usize).min(size))
}

/// Nearly normal, mean 0, deviation 1: the sum of four even 16-bit numbers, deviation `65536 / sqrt(3)`.
fn gaussian(bits: u64) -> f64 {
    let sum: u32 = (0..4).map(|i| (bits >> (16 * i)) as u32 & 0xffff).sum();
    (f64::from(sum) - 2.0 * 65_535.0) * (3f64.sqrt() / 65_536.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_has_its_mean_and_deviation() {
        let values: Vec<f64> = (0..100_000u64).map(|i| gaussian(mix(i))).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        // Four deviations of the means of 100,000 numbers.
        assert!(mean.abs() < 0.013 && (variance - 1.0).abs() < 0.02, "{mean} {variance}");
    }

    #[test]
    fn halves_are_rounded_up_and_nothing_leaves_its_range() {
        for value in [-3.0, -0.2, 0.0, 0.499_999_999_999_999_94, 0.5, 1.5, 2.499, 39_999.5, 65_534.5, 65_535.4, 7e9] {
            assert_eq!(f64::from(rounded(value)), value.round().clamp(0.0, 65_535.0), "{value}");
        }
    }

    #[test]
    fn a_row_is_the_same_from_wherever_it_is_begun() {
        let part = Part::new([64, 40, 44]);
        let pores = super::super::pores::place(&part, 8, 5).unwrap();
        let grey = Grey::new(part, &pores, 5, 1.75);
        let (mut row, mut rest) = ([0; 64], [0; 64]);
        for (y, z) in (0..40).zip(2..) {
            grey.fill_row([0, y, z], &mut row);
            for x0 in [1, 7, 31, 63] {
                let rest = &mut rest[x0..];
                grey.fill_row([x0 as u32, y, z], rest);
                assert_eq!(rest, &row[x0..], "{x0} {y} {z}");
            }
        }
    }

    #[test]
    fn leaping_over_a_row_changes_no_voxel() {
        let part = Part::new([64, 40, 40]);
        let grey = Grey::new(part, &[], 5, 1.75);
        let mut row = vec![0; 64];
        for (y, z) in [(8, 20), (20, 20), (30, 11), (0, 0)] {
            grey.fill_row([0, y, z], &mut row);
            for (x, &value) in row.iter().enumerate() {
                let p = DVec3::new(x as f64, f64::from(y), f64::from(z)) + 0.5;
                let index = (u64::from(z) * 40 + u64::from(y)) * 64 + x as u64;
                assert_eq!(value, grey.value(p, 0.5 - part.distance_voxels(p), index), "{x} {y} {z}");
            }
        }
    }
}

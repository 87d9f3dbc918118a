//! Pores: where they are, and how much of a voxel they take.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::{DVec3, IVec3};

use super::part::Part;

/// An ellipsoid of air inside the material, its axes along x, y, z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pore {
    /// Index space.
    pub center_voxel: DVec3,
    /// Half axes in voxels.
    pub radii_voxel: DVec3,
}

/// Material around each pore: to the surface, and to the next pore, in voxels. More than the width over which a voxel
/// can mix, where the part is large enough; small parts have thin walls.
const WALLS_VOXELS: [f64; 3] = [2.5, 1.5, 1.0];
/// After so many places that are taken or no material, a pore is said not to fit.
const TRIES: u32 = 20_000;
const SMALLEST_RADIUS: f64 = 0.5;

impl Pore {
    #[must_use]
    pub fn volume_voxels(&self) -> f64 {
        4.0 / 3.0 * PI * self.radii_voxel.element_product()
    }

    /// Share of the voxel around `center` (index space) that the pore takes, from 8^3 points for small pores, 4^3 for
    /// others.
    pub(super) fn share_of_voxel(&self, center: DVec3) -> f64 {
        let reach = 0.75f64.sqrt() / self.radii_voxel.min_element();
        let away = ((center - self.center_voxel) / self.radii_voxel).length();
        if away >= 1.0 + reach {
            return 0.0;
        }
        if away + reach <= 1.0 {
            return 1.0;
        }
        let n = if self.radii_voxel.min_element() < 2.0 { 8 } else { 4 };
        let offset = |i: u32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
        let mut hits = 0;
        for (z, y, x) in (0..n).flat_map(|z| (0..n).flat_map(move |y| (0..n).map(move |x| (z, y, x)))) {
            let p = center + DVec3::new(offset(x), offset(y), offset(z));
            hits += u32::from(((p - self.center_voxel) / self.radii_voxel).length_squared() < 1.0);
        }
        f64::from(hits) / f64::from(n * n * n)
    }
}

/// `count` pores, the largest first: radii fall geometrically to [`SMALLEST_RADIUS`], every other pore is an ellipsoid.
///
/// # Errors
/// How many were placed, where not all find a place.
pub(super) fn place(part: &Part, count: u32, seed: u64) -> Result<Vec<Pore>, u32> {
    let largest = (part.dims().min_element() / 60.0).clamp(3.0, 8.0);
    let mut most = 0;
    // Where they do not fit, smaller ones with thinner walls may.
    for (wall, largest) in [largest, 1.5, SMALLEST_RADIUS].into_iter().enumerate().map(|(i, r)| (WALLS_VOXELS[i], r)) {
        match place_within(part, count, seed, largest, wall) {
            Ok(pores) => return Ok(pores),
            Err(placed) => most = most.max(placed),
        }
    }
    Err(most)
}

fn place_within(part: &Part, count: u32, seed: u64, largest: f64, wall: f64) -> Result<Vec<Pore>, u32> {
    let cell_size = 2.0 * largest + wall;
    let cell_of = |p: DVec3| (p / cell_size).floor().as_ivec3();
    // Only looked up, never walked through: its order has no influence.
    let mut cells: HashMap<IVec3, Vec<Pore>> = HashMap::new();
    let mut pores = Vec::new();
    for id in 0..count {
        let mut random = Random::new(seed, u64::from(id));
        let share = (f64::from(id) + 0.5) / f64::from(count);
        let radius = largest * (SMALLEST_RADIUS / largest).powf(share);
        let radii_voxel = if id % 2 == 0 {
            DVec3::splat(radius)
        } else {
            let short = |random: &mut Random| (radius * random.between(0.6, 0.95)).max(SMALLEST_RADIUS);
            let axes = [radius, short(&mut random), short(&mut random)];
            let turn = random.between(0.0, 3.0) as usize;
            DVec3::from([0, 1, 2].map(|axis| axes[(axis + turn) % 3]))
        };
        let found = (0..TRIES).find_map(|_| {
            let center_voxel = DVec3::from(part.dims().to_array().map(|n| random.between(0.0, n)));
            let pore = Pore { center_voxel, radii_voxel };
            let inside = -part.distance_voxels(center_voxel) >= radius + wall;
            (inside && !touches_another(&cells, cell_of(center_voxel), &pore, wall)).then_some(pore)
        });
        let Some(pore) = found else { return Err(id) };
        cells.entry(cell_of(pore.center_voxel)).or_default().push(pore);
        pores.push(pore);
    }
    Ok(pores)
}

/// A cell is as wide as two pores and a wall: nearer ones are in the cells around.
fn touches_another(cells: &HashMap<IVec3, Vec<Pore>>, cell: IVec3, pore: &Pore, wall: f64) -> bool {
    let around = (-1..=1).flat_map(|z| (-1..=1).flat_map(move |y| (-1..=1).map(move |x| IVec3::new(x, y, z))));
    around.filter_map(|step| cells.get(&(cell + step))).flatten().any(|other| {
        let apart = pore.radii_voxel.max_element() + other.radii_voxel.max_element() + wall;
        pore.center_voxel.distance(other.center_voxel) < apart
    })
}

/// A stream of numbers that depends on its seed and its stream alone (SplitMix64, Steele et al. 2014).
#[derive(Debug)]
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64, stream: u64) -> Self {
        Self(mix(mix(seed) ^ stream))
    }

    /// Evenly in `[lo, hi)`.
    pub(super) fn between(&mut self, lo: f64, hi: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let unit = (mix(self.0) >> 11) as f64 / (1u64 << 53) as f64;
        lo + (hi - lo) * unit
    }
}

/// SplitMix64's output function: every bit of the input reaches every bit of the output.
pub(super) fn mix(value: u64) -> u64 {
    let v = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    v ^ (v >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pores_lie_inside_the_material_and_apart() {
        let part = Part::new([128, 96, 160]);
        let pores = place(&part, 60, 3).unwrap();
        assert_eq!(pores.len(), 60);
        for (i, pore) in pores.iter().enumerate() {
            let radius = pore.radii_voxel.max_element();
            assert!(part.distance_voxels(pore.center_voxel) <= -radius - WALLS_VOXELS[0]);
            assert!(pore.radii_voxel.min_element() >= SMALLEST_RADIUS);
            for other in &pores[..i] {
                let walls = pore.center_voxel.distance(other.center_voxel) - radius - other.radii_voxel.max_element();
                assert!(walls >= WALLS_VOXELS[0]);
            }
        }
        assert!(pores[0].radii_voxel.max_element() > 2.5 && pores[59].radii_voxel.max_element() < 0.6);
        assert!(pores.iter().any(|p| p.radii_voxel.x != p.radii_voxel.y));
    }

    #[test]
    fn the_shares_of_the_voxels_add_up_to_the_volume() {
        for (radii, tolerance) in
            [(DVec3::splat(0.5), 0.03), (DVec3::new(0.9, 0.6, 0.7), 0.03), (DVec3::new(4.0, 3.0, 2.5), 0.01)]
        {
            let pore = Pore { center_voxel: DVec3::new(8.3, 8.0, 7.61), radii_voxel: radii };
            let voxels = (0..16).flat_map(|z| {
                (0..16).flat_map(move |y| (0..16).map(move |x| DVec3::new(x.into(), y.into(), z.into())))
            });
            let sum: f64 = voxels.map(|v| pore.share_of_voxel(v + 0.5)).sum();
            // The points' grid is coarse for the smallest pores; the seed of the noise has no part in it.
            assert!((sum / pore.volume_voxels() - 1.0).abs() < tolerance, "{radii}: {sum} {}", pore.volume_voxels());
        }
    }
}

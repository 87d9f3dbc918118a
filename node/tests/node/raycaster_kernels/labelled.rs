//! A small volume with regions labelled by hand: air, two materials, pores, and noise.

use brickcast_volume::regions::code::{MAX_DENSITY, code_of_density};
use brickcast_volume::regions::{BrickRegions, Region, RegionTable, density_of_code};
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::{Geometry, StoredBox};
use glam::{IVec3, UVec3};

pub(crate) struct Labelled {
    pub(crate) geometry: Geometry,
    pub(crate) table: RegionTable,
    codes: Vec<u16>,
    labels: Vec<u32>,
    distances: Vec<u8>,
}

fn noise(p: IVec3) -> u16 {
    let x = (p.x.wrapping_mul(73_856_093) ^ p.y.wrapping_mul(19_349_663) ^ p.z.wrapping_mul(83_492_791)) as u32;
    let x = (x ^ x >> 13).wrapping_mul(0x9e37_79b1);
    ((x ^ x >> 16) & 0xffff) as u16
}

/// A box with a smooth inset and pores, in air.
fn part(p: IVec3) -> (u16, u32) {
    let q = p.as_vec3();
    let body = p.cmpge(IVec3::new(4, 5, 3)).all() && p.cmplt(IVec3::new(36, 26, 20)).all();
    let waves = (q.x * 0.45).sin() * (q.y * 0.6).cos() + (q.z * 0.5).sin();
    let smooth = (0.5 + 0.1 * waves) * 65535.0;
    let is_pore = (p - IVec3::new(14, 14, 11)).length_squared() < 5 || p == IVec3::new(30, 20, 10);
    match (body, is_pore) {
        (false, _) => (2000 + noise(p) % 1000, 1),
        (true, true) => (9000, 0),
        (true, false) if p.x > 24 && p.z < 12 => (smooth as u16, 0),
        (true, false) => (40_000 + noise(p) % 1300, 2),
    }
}

/// Balls in air, far enough apart that macrocells between them are empty, in whatever brick.
fn ball(p: IVec3) -> (u16, u32) {
    let cell = p.div_euclid(IVec3::splat(8));
    let is_ball = (p - (cell * 8 + 4)).length_squared() <= 6 && cell.element_sum() % 2 == 0;
    if is_ball { (40_000 + noise(p) % 1300, 0) } else { (2000 + noise(p) % 300, 1) }
}

/// One small ball in the midst of a brick, with nothing else.
fn dot(p: IVec3) -> (u16, u32) {
    let is_ball = (p - IVec3::new(24, 22, 8)).length_squared() <= 5;
    if is_ball { (60_000, 0) } else { (2000, 1) }
}

impl Labelled {
    /// Nothing but the two ends of the range, each in many whole macrocells.
    pub(crate) fn halves(dims: [u32; 3]) -> Self {
        Self::new(dims, [1.0; 3], |p| (if p.x + p.y < 30 { 0 } else { u16::MAX }, 0))
    }

    pub(crate) fn dot(dims: [u32; 3]) -> Self {
        Self::new(dims, [1.0; 3], dot)
    }

    pub(crate) fn balls(dims: [u32; 3], spacing: [f64; 3]) -> Self {
        Self::new(dims, spacing, ball)
    }

    pub(crate) fn part(dims: [u32; 3], spacing: [f64; 3]) -> Self {
        Self::new(dims, spacing, part)
    }

    /// One region of one density.
    pub(crate) fn solid(dims: [u32; 3], density: u16) -> Self {
        Self::new(dims, [1.0; 3], |_| (code_of_density(density), 1))
    }

    fn new(dims: [u32; 3], spacing: [f64; 3], voxel: impl Fn(IVec3) -> (u16, u32)) -> Self {
        let geometry = Geometry::new(dims, spacing, [0.0; 3]).unwrap();
        let all = StoredBox { lo: IVec3::ZERO, hi: UVec3::from(dims).as_ivec3() };
        let (codes, labels): (Vec<_>, Vec<_>) = cut(all, voxel).into_iter().unzip();
        let count = labels.iter().copied().max().unwrap_or(0);
        let regions = (1..=count).map(|label| {
            let mut region = Region { root: 0, voxels: 0, sum: 0, min: MAX_DENSITY, max: 0 };
            for (&code, _) in codes.iter().zip(&labels).filter(|(_, l)| **l == label) {
                let density = density_of_code(code);
                region.voxels += 1;
                region.sum += u64::from(density);
                (region.min, region.max) = (region.min.min(density), region.max.max(density));
            }
            region
        });
        let table = RegionTable(regions.collect());
        let mut volume = Self { geometry, table, codes, labels, distances: Vec::new() };
        volume.distances = volume.measured(all);
        volume
    }

    /// Level by level: whoever touches another label is at distance 1, whoever touches level d at d + 1.
    fn measured(&self, all: StoredBox) -> Vec<u8> {
        let mut distances: Vec<u8> = self.labels.iter().map(|&l| if l == 0 { 0 } else { u8::MAX }).collect();
        for level in 1..64 {
            let before = distances.clone();
            let reached = cut(all, |p| {
                let met = |n: i32| {
                    let j = self.at(p + IVec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
                    if level == 1 { self.labels[j] != self.labels[self.at(p)] } else { before[j] == level - 1 }
                };
                before[self.at(p)] == u8::MAX && (0..27).any(met)
            });
            distances.iter_mut().zip(reached).filter(|(_, reached)| *reached).for_each(|(d, _)| *d = level);
        }
        distances
    }

    pub(crate) fn dims(&self) -> UVec3 {
        self.geometry.dims()
    }

    fn at(&self, p: IVec3) -> usize {
        let dims = self.dims();
        let p = p.clamp(IVec3::ZERO, dims.as_ivec3() - 1).as_uvec3();
        ((p.z * dims.y + p.y) * dims.x + p.x) as usize
    }

    pub(crate) fn voxels(&self, stored: StoredBox) -> BrickVoxels {
        BrickVoxels { stored, codes: cut(stored, |p| self.codes[self.at(p)]), has_holes: false }
    }

    /// V' in 16-bit codes.
    pub(crate) fn flattened(&self, stored: StoredBox) -> BrickVoxels {
        let code = |p| {
            let at = self.at(p);
            self.table.get(self.labels[at]).map_or(self.codes[at], |region| code_of_density(region.mean()))
        };
        BrickVoxels { stored, codes: cut(stored, code), has_holes: false }
    }

    pub(crate) fn regions(&self, stored: StoredBox) -> BrickRegions {
        // One more than a radius of 1 needs.
        let covered = StoredBox { lo: stored.lo - 3, hi: stored.hi + 3 };
        BrickRegions {
            covered,
            labels: cut(covered, |p| self.labels[self.at(p)]),
            distances: cut(covered, |p| self.distances[self.at(p)]),
        }
    }
}

fn cut<T>(stored: StoredBox, at: impl Fn(IVec3) -> T) -> Vec<T> {
    let (lo, hi) = (stored.lo, stored.hi);
    let mut all = Vec::with_capacity(stored.voxel_count() as usize);
    for z in lo.z..hi.z {
        for y in lo.y..hi.y {
            all.extend((lo.x..hi.x).map(|x| at(IVec3::new(x, y, z))));
        }
    }
    all
}

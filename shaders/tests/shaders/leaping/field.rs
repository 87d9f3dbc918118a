//! Small volumes with regions, cut into bricks by brute force.

use brickcast_volume::brick::OwnedBox;
use brickcast_volume::regions::code::{MAX_DENSITY, code_of_density};
use brickcast_volume::regions::{
    BrickRegions, NO_REGION, Region, RegionTable, RegionTexels, density_of_code, region_texels,
};
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::{BrickGrid, StoredBox};
use glam::{IVec3, UVec3};

/// A volume whose voxels are labelled by hand.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    pub(crate) dims: UVec3,
    pub(crate) codes: Vec<u16>,
    pub(crate) labels: Vec<u32>,
    distances: Vec<u8>,
    pub(crate) table: RegionTable,
}

impl Field {
    /// `voxel` gives code and label.
    pub(crate) fn new(dims: [u32; 3], voxel: impl Fn(IVec3) -> (u16, u32)) -> Self {
        let dims = UVec3::from(dims);
        let positions = || {
            (0..dims.z).flat_map(move |z| {
                (0..dims.y).flat_map(move |y| (0..dims.x).map(move |x| UVec3::new(x, y, z).as_ivec3()))
            })
        };
        let (codes, labels): (Vec<u16>, Vec<u32>) = positions().map(voxel).unzip();
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
        let mut field = Self { dims, codes, labels, distances: Vec::new(), table };
        field.distances = field.measured();
        field
    }

    fn at(&self, p: IVec3) -> usize {
        let p = p.clamp(IVec3::ZERO, self.dims.as_ivec3() - 1).as_uvec3();
        ((p.z * self.dims.y + p.y) * self.dims.x + p.x) as usize
    }

    /// Level by level: whoever touches another label is at distance 1, whoever touches level d at d + 1.
    fn measured(&self) -> Vec<u8> {
        let mut distances: Vec<u8> = self.labels.iter().map(|&l| if l == NO_REGION { 0 } else { u8::MAX }).collect();
        for level in 1..u8::MAX {
            let before = distances.clone();
            let mut any = false;
            for (i, distance) in distances.iter_mut().enumerate().filter(|(_, d)| **d == u8::MAX) {
                let i = i as u32;
                let p = UVec3::new(i % self.dims.x, i / self.dims.x % self.dims.y, i / self.dims.x / self.dims.y);
                let near = (0..27).map(|n| self.at(p.as_ivec3() + IVec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)));
                let met = |j: usize| {
                    if level == 1 { self.labels[j] != self.labels[i as usize] } else { before[j] == level - 1 }
                };
                if near.into_iter().any(met) {
                    *distance = level;
                    any = true;
                }
            }
            if level > 1 && !any {
                break;
            }
        }
        distances
    }

    /// V' as 14-bit densities in units of 1/16383, at a global position; beyond the edge it is repeated.
    pub(crate) fn flattened(&self, p: IVec3) -> f64 {
        let at = self.at(p);
        let density = self.table.get(self.labels[at]).map_or_else(|| density_of_code(self.codes[at]), Region::mean);
        f64::from(density)
    }

    /// The same where no voxel of a brick leaps: voxels outside regions keep their 16 bits.
    pub(crate) fn flattened_code(&self, p: IVec3) -> f64 {
        let at = self.at(p);
        let code = self.table.get(self.labels[at]).map_or(self.codes[at], |region| code_of_density(region.mean()));
        f64::from(code) * f64::from(MAX_DENSITY) / 65535.0
    }

    /// The volume's code.
    pub(crate) fn own_code(&self, p: IVec3) -> u16 {
        self.codes[self.at(p)]
    }

    /// Trilinear between voxel centres.
    pub(crate) fn trilinear(p: [f64; 3], voxel: impl Fn(IVec3) -> f64) -> f64 {
        let low = p.map(|x| (x - 0.5).floor());
        let w: [f64; 3] = std::array::from_fn(|a| p[a] - 0.5 - low[a]);
        (0..8)
            .map(|corner| {
                let bit = |a: usize| corner >> a & 1;
                let weight: f64 = (0..3).map(|a| if bit(a) == 1 { w[a] } else { 1.0 - w[a] }).product();
                let at = IVec3::from_array(std::array::from_fn(|a| low[a] as i32 + bit(a)));
                if weight == 0.0 { 0.0 } else { weight * voxel(at) }
            })
            .sum()
    }

    pub(crate) fn voxels(&self, stored: StoredBox) -> BrickVoxels {
        BrickVoxels { stored, codes: cut(stored, |p| self.codes[self.at(p)]), has_holes: false }
    }

    pub(crate) fn regions(&self, stored: StoredBox) -> BrickRegions {
        self.regions_around(stored, 1)
    }

    /// With so many voxels more on every side.
    pub(crate) fn regions_around(&self, stored: StoredBox, margin: i32) -> BrickRegions {
        let covered = StoredBox { lo: stored.lo - margin, hi: stored.hi + margin };
        BrickRegions {
            covered,
            labels: cut(covered, |p| self.labels[self.at(p)]),
            distances: cut(covered, |p| self.distances[self.at(p)]),
        }
    }

    pub(crate) fn texels(&self, owned: &OwnedBox, guard: u32) -> RegionTexels {
        let stored = owned.stored(1);
        region_texels(&self.voxels(stored), &self.regions(stored), &self.table, guard, 0).unwrap()
    }

    /// The owned boxes of a grid of bricks.
    pub(crate) fn bricks(&self, size: u32) -> Vec<OwnedBox> {
        let grid = BrickGrid::new(self.dims, size).unwrap();
        grid.bricks().map(|b| grid.owned_box(b)).collect()
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

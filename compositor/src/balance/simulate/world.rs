//! The modelled volume: chunks on a grid, a body with surfaces in it, and nodes that hold them at first.

use brickcast_volume::{ChunkId, PerChunk};
use glam::{DVec3, UVec3};

use super::grid::{chunk_ids, corner};
use super::layers::Tree;
use super::random::{noise, uniform};
use super::spec::Spec;

/// Resident bytes of a chunk all of whose bricks are shown: 128^3 voxels of two bytes.
pub(super) const CHUNK_BYTES: u64 = 4 << 20;
/// Sample positions on a line as long as a chunk: 128 voxels in steps of half a voxel.
pub(super) const POSITIONS: f64 = 256.0;
/// Points per axis of a chunk at which the body is looked up.
const POINTS: u32 = 6;

/// Lengths count in edges of a chunk.
#[derive(Debug)]
pub(super) struct World {
    pub(super) dims: UVec3,
    pub(super) tree: Tree,
    /// Samples per position, hidden from the balancer; 0: nothing is shown.
    pub(super) rho: PerChunk<f64>,
    /// What is known before: the share of its eight bricks that are shown.
    pub(super) shown: PerChunk<f64>,
    /// What the camera looks at: the body's dense part.
    pub(super) target: DVec3,
    pub(super) seed: u64,
}

/// Near-cubic dimensions with about `count` chunks.
fn near_cube(count: u32) -> UVec3 {
    let edge = f64::from(count).cbrt();
    let (low, high) = ((edge * 0.75).floor().max(1.0) as u32, (edge * 1.5).ceil() as u32);
    let mut best = (f64::INFINITY, UVec3::ONE);
    for x in low..=high {
        for y in low..=x {
            for z in low..=y {
                let missed = f64::from(x * y * z).sqrt() - f64::from(count).sqrt();
                // Nearest in number, then nearest to a cube.
                let rank = missed.abs() * 100.0 + f64::from(x - z);
                if rank < best.0 {
                    best = (rank, UVec3::new(x, y, z));
                }
            }
        }
    }
    best.1
}

impl World {
    pub(super) fn new(spec: &Spec) -> Self {
        let dims = near_cube(spec.chunks);
        let d = dims.as_dvec3();
        let seed = spec.seed;
        let jitter = |n: u64| DVec3::new(uniform(&[seed, n, 0]), uniform(&[seed, n, 1]), uniform(&[seed, n, 2])) - 0.5;
        // A hull, a dense core off its middle, a rod through both; in units of the volume.
        let (middle, core) = (DVec3::splat(0.5) + jitter(1) * 0.06, DVec3::splat(0.5) + jitter(2) * 0.3);
        let inside = |p: DVec3| -> f64 {
            let hull = ((p - middle) / DVec3::new(0.46, 0.42, 0.38)).length();
            let axis = DVec3::new(p.x - core.x, 0.0, p.z - core.z).length();
            if p.distance(core) < 0.13 {
                1.4
            } else if (0.88..1.0).contains(&hull) {
                1.0
            } else if axis < 0.05 && hull < 1.0 {
                0.7
            } else {
                0.0
            }
        };
        let (mut rho, mut shown) = (Vec::new(), Vec::new());
        for chunk in chunk_ids(dims) {
            let lo = corner(dims, chunk).as_dvec3();
            let mut sum = 0.0;
            let mut octants = [false; 8];
            for point in 0..POINTS.pow(3) {
                let at = UVec3::new(point % POINTS, point / POINTS % POINTS, point / POINTS / POINTS);
                let density = inside((lo + (at.as_dvec3() + 0.5) / f64::from(POINTS)) / d);
                sum += density;
                let octant = at * 2 / POINTS;
                octants[(octant.x + 2 * octant.y + 4 * octant.z) as usize] |= density > 0.0;
            }
            let grain = noise(0.3, &[seed, 3, chunk.linear().into()]);
            rho.push(sum / f64::from(POINTS.pow(3)) * grain);
            shown.push(octants.iter().filter(|o| **o).count() as f64 / 8.0);
        }
        Self { dims, tree: Tree::new(dims), rho: rho.into(), shown: shown.into(), target: core * d, seed }
    }

    pub(super) fn count(&self) -> usize {
        self.rho.count()
    }

    /// All chunks, x fastest.
    pub(super) fn chunks(&self) -> impl Iterator<Item = ChunkId> + use<> {
        self.rho.ids()
    }

    pub(super) fn bytes(&self, chunk: ChunkId) -> u64 {
        (CHUNK_BYTES as f64 * self.shown[chunk]) as u64
    }

    /// Memory of a node for chunks.
    pub(super) fn budget(&self, spec: &Spec) -> u64 {
        let all: u64 = self.chunks().map(|c| self.bytes(c)).sum();
        ((spec.memory * all as f64 / spec.nodes as f64) as u64).max(16 * CHUNK_BYTES)
    }

    /// Contiguous runs of the tree's order with nearly equal numbers of shown bricks, as a session deals chunks at
    /// first: the run of every chunk.
    pub(super) fn runs(&self, runs: usize) -> PerChunk<usize> {
        let total = self.shown.values().sum::<f64>().max(1e-9);
        let mut owner = PerChunk::filled(0, self.count());
        let mut before = 0.0;
        for chunk in self.tree.order() {
            let middle = before + self.shown[chunk] / 2.0;
            owner[chunk] = ((middle / total * runs as f64) as usize).min(runs.saturating_sub(1));
            before += self.shown[chunk];
        }
        owner
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_are_near_cubes_of_about_the_number() {
        assert_eq!((near_cube(512), near_cube(1), near_cube(64)), (UVec3::splat(8), UVec3::ONE, UVec3::splat(4)));
        for count in 1..=4096 {
            let d = near_cube(count);
            let got = d.element_product();
            assert!(got.abs_diff(count) * 6 <= count.max(6), "{count}: {d}");
            assert!(d.max_element() <= 2 * d.min_element() + 1, "{count}: {d}");
        }
    }

    #[test]
    fn a_world_has_empty_and_heavy_chunks() {
        let world = World::new(&Spec::default());
        let empty = world.rho.values().filter(|r| **r == 0.0).count();
        let heavy = world.rho.values().filter(|r| **r > 0.8).count();
        assert!((100..400).contains(&empty) && (3..100).contains(&heavy), "{empty} empty, {heavy} heavy");
        assert!(world.rho.values().zip(world.shown.values()).all(|(r, s)| (*r > 0.0) == (*s > 0.0)));
        let runs = world.runs(8);
        let shown = || runs.values().zip(world.shown.values());
        let bricks = |n| shown().filter(|(r, _)| **r == n).map(|(_, s)| s * 8.0).sum::<f64>();
        let all: Vec<f64> = (0..8).map(bricks).collect();
        assert!(all.iter().all(|b| (b - all.iter().sum::<f64>() / 8.0).abs() <= 8.0), "{all:?}");
    }
}

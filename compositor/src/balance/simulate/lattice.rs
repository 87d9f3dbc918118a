//! What a view costs: rays through the grid on a lattice of pixels.

use brickcast_volume::{ChunkId, PerChunk};
use glam::{DVec3, IVec3};

use super::grid::chunk_at;
use super::path::{Eye, eye};
use super::random::noise;
use super::spec::{PathKind, Spec};
use super::world::{POSITIONS, World};
use crate::balance::Demand;

/// Pixels per side of a tile.
const TILE: u32 = 64;
/// Rays per side of a tile, at least so many per side of the picture.
const RAYS: u32 = 2;
const LEAST_RAYS: u32 = 64;
/// Half the height of the picture at distance 1: a vertical angle of 30 degrees.
const HALF_HEIGHT: f64 = 0.267_949_192;
/// Costs deviate from chunk to chunk and view to view, and in a chunk from strip to strip.
const CHUNK_NOISE: f64 = 0.1;
const STRIP_NOISE: f64 = 0.1;
/// Along a path, a chunk's deviation changes in so many views; views on their own deviate on their own.
const DRIFT: u32 = 10;

/// A chunk that a view sees.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    /// Tiles: x and y, half-open.
    pub(super) lo: [usize; 2],
    pub(super) hi: [usize; 2],
    /// Cost per strip of tiles along the longer side.
    pub(super) cost: Vec<f64>,
}

impl Seen {
    fn long_side(&self) -> usize {
        usize::from(self.hi[1] - self.lo[1] > self.hi[0] - self.lo[0])
    }

    /// Tiles of some strips.
    pub(super) fn tiles(&self, strips: [u32; 2]) -> usize {
        let short = 1 - self.long_side();
        (strips[1] - strips[0]) as usize * (self.hi[short] - self.lo[short])
    }
}

/// One view: what it costs, and what the balancer is told of it.
#[derive(Debug)]
pub(super) struct ViewCosts {
    /// `None`: not in view, or nothing of it is shown.
    pub(super) seen: PerChunk<Option<Seen>>,
    pub(super) demand: Demand,
}

impl ViewCosts {
    pub(super) fn new(world: &World, spec: &Spec, view: u32) -> Self {
        let eye = eye(world, spec, view);
        let tiles = spec.size.div_ceil(TILE);
        let rays = RAYS * LEAST_RAYS.div_ceil(RAYS * tiles) * tiles;
        let pixels = (f64::from(spec.size) / f64::from(rays)).powi(2);
        let mut sums: PerChunk<Sums> = world.chunks().map(|_| Sums::new(tiles as usize)).collect();
        for ray in 0..rays * rays {
            let (x, y) = (ray % rays, ray / rays);
            let tile = [x, y].map(|v| (v * tiles / rays) as usize);
            let at = |i: u32| ((f64::from(i) + 0.5) / f64::from(rays) * 2.0 - 1.0) * HALF_HEIGHT;
            let direction = (eye.forward + eye.right * at(x) - eye.up * at(y)).normalize();
            // The balancer looks at every other ray only, as on the white fields of a chess board.
            let told = (x + y).is_multiple_of(2);
            walk(world, &eye, direction, &mut |chunk, length| {
                sums[chunk].add(tile, length * POSITIONS * pixels, told);
            });
        }
        let strips = PerChunk::filled(Vec::new(), world.count());
        let demand = Demand { strips, ..Demand::default() };
        let mut picture = Self { seen: PerChunk::filled(None, world.count()), demand };
        for (chunk, sums) in sums.iter().filter(|(c, _)| world.shown[*c] > 0.0) {
            let Some(mut seen) = sums.seen() else { continue };
            let side = seen.long_side();
            let strips = seen.lo[side]..seen.hi[side];
            let rho = world.rho[chunk] * deviation(world, spec, chunk, view);
            let cost = |strip: usize| {
                let mottle = noise(STRIP_NOISE, &[world.seed, 6, chunk.linear().into(), u64::from(view), strip as u64]);
                sums.all[side][strip] * rho * mottle
            };
            seen.cost = strips.clone().map(cost).collect();
            picture.demand.strips[chunk] = sums.told[side][strips].to_vec();
            picture.seen[chunk] = Some(seen);
        }
        picture
    }

    /// The cost of a chunk; 0 out of view.
    pub(super) fn cost(&self, chunk: ChunkId) -> f64 {
        self.seen[chunk].as_ref().map_or(0.0, |seen| seen.cost.iter().sum())
    }
}

/// Positions inside one chunk, per column and per row of tiles.
struct Sums {
    all: [Vec<f64>; 2],
    /// What the balancer is told.
    told: [Vec<f64>; 2],
}

impl Sums {
    fn new(tiles: usize) -> Self {
        let empty = || [vec![0.0; tiles], vec![0.0; tiles]];
        Self { all: empty(), told: empty() }
    }

    fn add(&mut self, tile: [usize; 2], positions: f64, told: bool) {
        for (side, at) in tile.into_iter().enumerate() {
            self.all[side][at] += positions;
            self.told[side][at] += if told { 2.0 * positions } else { 0.0 };
        }
    }

    /// The tiles with positions; costs are not known yet.
    fn seen(&self) -> Option<Seen> {
        let first = |side: usize| self.all[side].iter().position(|p| *p > 0.0);
        let last = |side: usize| self.all[side].iter().rposition(|p| *p > 0.0);
        Some(Seen { lo: [first(0)?, first(1)?], hi: [last(0)? + 1, last(1)? + 1], cost: Vec::new() })
    }
}

/// By how much a chunk costs more in a view than its density says.
fn deviation(world: &World, spec: &Spec, chunk: ChunkId, view: u32) -> f64 {
    let at = |knot: u32| noise(CHUNK_NOISE, &[world.seed, 5, chunk.linear().into(), u64::from(knot)]);
    match spec.path {
        PathKind::Random => at(view),
        PathKind::Dive => {
            let (knot, part) = (view / DRIFT, f64::from(view % DRIFT) / f64::from(DRIFT));
            at(knot) * (1.0 - part) + at(knot + 1) * part
        }
    }
}

/// Tells each chunk that a ray crosses, with the length within (Amanatides & Woo 1987).
fn walk(world: &World, eye: &Eye, direction: DVec3, tell: &mut impl FnMut(ChunkId, f64)) {
    let dims = world.dims.as_dvec3();
    let (mut enter, mut leave) = (0.0_f64, f64::MAX);
    let inverse = direction.map(|d| if d.abs() < 1e-12 { 1e12 } else { 1.0 / d });
    for a in 0..3 {
        let (t0, t1) = (-eye.at[a] * inverse[a], (dims[a] - eye.at[a]) * inverse[a]);
        (enter, leave) = (enter.max(t0.min(t1)), leave.min(t0.max(t1)));
    }
    if enter >= leave {
        return;
    }
    let last = world.dims.as_ivec3() - 1;
    let mut cell = (eye.at + direction * (enter + 1e-9)).floor().as_ivec3().clamp(IVec3::ZERO, last);
    let step = inverse.map(f64::signum).as_ivec3();
    let mut t = enter;
    while t < leave {
        let ahead = (cell + step.max(IVec3::ZERO)).as_dvec3();
        let exits = (ahead - eye.at) * inverse;
        let axis = if exits.x <= exits.y && exits.x <= exits.z { 0 } else { 1 + usize::from(exits.z < exits.y) };
        let exit = exits[axis].min(leave);
        if exit > t {
            tell(chunk_at(world.dims, cell.as_uvec3()), exit - t);
        }
        t = t.max(exit);
        cell[axis] += step[axis];
        if cell[axis] < 0 || cell[axis] > last[axis] {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_is_as_long_as_its_way_through_the_volume() {
        let world = World::new(&Spec { chunks: 60, ..Spec::default() });
        let d = world.dims.as_dvec3();
        for i in 0..200_u64 {
            let random = |n: u64| crate::balance::simulate::random::uniform(&[i, n]);
            let at = DVec3::new(random(0), random(1), random(2)) * d * 1.5 - d * 0.25;
            let forward = (DVec3::new(random(3), random(4), random(5)) - 0.5).normalize();
            let eye = Eye { at, forward, right: DVec3::X, up: DVec3::Y };
            let (mut sum, mut chunks) = (0.0, Vec::new());
            walk(&world, &eye, forward, &mut |chunk, length| {
                sum += length;
                chunks.push(chunk);
            });
            let inside = |t: f64| {
                let p = at + forward * t;
                p.cmpge(DVec3::ZERO).all() && p.cmplt(d).all()
            };
            let marched = (0..40_000).filter(|k| inside(f64::from(*k) * 0.001)).count() as f64 * 0.001;
            assert!((sum - marched).abs() < 0.005, "{sum} {marched}");
            let crossed = chunks.len();
            chunks.dedup();
            assert_eq!(chunks.len(), crossed);
        }
    }

    #[test]
    fn about_half_of_the_views_are_inside() {
        for path in [PathKind::Dive, PathKind::Random] {
            let spec = Spec { path, ..Spec::default() };
            let world = World::new(&spec);
            let inside = |v: &u32| {
                let at = eye(&world, &spec, *v).at;
                at.cmpge(DVec3::ZERO).all() && at.cmplt(world.dims.as_dvec3()).all()
            };
            let count = (0..240).filter(inside).count();
            assert!((90..150).contains(&count), "{path:?}: {count} of 240");
        }
    }

    #[test]
    fn what_the_balancer_is_told_is_near_the_truth() {
        let spec = Spec::default();
        let world = World::new(&spec);
        for view in [0, 30] {
            let picture = ViewCosts::new(&world, &spec, view);
            let (mut told, mut true_cost) = (0.0, 0.0);
            for chunk in world.chunks() {
                assert_eq!(picture.demand.strips[chunk].is_empty(), picture.seen[chunk].is_none());
                told += picture.demand.strips[chunk].iter().sum::<f64>() * world.rho[chunk];
                true_cost += picture.cost(chunk);
            }
            assert!((told / true_cost - 1.0).abs() < 0.1, "{told} {true_cost}");
        }
    }
}

//! Where rays meet isosurfaces, and which way these face: against analytic bodies and against the roots of the very
//! field.

use std::f64::consts::{FRAC_PI_2, PI};

use brickcast_volume::style::{Isosurface, Style};
use brickcast_volume::transfer_function::{TransferFunction, TransferTable};
use brickcast_volume::{Camera, Geometry, Orbit, OwnedBox, PictureSize, Premul, View};
use glam::{DVec3, UVec3};

use super::bindings::{Along, Bindings, BrickData, SceneData, Tables};
use super::light::gradient_at;
use super::march::march;
use super::ray::pixel_ray;
use super::run::Run;
use super::scene::Styled;
use super::surface::crossing;
use super::take::{Slabs, Take};
use super::walk::{Uncoded, Unmapped};
use crate::key::{KernelKey, SlabKind, TakeKind};
use crate::layout::{BrickUniform, FrameUniform};
use crate::style::StyleUniform;

/// A field over index space, larger inside, and its surface at 0.
type Field = fn(DVec3, f64) -> f64;

/// The signed distance to a sphere of 3/8 of the edge.
fn sphere(p: DVec3, edge: f64) -> f64 {
    0.375 * edge - (p - edge / 2.0).length()
}

/// The signed distance to a torus about z of 0.27 and 0.15 of the edge.
fn torus(p: DVec3, edge: f64) -> f64 {
    let q = p - edge / 2.0;
    0.15 * edge - DVec3::new(q.truncate().length() - 0.27 * edge, q.z, 0.0).length()
}

/// Marschner & Lobb 1994, equation 2, around its middle value.
fn marschner_lobb(p: DVec3, edge: f64) -> f64 {
    let q = (p - edge / 2.0) / (edge / 2.0);
    let wave = (2.0 * PI * 6.0 * (FRAC_PI_2 * q.truncate().length()).cos()).cos();
    (1.0 - (FRAC_PI_2 * q.z).sin() + 0.25 * (1.0 + wave)) / (2.0 * 1.25) - 0.5
}

/// Codes of a field; 0 is in the middle of the range.
struct Volume {
    edge: u32,
    codes: Vec<u16>,
    stored: brickcast_volume::StoredBox,
    half: f64,
    field: Field,
}

impl Volume {
    fn new(edge: u32, half: f64, field: Field) -> Self {
        let stored = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(edge) }.stored(3);
        let at = |i: i32| f64::from(i.clamp(0, edge as i32 - 1)) + 0.5;
        let mut codes = Vec::new();
        for z in stored.lo.z..stored.hi.z {
            for y in stored.lo.y..stored.hi.y {
                for x in stored.lo.x..stored.hi.x {
                    let value = field(DVec3::new(at(x), at(y), at(z)), f64::from(edge));
                    codes.push(((value / half * 0.5 + 0.5).clamp(0.0, 1.0) * 65535.0).round() as u16);
                }
            }
        }
        Self { edge, codes, stored, half, field }
    }

    /// Of the codes, in f64.
    fn trilinear(&self, p: DVec3) -> f64 {
        let dims = self.stored.dims();
        let q = p - self.stored.lo.as_dvec3() - 0.5;
        let (i, w) = (q.floor().as_uvec3(), q.fract());
        let code = |x: u32, y: u32, z: u32| {
            f64::from(self.codes[(((i.z + z) * dims.y + i.y + y) * dims.x + i.x + x) as usize])
        };
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let row = |y, z| mix(code(0, y, z), code(1, y, z), w.x);
        let face = |z| mix(row(0, z), row(1, z), w.y);
        (mix(face(0), face(1), w.z) / 65535.0 - 0.5) * 2.0 * self.half
    }

    /// By central differences of the formula.
    fn normal(&self, p: DVec3) -> DVec3 {
        let rise = |axis: DVec3| {
            let edge = f64::from(self.edge);
            (self.field)(p + axis * 1e-5, edge) - (self.field)(p - axis * 1e-5, edge)
        };
        DVec3::new(rise(DVec3::X), rise(DVec3::Y), rise(DVec3::Z)).normalize()
    }
}

/// The kernel's take, watched: at how many steps the ray met the first surface.
struct FirstHit {
    slabs: Slabs,
    k: Option<f32>,
}

impl Take for FirstHit {
    type Scene = Styled;
    const TAKES_EMPTY: bool = Slabs::TAKES_EMPTY;

    fn ends_beyond(bound: &Bindings<'_>) -> bool {
        Slabs::ends_beyond(bound)
    }

    fn neutral_code(bound: &Bindings<'_>) -> f32 {
        Slabs::neutral_code(bound)
    }

    fn enter_take(along: &Along<'_>) -> Self {
        Self { slabs: Slabs::enter_take(along), k: None }
    }

    fn take(&mut self, along: &Along<'_>, p: [f32; 3], run: Run, sum: &mut Premul) -> bool {
        let (before, front) = (sum.a, self.slabs.front);
        let shows = self.slabs.take(along, p, run, sum);
        if sum.a > before && self.k.is_none() {
            let value = along.bound.scene.style.codes[0][0];
            let back = self.slabs.front;
            let crosses = run.follows && (front.code >= value) != (back.code >= value);
            // Else it was met with the entry.
            self.k = if crosses { crossing(along, &front, &back, value) } else { Some(run.k) };
        }
        shows
    }
}

/// The root of `f` nearest to `from`, within a step, sampled 2,000 times.
fn root(f: impl Fn(f64) -> f64, from: f64, step: f64) -> Option<f64> {
    let at = |i: i32| from + step * f64::from(i) / 1000.0;
    let outwards = (0..1000).flat_map(|i| [i, -1 - i]);
    let crossed = outwards.into_iter().find(|&i| (f(at(i)) >= 0.0) != (f(at(i + 1)) >= 0.0))?;
    let (mut lo, mut hi) = (at(crossed), at(crossed + 1));
    for _ in 0..40 {
        let middle = 0.5 * (lo + hi);
        if (f(middle) >= 0.0) == (f(lo) >= 0.0) { lo = middle } else { hi = middle }
    }
    Some(0.5 * (lo + hi))
}

/// What rays saw: hits, the largest distance along the ray (in steps) to the nearest root of the voxels' field, the
/// largest distance to the formula's surface (along its normal, in steps), and the largest angle (degrees) between the
/// kernel's gradient and the formula's.
#[derive(Debug, Default)]
struct Seen {
    hits: u32,
    depth: f64,
    analytic: f64,
    angle: f64,
}

fn look(volume: &Volume, step: f64) -> Seen {
    let geometry = Geometry::new([volume.edge; 3], [1.0; 3], [0.0; 3]).unwrap();
    let orbit = Orbit { azimuth: 33.0, elevation: 24.0, zoom: 1.2, ..Orbit::default() };
    let camera = Camera::orbit(&geometry, orbit).unwrap();
    let size = PictureSize::new(120, 120).unwrap();
    let view = View::new(&geometry, &camera, size, step).unwrap();
    let table = TransferTable::build(&TransferFunction::nothing(), (-volume.half, volume.half), step);
    let surfaces = vec![Isosurface { value: 0.0, color: [1.0; 3], opacity: 1.0 }];
    let style = StyleUniform::new(&Style { surfaces, ..Style::default() }, &geometry, (-volume.half, volume.half));
    let frame = FrameUniform::new(&view.kernel(), &table, 0.999);
    let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(volume.edge) };
    let brick = BrickUniform::of_boxes(&owned, &volume.stored);
    let data = BrickData { texels: &volume.codes, means: None, map: None, flags: &[] };
    let tables = Tables { table: &table.entries, region: None };
    let take = TakeKind::Slabs(SlabKind { surfaces: true, ..SlabKind::default() });
    let scene = SceneData { frame: &frame, style: &style, tables, slabs: None };
    let bound = Bindings { scene: &scene, brick: &brick, data, key: KernelKey { take, ..KernelKey::PLAIN } };
    let mut seen = Seen::default();
    for (x, y) in (0..120).flat_map(|y| (0..120).map(move |x| (x, y))) {
        let ray = pixel_ray(&frame, x, y);
        let mut sum = Premul::CLEAR;
        let hit = march::<Unmapped, Uncoded, FirstHit>(&bound, &ray, &mut sum).and_then(|(take, _)| take.k);
        assert_eq!(sum.a > 0.0, hit.is_some());
        let Some(t) = hit.map(|k| f64::from(k * frame.step)) else { continue };
        let at = |t: f64| DVec3::from(ray.origin.map(f64::from)) + t * DVec3::from(ray.direction.map(f64::from));
        let p = at(t);
        // A body that the volume's face cuts is met there, at no root.
        let inside = p.min_element() > 1.5 && p.max_element() < f64::from(volume.edge) - 1.5;
        // Grazing rays hit or miss by the voxels.
        let normal = volume.normal(p);
        let facing = normal.dot(at(1.0) - at(0.0)).abs();
        if !inside || facing < 0.2 {
            continue;
        }
        let voxels = root(|t| volume.trilinear(at(t)), t, step).expect("the voxels' field has a root here");
        seen.hits += 1;
        seen.depth = seen.depth.max((voxels - t).abs() / step);
        if let Some(exact) = root(|t| (volume.field)(at(t), f64::from(volume.edge)), t, step) {
            seen.analytic = seen.analytic.max((exact - t).abs() * facing / step);
        } else {
            seen.analytic = f64::INFINITY;
        }
        let along = Along::new(&bound, &ray);
        let gradient = DVec3::from(gradient_at(&along, p.as_vec3().into()).unwrap().map(f64::from)).normalize();
        seen.angle = seen.angle.max(gradient.dot(normal).clamp(-1.0, 1.0).acos().to_degrees());
    }
    seen
}

#[test]
fn surfaces_lie_where_the_bodies_are() {
    for (name, field) in [("sphere", sphere as Field), ("torus", torus)] {
        for edge in [64, 128] {
            let seen = look(&Volume::new(edge, f64::from(edge), field), 1.0);
            eprintln!("{name}, {edge}^3: {seen:?}");
            assert!(seen.hits > 1000);
            assert!(seen.depth < 1.0 / 64.0, "{name}, {edge}^3: {seen:?}");
            assert!(seen.angle < 2.0, "{name}, {edge}^3: {seen:?}");
            // Nearly all of it is what trilinear interpolation is off by.
            let bound = if (name, edge) == ("torus", 64) { 2.0 / 64.0 } else { 1.0 / 64.0 };
            assert!(seen.analytic < bound, "{name}, {edge}^3: {seen:?}");
        }
    }
}

/// Its waves are finer than voxels can carry (three and a half voxels long at 64^3): of the formula it is only told how
/// far off voxels are, the kernel is held to the roots of the voxels' field.
#[test]
fn surfaces_of_marschner_and_lobb_lie_at_the_roots_of_their_voxels() {
    for edge in [64, 128] {
        for step in [0.5, 0.25] {
            let seen = look(&Volume::new(edge, 0.5, marschner_lobb), step);
            eprintln!("Marschner-Lobb, {edge}^3, step {step}: {seen:?}");
            assert!(seen.hits > 500);
            assert!(seen.depth < 1.0 / 64.0, "{edge}^3: {seen:?}");
        }
    }
}

/// Half a voxel off is noticed.
#[test]
fn a_shifted_body_is_noticed() {
    let shifted: Field = |p, edge| sphere(p + 0.1, edge);
    let volume = Volume { field: sphere, ..Volume::new(64, 64.0, shifted) };
    assert!(look(&volume, 1.0).analytic > 2.0 / 64.0);
}

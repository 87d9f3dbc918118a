//! One hazard a test.

use glam::{DVec3, IVec3};

use super::field::Field;
use super::march::{Broken, Comparison, compare, ray};
use brickcast_shaders::twin::ray::Ray;

/// Half a 14-bit code, by the inner bit that takes part in interpolation, and what f32 weights err by at full contrast.
pub(crate) const HALF_CODE: f64 = 0.5 + 0.1;

const NOISE: u32 = 0;

/// Values all over the range, none like its neighbours.
pub(crate) fn noise(p: IVec3) -> u16 {
    let x = (p.x.wrapping_mul(73_856_093) ^ p.y.wrapping_mul(19_349_663) ^ p.z.wrapping_mul(83_492_791)) as u32;
    let x = (x ^ x >> 13).wrapping_mul(0x9e37_79b1);
    ((x ^ x >> 16) & 0xffff) as u16
}

/// Rays from points about the volume, and from inside it, through points of it: oblique ones and ones along axes.
pub(crate) fn rays(dims: [u32; 3], voxels_per_unit: DVec3) -> Vec<Ray> {
    let size = glam::UVec3::from(dims).as_dvec3();
    let mut rays = Vec::new();
    for i in 0..40 {
        let f = |n: i32, m: f64| (f64::from(i * n % 97) / 97.0) * m;
        let target = DVec3::new(f(31, size.x), f(17, size.y), f(53, size.z));
        let from = size * 0.5 + (DVec3::new(f(41, 2.0), f(67, 2.0), f(7, 2.0)) - 1.0) * size;
        rays.push(ray(from, target, voxels_per_unit));
        rays.push(ray(target, from, voxels_per_unit));
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][i as usize % 3];
        rays.push(ray(target - axis * 50.0, target, voxels_per_unit));
    }
    rays
}

/// Sound marches of all steps and brick sizes are exact; returns them joined.
fn assert_exact(field: &Field, steps: &[f32], voxels_per_unit: DVec3) -> Comparison {
    let mut joined = Comparison::default();
    let rays = rays(field.dims.into(), voxels_per_unit);
    for &step in steps {
        for size in [8, 16, 64] {
            let c = compare(field, size, step, &rays, Broken::Nothing);
            assert!(c.worst <= HALF_CODE, "step {step}, bricks of {size}: off by {} densities", c.worst);
            joined.samples += c.samples;
            joined.positions += c.positions;
            joined.leapt += c.leapt;
            joined.segments += c.segments;
        }
    }
    joined
}

const STEPS: [f32; 4] = [0.25, 0.5, 1.0, 2.0];

/// A ball in noise.
fn ball(p: IVec3, center: IVec3, radius: i32) -> bool {
    (p - center).length_squared() <= radius * radius
}

/// The eye in the middle of a region, among leap voxels: no sample comes before that could say so.
#[test]
fn ray_starts_inside_leap_voxels() {
    let center = IVec3::splat(20);
    let field =
        Field::new([40; 3], |p| if ball(p, center, 16) { (20_000 + noise(p) % 99, 1) } else { (noise(p), NOISE) });
    let rays: Vec<Ray> = (0..200)
        .map(|i| ray(DVec3::splat(20.3), DVec3::new(noise(IVec3::splat(i)).into(), f64::from(i), 2000.0), DVec3::ONE))
        .collect();
    for step in STEPS {
        for size in [8, 16, 64] {
            let c = compare(&field, size, step, &rays, Broken::Nothing);
            assert!(c.worst <= HALF_CODE && c.leapt > c.positions / 4, "step {step}, bricks of {size}: {c:?}");
        }
    }
}

/// Bricks that hold nothing but one region: with their stored box (a single texel), and with all but one ghost voxel.
#[test]
fn brick_wholly_inside_region() {
    let field = Field::new([48; 3], |p| {
        let inside = p.cmpge(IVec3::splat(3)).all() && p != IVec3::splat(16);
        if inside { (30_000 + noise(p) % 500, 1) } else { (noise(p), NOISE) }
    });
    let uniform = field
        .bricks(8)
        .into_iter()
        .filter(|b| matches!(field.texels(b, 3), brickcast_volume::regions::RegionTexels::Uniform { label: 1, .. }));
    assert!(uniform.count() > 20);
    let c = assert_exact(&field, &STEPS, DVec3::ONE);
    assert!(c.leapt > c.positions / 2, "{c:?}");
}

/// Everything is one region, to the volume's border and beyond: no guard anywhere, and a leap for each brick.
#[test]
fn ray_never_meets_a_guard() {
    let field = Field::new([30, 20, 40], |p| (12_345 + noise(p) % 77, 1));
    let c = assert_exact(&field, &STEPS, DVec3::ONE);
    assert_eq!(c.leapt, c.positions);
    assert!(c.samples <= 2 * c.segments, "{c:?}");
}

/// Half of the volume is a region up to the border, where voxels repeat: leaps end at the volume's end.
#[test]
fn region_touches_volume_border() {
    let field = Field::new([33, 20, 20], |p| if p.x >= 12 { (40_000, 1) } else { (noise(p), NOISE) });
    let c = assert_exact(&field, &STEPS, DVec3::ONE);
    assert!(c.leapt > c.positions / 3, "{c:?}");
}

/// Two regions of one mean that touch: leaps of one must end before the other's guards as before any other voxel.
#[test]
fn two_regions_with_equal_mean() {
    let field = Field::new([40, 24, 24], |p| match p.x {
        0..18 => (25_000, 1),
        18..36 => (25_000, 2),
        _ => (noise(p), NOISE),
    });
    assert_eq!(field.table.0[0].mean(), field.table.0[1].mean());
    let c = assert_exact(&field, &STEPS, DVec3::ONE);
    assert!(c.leapt > c.positions / 4, "{c:?}");
}

/// One voxel inside a wide region, of the other end of the range: every ray through its support must see it.
#[test]
fn single_voxel_pore_is_never_skipped() {
    let pore = IVec3::new(21, 17, 19);
    let field = Field::new([40; 3], |p| if p == pore { (0, NOISE) } else { (60_000, 1) });
    assert_exact(&field, &STEPS, DVec3::ONE);
    // At step 1 a ray through the pore's centre has a sample within half a voxel of it: at least an eighth of its
    // depth.
    let (mut met, depth) = (0, field.flattened(IVec3::ZERO));
    for i in 0..200 {
        let from = DVec3::new(f64::from(i % 20) * 4.0 - 20.0, f64::from(i / 20) * 9.0 - 25.0, -40.0);
        let through = ray(from, pore.as_dvec3() + 0.5, DVec3::ONE);
        let lowest = super::march::lowest(&field, 16, 0.5, &through);
        met += usize::from(f64::from(lowest) < depth * 0.9);
    }
    assert_eq!(met, 200);
}

/// A background at the end of the range (air that the scanner cut off at 0), with a body of noise in it: equal values
/// that are no region, beside equal values that are one.
#[test]
fn saturated_flat_background() {
    for background in [0, u16::MAX] {
        for label in [NOISE, 1] {
            let field = Field::new([40; 3], |p| {
                let body = ball(p, IVec3::new(22, 20, 18), 9);
                let flat = ball(p, IVec3::new(22, 20, 18), 5);
                match (body, flat) {
                    (true, true) => (33_000, 2),
                    (true, false) => (noise(p), NOISE),
                    _ => (background, label),
                }
            });
            assert_exact(&field, &STEPS, DVec3::ONE);
        }
    }
}

/// Spacings of 1 : 2 : 3: a step is shorter in voxels along two axes, never longer.
#[test]
fn anisotropic_spacing() {
    let field = Field::new([40, 30, 24], |p| {
        let inside = (p - IVec3::new(20, 14, 12)).abs().cmplt(IVec3::new(14, 11, 10)).all();
        if inside { (45_000 + noise(p) % 300, 1) } else { (noise(p), NOISE) }
    });
    for spacing in [DVec3::new(1.0, 2.0, 3.0), DVec3::new(3.0, 1.0, 2.0)] {
        let c = assert_exact(&field, &STEPS, spacing.recip());
        assert!(c.leapt > c.positions / 10, "{c:?}");
    }
}

//! Steps and distances far beyond the usual: guards of many voxels, and positions whose last place is large.

use brickcast_shaders::twin::ray::Ray;
use glam::{DVec3, IVec3};

use super::field::Field;
use super::hazards::{HALF_CODE, noise, rays};
use super::march::{Broken, compare, ray};

/// One region between two ends of noise, up to the border on four sides: voxels in its middle are 53 from the next
/// label.
fn wide_region() -> Field {
    Field::new([120, 24, 24], |p| {
        let inside = (6..113).contains(&p.x);
        if inside { (40_000 + noise(p) % 200, 1) } else { (noise(p), 0) }
    })
}

/// Rays that go through most of the length of the region, at small angles, both ways.
fn long_rays() -> Vec<Ray> {
    let mut rays = rays([120, 24, 24], DVec3::ONE);
    for i in 0..400 {
        let f = |n: i32, m: f64| f64::from(i * n % 401) / 401.0 * m;
        let (a, b) =
            (DVec3::new(-20.0 - f(57, 16.0), f(83, 24.0), f(131, 24.0)), DVec3::new(140.0, f(29, 24.0), f(173, 24.0)));
        let (from, to) = if i % 2 == 0 { (a, b) } else { (b, a) };
        rays.push(ray(from, to, DVec3::ONE));
    }
    rays
}

/// Steps of many voxels need guards of many voxels (9 and 33), and not one less: samples jump over thinner ones.
#[test]
fn steps_of_many_voxels() {
    let (field, rays) = (wide_region(), long_rays());
    for step in [4.0, 16.0] {
        for size in [16, 64, 128] {
            let c = compare(&field, size, step, &rays, Broken::Nothing);
            assert!(c.worst <= HALF_CODE, "step {step}, bricks of {size}: {c:?}");
            assert!(c.leapt > c.positions / 10, "step {step}, bricks of {size}: {c:?}");
        }
        let thinner = compare(&field, 64, step, &rays, Broken::ThinGuard);
        assert!(thinner.worst > HALF_CODE, "step {step}: {thinner:?}");
    }
}

/// From an eye 70 000 voxels away (just beyond a power of two, where f32 is coarsest for its size) positions are
/// multiples of 1/128, and a step of 0.3 divides none of them: a leap's end may lie as far off. A margin of 1/1000
/// voxel alone lets leaps take samples whose support reaches another label, by 100 densities; at 1e5 voxels this field
/// shows none.
#[test]
fn eyes_a_hundred_thousand_voxels_away() {
    let center = DVec3::new(20.3, 19.1, 20.7);
    let field = Field::new([40; 3], |p| {
        let inside = (p - IVec3::splat(20)).abs().max_element() < 15;
        if inside { (60_000, 1) } else { (noise(p) / 4, 0) }
    });
    for far in [7e4, 1e5] {
        let rays: Vec<Ray> = (0..4500).map(|i| distant_ray(i, center, far)).collect();
        for step in [0.3, 0.7, 1.0] {
            let c = compare(&field, 64, step, &rays, Broken::Nothing);
            assert!(c.worst <= HALF_CODE, "from {far}, step {step}: {c:?}");
            assert!(c.leapt > c.positions / 10, "from {far}, step {step}: {c:?}");
        }
    }
}

/// Within 45 degrees or so of an axis, one after the other, both ways.
fn distant_ray(i: i32, center: DVec3, far: f64) -> Ray {
    let f = |n: i32| f64::from(i * n % 1501) / 1501.0 - 0.5;
    let mut direction = DVec3::new(f(911), f(577), f(1201));
    direction[i as usize % 3] += if i % 2 == 0 { 1.0 } else { -1.0 };
    let target = center + DVec3::new(f(313), f(709), f(101)) * 24.0;
    ray(target - direction.normalize() * far, target, DVec3::ONE)
}

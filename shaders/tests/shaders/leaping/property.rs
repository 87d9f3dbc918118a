//! Random volumes, rays, steps and brick sizes; and each rule broken, to show that the comparison notices.

use brickcast_shaders::twin::ray::Ray;
use glam::{DVec3, IVec3};
use proptest::prelude::*;

use super::field::Field;
use super::hazards::{HALF_CODE, noise, rays};
use super::march::{Broken, compare, ray};

/// A small random generator with a state that proptest chooses.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    pub(crate) fn roll(&mut self, below: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % u64::from(below)) as u32
    }

    pub(crate) fn unit(&mut self) -> f64 {
        f64::from(self.roll(1 << 20)) / f64::from(1 << 20)
    }
}

/// Boxes upon boxes, each a region, noise or a flat that is no region; then pores of a voxel or two.
pub(crate) fn volume(dice: &mut Dice) -> Field {
    let dims = [10 + dice.roll(22), 10 + dice.roll(22), 10 + dice.roll(22)];
    let background = dice.roll(3);
    let mut boxes = Vec::new();
    for _ in 0..dice.roll(7) {
        let lo = IVec3::from_array(std::array::from_fn(|a| dice.roll(dims[a]) as i32 - 3));
        let size = IVec3::from_array(std::array::from_fn(|_| 3 + dice.roll(24) as i32));
        boxes.push((lo, lo + size, dice.roll(4)));
    }
    for _ in 0..dice.roll(4) {
        let lo = IVec3::from_array(std::array::from_fn(|a| dice.roll(dims[a]) as i32));
        boxes.push((lo, lo + IVec3::new(1 + dice.roll(2) as i32, 1, 1), 0));
    }
    let base: Vec<u16> = (0..=boxes.len()).map(|_| dice.roll(65_000) as u16).collect();
    let spread = 1 + dice.roll(400) as u16;
    Field::new(dims, |p| {
        let top = boxes.iter().rposition(|(lo, hi, _)| p.cmpge(*lo).all() && p.cmplt(*hi).all());
        let kind = top.map_or(background, |i| boxes[i].2);
        let base = base[top.map_or(0, |i| i + 1)];
        match kind {
            0 => (noise(p), 0),
            1 => (base, 0),
            _ => (base.saturating_add(noise(p) % spread), top.map_or(1, |i| i as u32 + 2)),
        }
    })
}

pub(crate) fn random_rays(dice: &mut Dice, dims: [f64; 3], voxels_per_unit: DVec3) -> Vec<Ray> {
    let mut rays = Vec::new();
    for _ in 0..12 {
        let inside = DVec3::from_array(dims.map(|n| n * dice.unit()));
        let mut from = DVec3::from_array(dims.map(|n| n * (3.0 * dice.unit() - 1.0)));
        match dice.roll(4) {
            // Along an axis, and inside a plane of voxel faces or centres.
            0 => from = inside + DVec3::from_array(std::array::from_fn(|a| if a == 1 { 40.0 } else { 0.0 })),
            1 => {
                let plane = (inside.x * 2.0).round() / 2.0;
                from.x = plane;
                rays.push(ray(from, DVec3::new(plane, inside.y, inside.z), voxels_per_unit));
            }
            2 => from = inside + DVec3::splat(30.0),
            _ => {}
        }
        rays.push(ray(from, inside, voxels_per_unit));
    }
    rays
}

const STEPS: [f32; 6] = [0.25, 0.5, 0.7, 1.0, 1.45, 2.0];

/// Returns how far off the worst sample of a random volume is.
fn worst(seed: u64, broken: Broken) -> (f64, String) {
    let mut dice = Dice(seed);
    let field = volume(&mut dice);
    let spacing = [DVec3::ONE, DVec3::ONE, DVec3::new(1.0, 1.7, 2.6)][dice.roll(3) as usize];
    let rays = random_rays(&mut dice, field.dims.as_dvec3().into(), spacing.recip());
    let (step, size) = (STEPS[dice.roll(6) as usize], [8, 16, 32][dice.roll(3) as usize]);
    let comparison = compare(&field, size, step, &rays, broken);
    (comparison.worst, format!("seed {seed}, dims {}, step {step}, bricks of {size}: {comparison:?}", field.dims))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]
    #[test]
    fn accelerated_samples_are_those_of_the_flattened_volume(seed: u64) {
        let (worst, what) = worst(seed, Broken::Nothing);
        prop_assert!(worst <= HALF_CODE, "{what}");
    }
}

/// Does a broken rule show in any of the volumes?
fn shows(broken: Broken) -> bool {
    (0..1500).any(|seed| worst(seed * 7919 + 1, broken).0 > HALF_CODE)
}

#[test]
fn guards_one_layer_thinner_are_noticed() {
    assert!(shows(Broken::ThinGuard));
}

#[test]
fn leaps_one_sample_longer_are_noticed() {
    assert!(shows(Broken::LongLeap));
}

#[test]
fn a_wrong_slot_is_noticed() {
    assert!(shows(Broken::WrongSlot));
}

#[test]
fn a_brick_entered_without_probes_is_noticed() {
    assert!(shows(Broken::NoEntryProbes));
}

#[test]
fn densities_that_do_not_stretch_are_noticed() {
    assert!(shows(Broken::Unstretched));
}

/// The paper's leaps are as right, but shorter: what the way out of the cube gains.
#[test]
fn leaps_out_of_the_cube_read_less_than_isotropic_ones() {
    let field = Field::new([64; 3], |p| {
        let pore = (p / 16 * 16 + 8 - p).abs().max_element() < 2;
        if pore { (noise(p), 0) } else { (30_000, 1) }
    });
    let rays = rays([64; 3], DVec3::ONE);
    let [cube, isotropic] = [Broken::Nothing, Broken::Isotropic].map(|rule| compare(&field, 32, 0.5, &rays, rule));
    assert!(cube.worst <= HALF_CODE && isotropic.worst <= HALF_CODE);
    assert_eq!(cube.positions, isotropic.positions);
    eprintln!("reads: {} out of the cube, {} isotropic; {} positions", cube.samples, isotropic.samples, cube.positions);
    assert!(cube.samples < isotropic.samples, "{cube:?} {isotropic:?}");
}

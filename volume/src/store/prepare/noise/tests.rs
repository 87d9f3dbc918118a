use super::*;

/// Normal numbers (the sum of twelve even ones, less six), the same for the same seed.
fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03;
    move || {
        (0..12).fold(-6.0, |sum, _| {
            state ^= state >> 12;
            state ^= state << 25;
            state ^= state >> 27;
            sum + (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
        })
    }
}

/// n^3 voxels of a field over -1..=1 an axis, with noise of the deviation that `noise` says for the value.
fn volume(n: usize, field: impl Fn([f64; 3]) -> f64, noise: impl Fn(f64) -> f64) -> Vec<u16> {
    let mut normal = normal(n as u64);
    let at = |i: usize| (i as f64 + 0.5) * 2.0 / n as f64 - 1.0;
    let mut voxels = Vec::new();
    for (z, y, x) in (0..n).flat_map(|z| (0..n).flat_map(move |y| (0..n).map(move |x| (z, y, x)))) {
        let value = field([at(x), at(y), at(z)]);
        voxels.push((value + noise(value) * normal()).round().clamp(0.0, 65535.0) as u16);
    }
    voxels
}

fn found(n: usize, voxels: &[u16]) -> f64 {
    let mut histogram = NoiseHistogram::new(StoredType::U16);
    histogram.add([n, n], voxels, |_| true);
    histogram.deviation()
}

fn radius([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// Sharp, and as a scanner would see it: one voxel wide.
fn sharp_ball(p: [f64; 3]) -> f64 {
    if radius(p) < 0.7 { 40_000.0 } else { 2000.0 }
}

fn soft_ball(n: usize) -> impl Fn([f64; 3]) -> f64 {
    move |p| 2000.0 + 38_000.0 * ((0.7 - radius(p)) * n as f64 / 2.0 + 0.5).clamp(0.0, 1.0)
}

#[test]
fn the_noise_that_was_added_is_found() {
    for n in [32, 48] {
        for sigma in [0.5, 2.0, 8.0, 300.0] {
            let soft = soft_ball(n);
            let cases: [(&str, Vec<u16>); 5] = [
                ("one material", volume(n, |_| 30_000.0, |_| sigma)),
                ("two materials", volume(n, sharp_ball, |_| sigma)),
                ("soft edges", volume(n, &soft, |_| sigma)),
                // The air around it is the most of the volume, and has none.
                ("clean air", volume(n, &soft, |value| if value > 10_000.0 { sigma } else { 0.0 })),
                ("little in the material", volume(n, &soft, |v| if v > 10_000.0 { sigma } else { sigma / 4.0 })),
            ];
            for (name, voxels) in cases {
                let got = found(n, &voxels);
                // Rounding adds a twelfth to the variance.
                let want = (sigma * sigma + 1.0 / 12.0).sqrt();
                assert!((got / want - 1.0).abs() < 0.25, "{name}, {n}^3: {sigma} was added, {got} found");
            }
        }
    }
}

#[test]
fn what_has_no_noise_has_next_to_none() {
    for n in [32, 64] {
        assert_eq!(found(n, &volume(n, |_| 777.0, |_| 0.0)), 0.0, "constant");
        assert_eq!(found(n, &volume(n, sharp_ball, |_| 0.0)), 0.0, "two materials, sharp edges");
        assert_eq!(found(n, &volume(n, soft_ball(n), |_| 0.0)), 0.0, "two materials, soft edges");
        let sum = |[x, y, z]: [f64; 3]| 20_000.0 + 9000.0 * x - 5000.0 * y + 3000.0 * z;
        // Half a stored unit either way.
        assert!(found(n, &volume(n, sum, |_| 0.0)) < 0.5, "slope");
        assert!(found(n, &volume(n, |p| 40_000.0 - 15_000.0 * radius(p), |_| 0.0)) < 100.0 / n as f64, "cone");
        // Gradients of some 15,000 / n a voxel.
        let waves = |[x, y, z]: [f64; 3]| 20_000.0 + 9000.0 * (3.0 * x).sin() * (2.0 * y + z).cos();
        assert!(found(n, &volume(n, waves, |_| 0.0)) < 1000.0 / n as f64, "waves");
    }
}

/// Whatever boxes the volume is counted in, their order, and the threads: the same counts.
#[test]
fn counts_do_not_depend_on_the_parts() {
    let n = 40;
    let voxels = volume(n, sharp_ball, |_| 20.0);
    let mut whole = NoiseHistogram::new(StoredType::U16);
    whole.add([n, n], &voxels, |_| true);
    assert_eq!(whole.counts.iter().sum::<u64>(), 20 * 20 * 20);
    let mut parts = NoiseHistogram::new(StoredType::U16);
    let edge = 16;
    for corner in (0..27).rev().map(|i| [i % 3, i / 3 % 3, i / 9].map(|c| c * edge)) {
        let size = corner.map(|lo| edge.min(n - lo));
        let mut part = Vec::new();
        for z in corner[2]..corner[2] + size[2] {
            for y in corner[1]..corner[1] + size[1] {
                part.extend_from_slice(&voxels[(z * n + y) * n + corner[0]..][..size[0]]);
            }
        }
        parts.add([size[0], size[1]], &part, |_| true);
    }
    assert!(whole.counts == parts.counts);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut alone = NoiseHistogram::new(StoredType::U16);
    pool.install(|| alone.add([n, n], &voxels, |_| true));
    assert!(whole.counts == alone.counts);
}

#[test]
fn odd_sides_and_unknown_voxels_are_left_out() {
    let mut histogram = NoiseHistogram::new(StoredType::I8);
    histogram.add([5, 3], &[1_i8; 5 * 3 * 3], |_| true);
    assert_eq!(histogram.counts.iter().sum::<u64>(), 2);
    let mut voxels = [1_i8; 4 * 2 * 2];
    voxels[5] = i8::MIN;
    histogram.add([4, 2], &voxels, |v| v != i8::MIN);
    assert_eq!(histogram.counts.iter().sum::<u64>(), 3);
    for flat in [[1, 9], [9, 1]] {
        histogram.add(flat, &[1_i8; 18], |_| true);
    }
    histogram.add([0, 0], &[0_i8; 0], |_| true);
    assert_eq!((histogram.counts.iter().sum::<u64>(), histogram.deviation()), (3, 0.0));
}

#[test]
fn bins_of_differences_join_without_gaps() {
    let mut last = 0;
    for difference in 0..=4 * 65535 {
        let bin = bin_of(difference);
        assert!(bin == last || bin == last + 1, "{difference}");
        assert!((first_of(bin)..first_of(bin + 1)).contains(&f64::from(difference)), "{difference}");
        last = bin;
    }
    assert_eq!(last, DIFFERENCES - 1);
}

#[test]
fn noise_is_told_to_three_digits() {
    assert_eq!([8.3947, 0.0, 123_456.0].map(rounded), [Some(8.39), None, Some(123_000.0)]);
    assert_eq!([f64::NAN, f64::INFINITY].map(rounded), [None, None]);
}

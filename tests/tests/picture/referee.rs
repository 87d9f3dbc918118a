//! The product's kernels against the referee.

use brickcast_tests::compare::{Picture, Tolerance, assert_within, assert_within_where};
use brickcast_tests::product::{self, Backend};
use brickcast_tests::referee;
use brickcast_tests::scenes;
use brickcast_volume::PixelRect;
use brickcast_volume::scene::Filter;

const BRICK_SIZES: [u32; 3] = [8, 16, 64];

fn tolerance(backend: Backend) -> Tolerance {
    match backend {
        Backend::Cpu => Tolerance::CPU_AGAINST_REFEREE,
        Backend::Gpu => Tolerance::GPU_AGAINST_TWIN,
    }
}

/// One backend on all scenes of one step, in all brick sizes: each picture against the referee, and against the same
/// kernel's picture in the largest bricks.
fn check_all(backend: Backend, step: f64) {
    let raycaster = product::raycaster(backend);
    let holed = [scenes::oblique(step), scenes::parallel_oblique(step), scenes::eye_inside(step)].map(scenes::holed);
    for scene in scenes::all(step).into_iter().chain(holed) {
        let truth = referee::render(&scene.truth);
        let excused = scene.excused(&truth);
        let mut whole: Option<(Picture, u64)> = None;
        for brick_size in BRICK_SIZES.into_iter().rev() {
            let what = format!("{backend:?}, bricks of {brick_size}: {}", scene.name);
            let (picture, samples) = product::load(raycaster, &scene, brick_size).render(&scene);
            let d = assert_within_where(&what, &truth.picture, &picture, &tolerance(backend), |i| !excused[i]);
            eprintln!("{what}: max {:.3}/255, mean {:.4}/255", d.max * 255.0, d.mean * 255.0);
            assert!(
                samples.abs_diff(truth.samples) <= scene.doubtful_samples(&truth),
                "{what}: {samples} samples, {} are owned",
                truth.samples
            );
            match &whole {
                Some((whole, owned)) => {
                    assert_within(&what, whole, &picture, &Tolerance::OTHER_BRICKS);
                    // Faces between bricks are no excuse: both sides compute the same t, so each sample has one owner.
                    assert_eq!(samples, *owned, "{what}: bricks change the number of samples");
                }
                None => whole = Some((picture, samples)),
            }
        }
    }
}

#[test]
fn cpu_agrees_at_a_quarter_step() {
    check_all(Backend::Cpu, 0.25);
}

#[test]
fn cpu_agrees_at_half_a_step() {
    check_all(Backend::Cpu, 0.5);
}

#[test]
fn cpu_agrees_at_a_whole_step() {
    check_all(Backend::Cpu, 1.0);
}

#[test]
fn cpu_agrees_at_two_steps() {
    check_all(Backend::Cpu, 2.0);
}

#[test]
fn gpu_agrees_at_a_quarter_step() {
    check_all(Backend::Gpu, 0.25);
}

#[test]
fn gpu_agrees_at_half_a_step() {
    check_all(Backend::Gpu, 0.5);
}

#[test]
fn gpu_agrees_at_a_whole_step() {
    check_all(Backend::Gpu, 1.0);
}

#[test]
fn gpu_agrees_at_two_steps() {
    check_all(Backend::Gpu, 2.0);
}

/// Cameras, shapes and steps that nobody thought of.
#[test]
fn random_scenes_agree() {
    for (backend, raycaster) in product::raycasters() {
        let mut seen = 0;
        for seed in 0..90 {
            let scene = scenes::random(seed);
            let truth = referee::render(&scene.truth);
            let (picture, samples) = product::load(raycaster, &scene, BRICK_SIZES[seed as usize % 2]).render(&scene);
            let what = format!("{backend:?}, {}", scene.name);
            let excused = scene.excused(&truth);
            assert_within_where(&what, &truth.picture, &picture, &tolerance(backend), |i| !excused[i]);
            assert!(
                samples.abs_diff(truth.samples) <= scene.doubtful_samples(&truth),
                "{what}: {samples} samples, {} are owned",
                truth.samples
            );
            seen += usize::from(truth.picture.max_alpha() > 0.1);
        }
        assert!(seen > 60, "{backend:?}: only {seen} of 90 pictures show anything");
    }
}

/// Long lenses, the last near the farthest that is allowed: distance costs no precision, since rays start near the
/// volume. So the pixels that may differ are the near eye's few, not the 0.4 % (at 56,000 voxels) to 1 % (at the limit)
/// that f32 would round to the other side of the volume's faces from the eye.
#[test]
fn far_eyes_agree() {
    for (backend, raycaster) in product::raycasters() {
        for (view_angle, step) in [(5.0, 0.5), (0.1, 0.5), (0.1, 0.7), (0.03, 0.5), (0.022, 0.7), (0.022, 0.25)] {
            let mut scene = scenes::oblique(step);
            scene.truth.camera = referee::Camera::orbit(&scene.truth.volume, 35.0, 25.0, 1.0, view_angle);
            let truth = referee::render(&scene.truth);
            assert!(truth.picture.max_alpha() > 0.3);
            let [(small, a), (large, b)] = [8, 64].map(|size| product::load(raycaster, &scene, size).render(&scene));
            let what = format!("{backend:?}, angle {view_angle}, far {}", scene.name);
            let few = Tolerance { outlier_share: 1e-4, ..Tolerance::GPU_AGAINST_TWIN };
            let d = assert_within(&what, &truth.picture, &small, &few);
            eprintln!("{what}: {d}");
            assert!(a.abs_diff(truth.samples) <= 2, "{what}: {a} samples, {} are owned", truth.samples);
            assert_within(&what, &large, &small, &Tolerance::OTHER_BRICKS);
            assert_eq!(a, b, "{what}: bricks change the number of samples");
        }
    }
}

/// Each job of a call has an accumulator of its own, from zero: joined with over, runs of bricks are the whole picture,
/// and no run's opacity darkens another's.
#[test]
fn jobs_of_one_call_are_layers() {
    for (backend, raycaster) in product::raycasters() {
        for scene in [scenes::oblique(0.5), scenes::eye_inside(0.5), scenes::parallel_oblique(0.5)] {
            let loaded = product::load(raycaster, &scene, 16);
            let (whole, samples) = loaded.render(&scene);
            let [width, height] = scene.truth.size;
            let rect = PixelRect { lo: [0, 0].into(), hi: [width as u32, height as u32].into() };
            for count in [2, 3, 100] {
                let layers = loaded.render_layers(&scene, count, rect);
                assert!(layers.len() > 1);
                let mut pixels = vec![[0.0; 4]; width * height];
                for layer in &layers {
                    for (sum, back) in pixels.iter_mut().zip(layer.pixels.raw()) {
                        let through = 1.0 - sum[3];
                        sum.iter_mut().zip(back).for_each(|(s, b)| *s += through * f64::from(*b));
                    }
                }
                let what = format!("{backend:?}, {} in {} layers", scene.name, layers.len());
                assert_within(&what, &whole, &Picture { width, height, pixels }, &Tolerance::SAME_SAMPLES);
                assert_eq!(layers.iter().map(|l| l.total().samples).sum::<u64>(), samples, "{what}");
            }
        }
    }
}

/// The exact filter keeps the maximum bounds for any slope; the hardware's keeps the mean.
#[test]
fn steep_transfer_functions_agree_through_either_filter() {
    for (backend, raycaster) in product::raycasters() {
        for step in [0.5, 1.0] {
            let scene = scenes::steep(step);
            let truth = referee::render(&scene.truth);
            let excused = scene.excused(&truth);
            for (filter, tolerance) in
                [(Filter::Exact, Tolerance::GPU_AGAINST_TWIN), (Filter::Hardware, Tolerance::STEEP_HARDWARE_FILTER)]
            {
                let (picture, _) = product::load(raycaster, &scene, 16).with_filter(filter).render(&scene);
                let what = format!("{backend:?}, {filter:?}, {}", scene.name);
                let d = assert_within_where(&what, &truth.picture, &picture, &tolerance, |i| !excused[i]);
                eprintln!("{what}: {d}");
            }
        }
    }
}

/// Directly, not only by way of the referee.
#[test]
fn gpu_and_cpu_agree() {
    let [cpu, gpu] = Backend::ALL.map(product::raycaster);
    for scene in scenes::all(0.5).into_iter().chain(scenes::all(2.0)) {
        let excused = scene.excused(&referee::render(&scene.truth));
        let [(a, _), (b, _)] = [cpu, gpu].map(|raycaster| product::load(raycaster, &scene, 16).render(&scene));
        assert_within_where(&scene.name, &a, &b, &Tolerance::GPU_AGAINST_TWIN, |i| !excused[i]);
    }
}

/// Early termination may cost what is left behind an opacity of 0.999, and must stop at it: a threshold of a half is
/// seen.
#[test]
fn early_termination_stops_where_it_says() {
    for (backend, raycaster) in product::raycasters() {
        for threshold in [0.999, 0.5] {
            let mut scene = scenes::oblique(0.5);
            // Opaque enough to reach the threshold.
            scene.truth.unit /= 8.0;
            let all = product::load(raycaster, &scene, 16).render(&scene);
            scene.truth.early_termination = threshold;
            let truth = referee::render(&scene.truth);
            let (picture, samples) = product::load(raycaster, &scene, 16).render(&scene);
            let what = format!("{backend:?}, early termination at {threshold}");
            assert!(samples < all.1, "{what}: {samples} of {} samples", all.1);
            if threshold == 0.999 {
                assert_within(&what, &all.0, &picture, &Tolerance::EARLY_TERMINATION);
            }
            // A ray that is within f32 rounding of the threshold may take one sample more or less: at a threshold below
            // one this shows, in few pixels.
            let few = Tolerance { outlier_share: 0.005, ..Tolerance::GPU_AGAINST_TWIN };
            assert_within_where(&what, &truth.picture, &picture, &few, |i| !truth.doubtful[i]);
            assert!(
                samples.abs_diff(truth.samples) * 1000 <= truth.samples,
                "{what}: {samples}, not {}",
                truth.samples
            );
        }
    }
}

#[test]
fn tiny_and_flat_pictures_agree() {
    for (backend, raycaster) in product::raycasters() {
        for size in [[1, 1], [17, 5], [1, 33], [65, 2]] {
            let scene = scenes::resized(scenes::oblique(0.5), size);
            let truth = referee::render(&scene.truth);
            let (picture, _) = product::load(raycaster, &scene, 16).render(&scene);
            let what = format!("{backend:?}, {}", scene.name);
            assert!(truth.picture.max_alpha() > 0.3, "{what}");
            assert_within_where(&what, &truth.picture, &picture, &tolerance(backend), |i| !truth.doubtful[i]);
        }
    }
}

/// Clear to the bit, not nearly: layers without content are left out of merging.
#[test]
fn a_volume_behind_the_eye_is_clear() {
    for (backend, raycaster) in product::raycasters() {
        let scene = scenes::behind_the_eye();
        assert_eq!(referee::render(&scene.truth).samples, 0);
        let (picture, samples) = product::load(raycaster, &scene, 16).render(&scene);
        assert!(picture.pixels.iter().all(|&p| p == [0.0; 4]), "{backend:?}");
        assert_eq!(samples, 0, "{backend:?}");
    }
}

/// A rectangle of the picture holds the very bits of the whole picture: tiles must not show.
#[test]
fn parts_of_the_picture_have_the_bits_of_the_whole() {
    for (backend, raycaster) in product::raycasters() {
        let scene = scenes::oblique(0.5);
        let loaded = product::load(raycaster, &scene, 16);
        let (whole, _) = loaded.render(&scene);
        let [width, height] = scene.truth.size.map(|n| n as u32);
        for (lo, hi) in
            [([0, 0], [width, 1]), ([13, 7], [50, 41]), ([31, 20], [32, 21]), ([width - 5, 3], [width, height])]
        {
            let rect = PixelRect { lo: lo.into(), hi: hi.into() };
            let part = loaded.render_rect(&scene, rect);
            for (i, pixel) in part.pixels.raw().iter().enumerate() {
                let (x, y) = (lo[0] as usize + i % rect.size().x as usize, lo[1] as usize + i / rect.size().x as usize);
                assert_eq!(pixel.map(f64::from), whole.at(x, y), "{backend:?}, {rect:?}, pixel ({x}, {y})");
            }
        }
    }
}

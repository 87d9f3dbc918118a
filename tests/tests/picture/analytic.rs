//! Bodies whose opacity is known in closed form: the referee itself, and the product's kernels, against the formula.

use brickcast_tests::compare::Picture;
use brickcast_tests::product;
use brickcast_tests::referee::{self, Camera, Lens};
use brickcast_tests::scenes::{self, Scene};
use glam::DVec3;

/// The referee's picture and those of the kernels that this machine has.
fn pictures(scene: &Scene) -> Vec<(String, Picture)> {
    let mut pictures = vec![("referee".to_owned(), referee::render(&scene.truth).picture)];
    for (backend, raycaster) in product::raycasters() {
        for brick_size in [8, 64] {
            let (picture, _) = product::load(raycaster, scene, brick_size).render(scene);
            pictures.push((format!("{backend:?} in bricks of {brick_size}"), picture));
        }
    }
    pictures
}

/// A camera so close to the axis of the box that every ray enters by its front (high z) and leaves by its back.
fn facing(eye_offset: [f64; 2], lens: Lens) -> Camera {
    // The box of scenes::constant_box: 16 x 32 x 16.5 world units, low corner (-3.25, 4.5, 8.25).
    let center = DVec3::new(-3.25 + 8.0, 4.5 + 16.0, 8.25 + 8.25);
    let offset = DVec3::new(eye_offset[0], eye_offset[1], 40.3);
    Camera { position: center + offset, focal_point: center, view_up: DVec3::Y, lens }
}

/// `|alpha - (1 - (1-o)^(L/unit))| <= (1-o)^(L/unit) ((1-o)^(-Delta/unit) - 1) + 1/255`, and
/// `alpha = 1 - (1-o)^(n Delta/unit)` within 1/255 for the n samples with `t_in <= k Delta < t_out`. Chords by similar
/// triangles, not by the referee's clipping.
#[test]
fn constant_boxes_have_the_opacity_of_their_chord() {
    let lenses = [Lens::Parallel { parallel_scale: 5.0 }, Lens::Perspective { view_angle: 14.0 }];
    for (opacity, step, unit) in
        [(0.02, 0.25, 0.5), (0.1, 0.5, 0.5), (0.3, 1.0, 3.0), (0.05, 2.0, 0.5), (0.6, 0.5, 20.0)]
    {
        for lens in lenses {
            let camera = facing([4.0, -3.0], lens);
            let mut scene = scenes::constant_box(camera, opacity, step);
            scene.truth.unit = unit;
            let delta = step * 0.5;
            for (who, picture) in pictures(&scene) {
                for (i, pixel) in picture.pixels.iter().enumerate() {
                    let what = format!("{who}, {lens:?}, {opacity} per {unit}, step {step}, pixel {i}: {pixel:?}");
                    let ray = camera.ray(i % picture.width, i / picture.width, scene.truth.size);
                    // World length per unit of depth; depths of the two faces below the ray's origin.
                    let slant = 1.0 / -ray.direction.z;
                    let (front, back) = (ray.origin.z - (8.25 + 16.5), ray.origin.z - 8.25);
                    let (t_in, t_out) = (front * slant, back * slant);
                    let transparency = (1.0 - opacity).powf((t_out - t_in) / unit);
                    let slack = transparency * ((1.0 - opacity).powf(-delta / unit) - 1.0) + 1.0 / 255.0;
                    assert!((pixel[3] - (1.0 - transparency)).abs() <= slack, "{what}, not {}", 1.0 - transparency);

                    let of_samples = |n: f64| 1.0 - (1.0 - opacity).powf(n * delta / unit);
                    let n = (t_out / delta).ceil() - (t_in / delta).ceil();
                    // One sample more or less where a face is within rounding of a sample.
                    let near = |t: f64| (t / delta - (t / delta).round()).abs() < 1e-4;
                    let one_off = if near(t_in) || near(t_out) { 1.0 } else { 0.0 };
                    let (least, most) = (of_samples(n - one_off), of_samples(n + one_off));
                    assert!(pixel[3] >= least - 1.0 / 255.0 && pixel[3] <= most + 1.0 / 255.0, "{what}, {n} samples");
                    // Premultiplied: the colour is the constant one times alpha.
                    for (channel, color) in [0.8, 0.5, 0.2].into_iter().enumerate() {
                        assert!((pixel[channel] - color * pixel[3]).abs() < 1.0 / 255.0, "{what}, channel {channel}");
                    }
                }
            }
        }
    }
}

/// As above with one voxel of chord more or less, for rays that meet the ball's surface at an angle; those that graze
/// it pass through the voxelised surface over a length that no bound of one voxel holds for.
#[test]
fn balls_have_the_opacity_of_their_chord() {
    for (opacity, step) in [(0.03, 0.25), (0.05, 0.5), (0.1, 1.0), (0.05, 2.0)] {
        let scene = scenes::ball(opacity, step);
        // Index space is world space in this scene.
        let center = DVec3::from(scenes::BALL_CENTER);
        for (who, picture) in pictures(&scene) {
            let (mut judged, mut error) = (0, 0.0);
            for (i, pixel) in picture.pixels.iter().enumerate() {
                let what = format!("{who}, {opacity}, step {step}, pixel {i}: {pixel:?}");
                let ray = scene.truth.camera.ray(i % picture.width, i / picture.width, scene.truth.size);
                let along = (center - ray.origin).dot(ray.direction);
                let aside = (ray.origin + ray.direction * along).distance(center);
                if aside > scenes::BALL_RADIUS + 2.0 {
                    assert_eq!(*pixel, [0.0; 4], "{what}");
                }
                if aside > scenes::BALL_RADIUS - 1.5 {
                    continue;
                }
                let chord = 2.0 * (scenes::BALL_RADIUS.powi(2) - aside * aside).sqrt();
                let transparency = |length: f64| (1.0 - opacity).powf(length);
                let slack = transparency(chord) * ((1.0 - opacity).powf(-step) - 1.0) + 1.0 / 255.0;
                let (least, most) = (1.0 - transparency(chord - 1.0) - slack, 1.0 - transparency(chord + 1.0) + slack);
                assert!((least..=most).contains(&pixel[3]), "{what}, not {least} to {most} for a chord of {chord}");
                judged += 1;
                error += (1.0 - pixel[3]).ln() / (1.0 - opacity).ln() - chord;
            }
            assert!(judged > 400, "{who}: only {judged} rays were judged");
            // Signed, so that a radius off by a tenth of a voxel shows. Interpolating the curved surface and the
            // opacity within its one-voxel slope cost 0.08 to 0.1 by themselves.
            let mean = error / f64::from(judged);
            eprintln!("{who}, {opacity}, step {step}: mean chord error {mean:.4} voxels over {judged} rays");
            assert!(mean.abs() < 0.15, "{who}, {opacity}, step {step}: chords are off by {mean} voxels on average");
        }
    }
}

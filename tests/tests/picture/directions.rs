//! Volumes that lie turned, mirrored or permuted in the world: drawn where they lie, by the referee that computes
//! there.

use brickcast_tests::compare::{Tolerance, assert_within_where, compare};
use brickcast_tests::placed::{storages, stored, turned, turns};
use brickcast_tests::product::{self, Backend};
use brickcast_tests::referee::{self, LightAt, render_styled};
use brickcast_tests::scenes::{self, Scene};
use brickcast_volume::style::{Clip, ClipPlane, Integration, Isosurface, Lighting, Phong, Style, TableSize};
use glam::DVec3;

fn at(scene: &Scene, share: f64) -> f64 {
    scene.range.0 + (scene.range.1 - scene.range.0) * share
}

/// Slabs, light from one side, an isosurface, a clip box and a clip plane: all that has a direction in the world.
fn everything(scene: &Scene) -> (referee::Style, Style) {
    let volume = &scene.truth.volume;
    let middle = (volume.world_box().0 + volume.world_box().1) / 2.0;
    let half = (volume.world_box().1 - volume.world_box().0).length() / 2.0;
    let (lo, hi) = (middle - DVec3::new(0.42, 0.5, 0.37) * half, middle + DVec3::new(0.5, 0.39, 0.45) * half);
    let normal = DVec3::new(0.3, -0.5, 0.7);
    let offset = normal.dot(middle) - 0.12 * half;
    let direction = Some(DVec3::new(-0.4, 1.0, 0.7));
    let (value, color) = (at(scene, 0.52), [0.2, 0.5, 0.9, 0.8]);
    let mut truth = referee::Style { preintegrated: true, surfaces: vec![(value, color)], ..Default::default() };
    truth.light = Some(referee::Light {
        at: LightAt::Middle,
        direction,
        ambient: 0.25,
        diffuse: 0.6,
        specular: 0.4,
        shininess: 12.0,
        range: scene.range,
        from: 0.0,
    });
    truth.planes.push((normal, offset));
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        truth.planes.extend([(axis, axis.dot(lo)), (-axis, -axis.dot(hi))]);
    }
    let lighting = Lighting::Center;
    let [r, g, b, opacity] = color.map(|c| c as f32);
    let style = Style {
        integration: Integration::Preintegrated(TableSize::N1024),
        shading: Some(Phong {
            lighting,
            light: direction,
            ambient: 0.25,
            diffuse: 0.6,
            specular: 0.4,
            shininess: 12.0,
            light_from: Some(0.0),
        }),
        surfaces: vec![Isosurface { value, color: [r, g, b], opacity }],
        clip: Clip { bounds: Some((lo, hi)), planes: vec![ClipPlane { normal, offset }] },
        ..Style::default()
    };
    (truth, style)
}

/// Where a sample lies on either side of a plane or a face, single pixels may differ.
fn few(backend: Backend) -> Tolerance {
    match backend {
        Backend::Cpu => Tolerance { outlier_share: 4e-3, ..Tolerance::CPU_AGAINST_REFEREE },
        Backend::Gpu => Tolerance { outlier_share: 4e-3, ..Tolerance::GPU_AGAINST_TWIN },
    }
}

fn small(step: f64) -> [Scene; 3] {
    [scenes::oblique(step), scenes::parallel_oblique(step), scenes::eye_inside(step)]
        .map(|scene| scenes::resized(scene, [32, 26]))
}

fn check_turned(backend: Backend) {
    let raycaster = product::raycaster(backend);
    for straight in small(1.0) {
        for (name, directions) in turns() {
            let scene = turned(&straight, name, directions);
            let (truth, style) = everything(&scene);
            let (plain, styled) = (referee::render(&scene.truth), render_styled(&scene.truth, &truth));
            let excused: Vec<bool> = plain.doubtful.clone();
            assert!(plain.picture.max_alpha() > 0.2 && styled.picture.max_alpha() > 0.2, "{}: nothing", scene.name);
            // Another place than the straight volume's, or nothing was tested.
            let moved = compare(&referee::render(&straight.truth).picture, &plain.picture, 0.02).unwrap();
            assert!(moved.outliers > 100, "{}: {moved}", scene.name);
            for brick_size in [8, 64] {
                let what = format!("{backend:?}, bricks of {brick_size}: {}", scene.name);
                let (picture, _) = product::load(raycaster, &scene, brick_size).render(&scene);
                assert_within_where(&what, &plain.picture, &picture, &few(backend), |i| !excused[i]);
                let (picture, _) = product::load_styled(raycaster, &scene, brick_size, &style).render(&scene);
                let what = format!("lit and clipped, {what}");
                let d = assert_within_where(&what, &styled.picture, &picture, &few(backend), |i| !excused[i]);
                eprintln!("{what}: max {:.3}/255, mean {:.4}/255", d.max * 255.0, d.mean * 255.0);
            }
        }
    }
}

#[test]
fn turned_volumes_agree_with_the_referee_on_the_cpu() {
    check_turned(Backend::Cpu);
}

#[test]
fn turned_volumes_agree_with_the_referee_on_the_gpu() {
    check_turned(Backend::Gpu);
}

/// However the voxels are stored, the object is the same: one picture, from the same camera, light and clip in the
/// world.
#[test]
fn all_48_orders_of_storage_give_one_picture() {
    let raycaster = product::raycaster(Backend::Cpu);
    for straight in small(1.0) {
        let (_, style) = everything(&straight);
        let [plain, styled] = [Style::default(), style.clone()]
            .map(|style| product::load_styled(raycaster, &straight, 16, &style).render(&straight).0);
        assert!(plain.max_alpha() > 0.2 && styled.max_alpha() > 0.2);
        assert_eq!(storages().count(), 48);
        for storage in storages() {
            let scene = stored(&straight, storage);
            let same = Tolerance { max: 2e-4, mean: 1e-5, outlier_share: 4e-3 };
            let (picture, _) = product::load(raycaster, &scene, 16).render(&scene);
            assert_within_where(&scene.name, &plain, &picture, &same, |_| true);
            let (picture, _) = product::load_styled(raycaster, &scene, 16, &style).render(&scene);
            let what = format!("lit and clipped, {}", scene.name);
            assert_within_where(&what, &styled, &picture, &same, |_| true);
        }
    }
}

/// The comparison would notice: an object whose header's directions are left aside is another picture, mirrored or not.
#[test]
fn directions_left_aside_are_noticed() {
    let straight = scenes::resized(scenes::oblique(1.0), [32, 26]);
    let truth = referee::render(&straight.truth).picture;
    for storage in storages().filter(|s| s.order != [0, 1, 2] || s.from_far != [false; 3]) {
        let right = stored(&straight, storage);
        let same = compare(&truth, &referee::render(&right.truth).picture, 1e-9).unwrap();
        assert!(same.outliers <= 2, "{}: {same}", right.name);
        let mut wrong = right.clone();
        wrong.truth.volume.directions = glam::DMat3::IDENTITY;
        let other = compare(&truth, &referee::render(&wrong.truth).picture, 0.02).unwrap();
        assert!(other.outliers > 20, "{storage:?}: {other}");
    }
}

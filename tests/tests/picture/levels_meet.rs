//! Where levels meet: of the finest positions of a ray every one is taken once (docs/definition.md, Levels 3).

use brickcast::embedded::Backend;
use brickcast::session::Session;
use brickcast::session::levels::LevelSessions;
use brickcast_volume::lod::{Rule, Selection};
use brickcast_volume::scene::{Filter, Look, Quality, Scene, ViewSpec};
use brickcast_volume::store::{PrepareOptions, Store};
use brickcast_volume::style::{Integration, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{BrickIndex, Camera, Geometry, PictureSize, Projection};
use glam::DVec3;

use crate::levels::{alone, made, mixed, nodes_by};
use crate::rig::{kernels, runtime};

const DIMS: [u32; 3] = [96, 80, 72];
const SPACING: [f64; 3] = [1.0, 1.25, 0.75];
const OPACITY: f64 = 0.01;
const SIZE: u32 = 61;

/// Of one value everywhere: what a ray takes says how many positions were.
fn store(folder: &std::path::Path, brick_size: u32) -> Store {
    let geometry = Geometry::new(DIMS, SPACING, [2.0, -1.0, 0.5]).unwrap();
    let options = PrepareOptions { brick_size, range: Some((0.0, 255.0)), ..PrepareOptions::default() };
    let voxels = vec![100; DIMS.iter().product::<u32>() as usize];
    made(folder, &format!("one-{brick_size}"), (geometry, voxels), &options)
}

fn scene(store: &Store, camera: Camera, integration: Integration) -> Scene {
    let colors = vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }];
    let opacities = [(0.0, 0.0), (50.0, 0.0), (60.0, OPACITY), (140.0, OPACITY), (150.0, 0.0)];
    let opacities = opacities.map(|(x, opacity)| OpacityPoint { x, opacity }).to_vec();
    let style = Style { integration, ..Style::default() };
    let unit = store.manifest().geometry.min_spacing();
    let look = Look { style, ..Look::new(TransferFunction::new(colors, opacities).unwrap(), unit) };
    let view = ViewSpec { camera, size: PictureSize::new(SIZE, SIZE).unwrap() };
    let quality = Quality { early_termination: 1.0, filter: Filter::Exact, exact: true, ..Quality::default() };
    Scene::new(look, view, quality).unwrap()
}

/// By the definition, in f64 and the world: how many finest positions the ray of a pixel takes, and where levels
/// change.
fn positions(store: &Store, scene: &Scene, selection: &Selection, [x, y]: [u32; 2]) -> (f64, String) {
    let manifest = store.manifest();
    let (geometry, camera) = (manifest.geometry, scene.view.camera);
    let at = |pixel: u32| (f64::from(pixel) + 0.5) * 2.0 / f64::from(SIZE) - 1.0;
    let (u, v) = (at(x), -at(y));
    let (right, up, forward) = camera.basis();
    let (start, direction) = match camera.projection() {
        Projection::Perspective { view_angle } => {
            let half = (view_angle.to_radians() / 2.0).tan();
            (camera.position(), (forward + (right * u + up * v) * half).normalize())
        }
        Projection::Parallel { parallel_scale } => (camera.position() + (right * u + up * v) * parallel_scale, forward),
    };
    let delta = scene.quality.step * geometry.min_spacing();
    let tree = selection.levels().finest();
    let level_at = |k: u32| {
        let voxel = geometry.voxel_from_world(start + direction * (f64::from(k) * delta));
        let is_in = voxel.cmpge(DVec3::ZERO).all() && voxel.cmplt(DVec3::from(DIMS.map(f64::from))).all();
        let brick = (voxel / f64::from(manifest.grid.brick_size())).as_uvec3();
        is_in.then(|| selection.per_chunk()[tree.chunk_id(tree.chunk_of(BrickIndex(brick.into())))])
    };
    let (mut taken, mut takes, mut before) = (0, false, None);
    for k in 0..1000_u32 {
        let here = level_at(k);
        match (before, here) {
            (Some(level), None) if takes => taken += k.next_multiple_of(1_u32 << level) - k,
            (_, None) => {}
            (Some(other), Some(level)) if other != level => takes = true,
            (_, Some(level)) => takes |= k.is_multiple_of(1_u32 << level),
        }
        taken += u32::from(takes && here.is_some());
        before = here;
    }
    let levels: Vec<_> = (0..1000).filter_map(|k| Some((k, level_at(k)?))).collect();
    let change = |pair: &[(u32, u8)]| pair[0].1 != pair[1].1;
    let ends = levels.windows(2).filter(|pair| change(pair)).map(|pair| pair[1]);
    let trace = levels.first().into_iter().copied().chain(ends).chain(levels.last().copied());
    (f64::from(taken), format!("{:?}", trace.collect::<Vec<_>>()))
}

#[test]
fn where_levels_meet_every_finest_position_is_taken_once() {
    kernels().iter().for_each(check);
}

fn check(kernel: &Backend) {
    let folder = tempfile::tempdir().unwrap();
    let center = DVec3::new(50.0, 49.0, 27.5);
    let eye = |x, y, z| center + DVec3::new(x, y, z);
    let perspective = Projection::Perspective { view_angle: 40.0 };
    let cameras = [
        Camera::new(eye(120.0, -70.0, 90.0), center, DVec3::Z, perspective).unwrap(),
        Camera::new(eye(-35.0, 20.0, 5.0), center, DVec3::Z, perspective).unwrap(),
        Camera::new(eye(3.0, 150.0, -40.0), center, DVec3::Z, Projection::Parallel { parallel_scale: 45.0 }).unwrap(),
    ];
    runtime().block_on(async {
        for brick_size in [8, 16] {
            let store = store(folder.path(), brick_size);
            let (root, _nodes) = nodes_by(kernel, &store, 2).await;
            let mut levels = LevelSessions::open(Session::on(root.cluster().clone())).await.unwrap();
            for (camera, focus) in cameras.iter().zip([[8.0, 70.0, 60.0], [90.0, 4.0, 4.0], [40.0, 40.0, 30.0]]) {
                let rule = Rule::Focus(store.manifest().geometry.world_from_voxel(DVec3::from(focus)));
                for integration in [Integration::Sampled, Integration::Preintegrated(TableSize::N256)] {
                    let scene = scene(&store, *camera, integration);
                    let selection = levels.select(&scene, rule).unwrap();
                    assert!(selection.used().count() >= 2, "{:?}", selection.used().collect::<Vec<_>>());
                    let frame = mixed(&mut levels, &scene, rule).await;
                    let full = alone(&mut Session::on(root.cluster().clone()), &scene).await;
                    let (mut off, mut seen, mut differs) = (0, 0, 0);
                    for (i, pixel) in frame.picture.pixels().iter().enumerate() {
                        let at = [i as u32 % SIZE, i as u32 / SIZE];
                        let (taken, way) = positions(&store, &scene, &selection, at);
                        let want = 1.0 - (1.0 - OPACITY).powf(taken * scene.quality.step);
                        let error = (f64::from(pixel.a) - want).abs();
                        seen += u32::from(want > 0.0);
                        differs += u32::from((f64::from(full.picture.pixels()[i].a) - want).abs() > 1e-4);
                        // Where a position lies in a plane, rounding may say on which side.
                        off += u32::from(error > 1e-4);
                        assert!(error < 2.0 * OPACITY, "{at:?}: {} for {want}, {taken} positions: {way}", pixel.a);
                    }
                    let what = format!("bricks of {brick_size}, {integration:?}, {rule:?}");
                    assert!(seen > 1000 && off * 200 < seen, "{what}: {off} of {seen}");
                    assert!(differs > 300, "{what}: levels change nothing, {differs} of {seen}");
                }
            }
        }
    });
}

//! No pixel of a picture of several levels is farther from full resolution's than the bound that is told of it.

use crate::levels::{alone, made, mixed, nodes, scene, store, styles};
use crate::rig::runtime;
use brickcast::picture::Picture;
use brickcast::session::Session;
use brickcast::session::levels::LevelSessions;
use brickcast_volume::Geometry;
use brickcast_volume::lod::{Rule, Untold};
use brickcast_volume::scene::{Leap, Scene, SceneParts};
use brickcast_volume::store::{PrepareOptions, RegionOptions, Segmentation, Store};
use brickcast_volume::style::{Isosurface, Mode, Phong, Style};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use glam::{DVec3, UVec2};

/// Of the rest that a bound does not speak of: f32 and joins of many layers.
const ROUNDING: f32 = 2e-4;

/// By how much a pixel is farther than its bound says, the largest of all, and what the largest difference was.
fn farther(bound: impl Fn(UVec2) -> f32, full: &Picture, drawn: &Picture) -> (f32, f32) {
    let width = full.size().width();
    let pairs = full.pixels().iter().zip(drawn.pixels()).enumerate();
    pairs.fold((f32::MIN, 0.0), |(worst, largest), (i, (a, b))| {
        let at = UVec2::new(i as u32 % width, i as u32 / width);
        let ([r, g, b, a], [s, t, u, v]) = (a.to_array(), b.to_array());
        let far = [r - s, g - t, b - u, a - v].map(f32::abs).into_iter().fold(0.0, f32::max);
        // Before white, too.
        let before_white = [r - a, g - a, b - a].into_iter().zip([s - v, t - v, u - v]);
        let far = before_white.map(|(one, other)| (one - other).abs()).fold(far, f32::max);
        (worst.max(far - bound(at)), largest.max(far))
    })
}

fn exact(scene: Scene) -> Scene {
    scene.with(|s| s.quality.early_termination = 1.0).unwrap()
}

#[test]
fn no_pixel_is_farther_from_full_resolution_than_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut told = Vec::new();
    for brick in [8, 16] {
        let store = store(folder.path(), brick);
        let geometry = &store.manifest().geometry;
        let focus = geometry.world_from_voxel(DVec3::new(20.0, 90.0, 30.0));
        runtime().block_on(async {
            let (mut session, _nodes) = nodes(&store, 1).await;
            let mut levels = LevelSessions::open(Session::on(session.cluster().clone())).await.unwrap();
            for (name, style) in styles(&store).into_iter().filter(|(_, style)| style.mode == Mode::Composite) {
                for step in [0.5, 1.0] {
                    let scene = exact(scene(&store, style.clone()).with(|s| s.quality.step = step).unwrap());
                    let full = alone(&mut session, &scene).await.picture;
                    for rule in [Rule::Error { pixels: 64.0 }, Rule::Error { pixels: 1.8 }, Rule::Focus(focus)] {
                        let selection = levels.select(&scene, rule).unwrap();
                        let changes = levels.changes(&scene, &selection)().unwrap();
                        let drawn = mixed(&mut levels, &scene, rule).await.picture;
                        let (worst, largest) = farther(|at| changes.of_ray(at), &full, &drawn);
                        let bounds = changes.bounds();
                        let what = format!("{name}, bricks of {brick}, step {step}, {rule:?}: {largest}, {bounds:?}");
                        assert!(worst <= ROUNDING, "{what}: farther by {worst}");
                        assert!(f64::from(largest) <= bounds.largest + f64::from(ROUNDING), "{what}");
                        assert!(bounds.mean <= bounds.p99 + 1e-9 || bounds.p99 == 0.0, "{what}");
                        told.push(bounds);
                    }
                    let all = levels.select(&scene, Rule::Error { pixels: 1e-9 }).unwrap();
                    let none = levels.changes(&scene, &all)().unwrap().bounds();
                    assert!((none.largest, none.settled) == (0.0, 1.0), "{none:?}");
                }
            }
        });
    }
    assert!(told.iter().any(|bounds| bounds.mean > 0.0 && bounds.mean < 0.85), "all of them say nothing: {told:?}");
}

/// A ball in clear air, of smooth values: what misses it, and most of what goes through it, is known to be settled.
fn ball(folder: &std::path::Path) -> Store {
    let n = 96_u32;
    let value = |x: u32, y: u32, z: u32| {
        let d = (DVec3::new(x.into(), y.into(), z.into()) - 48.0).length();
        (((30.0 - d) * 0.5 + 0.5).clamp(0.0, 1.0) * 40_000.0) as u16 + 2000
    };
    let voxels = (0..n).flat_map(|z| (0..n).flat_map(move |y| (0..n).map(move |x| value(x, y, z)))).collect();
    let regions = RegionOptions { segmentation: Segmentation::Windows { range: 0.05 }, min_region: 0 };
    let options = PrepareOptions { brick_size: 8, regions: Some(regions), ..PrepareOptions::default() };
    made(folder, "ball", (Geometry::new([n; 3], [1.0; 3], [0.0; 3]).unwrap(), voxels), &options)
}

#[test]
fn what_no_value_can_change_is_settled() {
    let folder = tempfile::tempdir().unwrap();
    let store = ball(folder.path());
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.7, 0.6, 0.5] }];
    let opacities = [(0.0, 0.0), (20_000.0, 0.0), (21_000.0, 0.05), (65_535.0, 0.05)];
    let opacities = opacities.map(|(x, opacity)| OpacityPoint { x, opacity }).to_vec();
    let function = TransferFunction::new(colors, opacities).unwrap();
    let scene = exact(scene(&store, Style::default()).with(|s| s.look.transfer_function = function).unwrap());
    runtime().block_on(async {
        let (mut session, _nodes) = nodes(&store, 1).await;
        let mut levels = LevelSessions::open(Session::on(session.cluster().clone())).await.unwrap();
        let full = alone(&mut session, &scene).await.picture;
        let rule = Rule::Error { pixels: 4.0 };
        let selection = levels.select(&scene, rule).unwrap();
        let changes = levels.changes(&scene, &selection)().unwrap();
        let drawn = mixed(&mut levels, &scene, rule).await.picture;
        let (worst, largest) = farther(|at| changes.of_ray(at), &full, &drawn);
        let bounds = changes.bounds();
        assert!(worst <= ROUNDING && largest > 0.01, "{largest}, farther by {worst}");
        assert!(bounds.settled > 0.15 && bounds.mean < 0.8, "{bounds:?}");
        // Not of what values do not tell.
        let leaps = scene.with(|s| s.quality.acceleration.leap = Leap::Regions).unwrap();
        assert_eq!(levels.changes(&leaps, &selection)().unwrap_err(), Untold::Flattened);
        let most = scene.with(|s| s.look.style.mode = Mode::Maximum).unwrap();
        assert_eq!(levels.changes(&most, &selection)().unwrap_err(), Untold::Look);
    });
}

fn flat(opacities: &[(f64, f64)]) -> TransferFunction {
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.7, 0.6, 0.5] }];
    let opacities = opacities.iter().map(|&(x, opacity)| OpacityPoint { x, opacity }).collect();
    TransferFunction::new(colors, opacities).unwrap()
}

/// Looks of which each wants one part of the bound: without it a pixel is farther.
#[test]
fn each_part_of_the_bound_is_needed() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball(folder.path());
    let options = PrepareOptions { brick_size: 8, range: Some((0.0, 255.0)), ..PrepareOptions::default() };
    let geometry = Geometry::new([61, 50, 43], [1.0; 3], [0.0; 3]).unwrap();
    let even = made(folder.path(), "even", (geometry, vec![100; 61 * 50 * 43]), &options);
    let surface = Isosurface { value: 20_000.0, color: [0.9, 0.5, 0.2], opacity: 0.8 };
    let lit = Style { shading: Some(Phong { light_from: Some(300.0), ..Phong::default() }), ..Style::default() };
    let surfaces = Style { surfaces: vec![surface], ..Style::default() };
    let low = flat(&[(0.0, 0.0), (2500.0, 0.0), (3000.0, 0.2), (65_535.0, 0.2)]);
    let solid = flat(&[(0.0, 0.9), (65_535.0, 0.9)]);
    for (what, store, function, style) in [
        ("what is interpolated beside the ball", &ball, low, Style::default()),
        ("what light shows of it", &ball, solid, lit),
        ("its surface", &ball, flat(&[(0.0, 0.0), (65_535.0, 0.0)]), surfaces),
        ("where runs end behind the volume", &even, flat(&[(0.0, 0.02), (255.0, 0.02)]), Style::default()),
    ] {
        let with = |s: &mut SceneParts| s.look.transfer_function = function.clone();
        let scene = exact(scene(store, style).with(with).unwrap());
        runtime().block_on(async {
            let (mut session, _nodes) = nodes(store, 1).await;
            let mut levels = LevelSessions::open(Session::on(session.cluster().clone())).await.unwrap();
            let full = alone(&mut session, &scene).await.picture;
            for pixels in [2.0, 4.0, 64.0] {
                let rule = Rule::Error { pixels };
                let selection = levels.select(&scene, rule).unwrap();
                let changes = levels.changes(&scene, &selection)().unwrap();
                let drawn = mixed(&mut levels, &scene, rule).await.picture;
                let (worst, largest) = farther(|at| changes.of_ray(at), &full, &drawn);
                assert!(worst <= ROUNDING, "{what}, pixel error {pixels}: {largest}, farther by {worst}");
            }
        });
    }
}

//! Where levels meet, the finer one goes on as the coarser one ends (docs/definition.md, Levels 4).

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

use crate::levels::{made, mixed, nodes_by};
use crate::rig::{kernels, runtime};

/// A bar, so that levels meet in planes across it; as thick as a voxel of the coarsest that is drawn.
const DIMS: [u32; 3] = [512, 16, 16];
const BRICK: u32 = 8;
/// So many pixels are as wide as a voxel: what is steep within a level changes little from one to the next.
const PIXELS: u32 = 8;
const HEIGHT: u32 = 8;

/// Waves along the bar, a crest at each chunk's end: there levels differ most.
fn store(folder: &std::path::Path) -> Store {
    let wave = |x: u32| (f64::from(x) + 0.5) * std::f64::consts::TAU * 7.0 / 64.0;
    let row: Vec<u16> = (0..DIMS[0]).map(|x| (30_000.0 + 22_000.0 * wave(x).cos()) as u16).collect();
    let voxels = row.repeat((DIMS[1] * DIMS[2]) as usize);
    let options = PrepareOptions { brick_size: BRICK, range: Some((0.0, 65_535.0)), ..PrepareOptions::default() };
    made(folder, "waves", (Geometry::new(DIMS, [1.0; 3], [0.0; 3]).unwrap(), voxels), &options)
}

fn scene(store: &Store, integration: Integration) -> Scene {
    let colors = [(0.0, [0.1, 0.9, 0.2]), (65_535.0, [0.9, 0.3, 1.0])].map(|(x, rgb)| ColorPoint { x, rgb }).to_vec();
    let opacities = [(0.0, 0.0), (65_535.0, 0.15)].map(|(x, opacity)| OpacityPoint { x, opacity }).to_vec();
    let style = Style { integration, ..Style::default() };
    let look = Look { style, ..Look::new(TransferFunction::new(colors, opacities).unwrap(), 1.0) };
    let center = store.manifest().geometry.center_world();
    let projection = Projection::Parallel { parallel_scale: f64::from(HEIGHT) / f64::from(2 * PIXELS) };
    let camera = Camera::new(center + DVec3::Z * 50.0, center, DVec3::Y, projection).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(DIMS[0] * PIXELS, HEIGHT).unwrap() };
    let quality = Quality { early_termination: 1.0, filter: Filter::Exact, exact: true, ..Quality::default() };
    Scene::new(look, view, quality).unwrap()
}

/// The level of each column of pixels.
fn levels_of(selection: &Selection) -> Vec<u8> {
    let tree = selection.levels().finest();
    let of = |pixel: u32| {
        let brick = BrickIndex([pixel / PIXELS / BRICK, DIMS[1] / 2 / BRICK, 0]);
        selection.per_chunk()[tree.chunk_id(tree.chunk_of(brick))]
    };
    (0..DIMS[0] * PIXELS).map(of).collect()
}

#[test]
fn across_a_border_of_levels_the_picture_changes_as_within_a_level() {
    kernels().iter().for_each(check);
}

fn check(kernel: &Backend) {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    runtime().block_on(async {
        let (root, _nodes) = nodes_by(kernel, &store, 2).await;
        let mut levels = LevelSessions::open(Session::on(root.cluster().clone())).await.unwrap();
        for focus in [3.0, 250.0, 509.0] {
            let rule = Rule::Focus(store.manifest().geometry.world_from_voxel(DVec3::new(focus, 8.0, 8.0)));
            for integration in [Integration::Sampled, Integration::Preintegrated(TableSize::N256)] {
                let scene = scene(&store, integration);
                let of = levels_of(&levels.select(&scene, rule).unwrap());
                let picture = mixed(&mut levels, &scene, rule).await.picture;
                let row = &picture.pixels()[..of.len()];
                let (mut within, mut across, mut borders) = (0.0_f32, 0.0_f32, Vec::new());
                for (x, pair) in row.windows(2).enumerate() {
                    let [a, b] = [0, 1].map(|i| [pair[i].r, pair[i].g, pair[i].b, pair[i].a]);
                    let step = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    if of[x] == of[x + 1] {
                        within = within.max(step);
                    } else {
                        borders.push((x, of[x], of[x + 1]));
                        across = across.max(step);
                    }
                }
                assert!(borders.len() >= 2 && within > 0.01, "{borders:?}, within {within}");
                let what = format!("{integration:?}, focus {focus}, {borders:?}");
                assert!(across <= within + 2.0 / 255.0, "{what}: {across} across, {within} within");
            }
        }
    });
}

//! The mean of a ray's samples where they are of several levels (docs/definition.md, Levels 7).

use brickcast::session::levels::LevelSessions;
use brickcast_volume::lod::Rule;
use brickcast_volume::scene::{Filter, Look, Quality, Scene, ViewSpec};
use brickcast_volume::store::PrepareOptions;
use brickcast_volume::style::{Mode, Style};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{BrickIndex, Camera, Geometry, PictureSize, Projection};
use glam::DVec3;

use crate::levels::{made, mixed, nodes_by};
use crate::rig::{kernels, runtime};

/// Each level's positions count as long as they are: the mean of a ramp along the rays is that of its middle, however
/// little of it is fine.
#[test]
fn the_mean_of_several_levels_weighs_each_position_by_its_length() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = Geometry::new([32, 32, 256], [1.0; 3], [0.5; 3]).unwrap();
    let voxels = (0..256_u16).flat_map(|z| std::iter::repeat_n(z * 256, 32 * 32)).collect();
    let options = PrepareOptions { brick_size: 8, range: Some((0.0, 65_535.0)), ..PrepareOptions::default() };
    let store = made(folder.path(), "ramp", (geometry, voxels), &options);
    let colors = [(0.0, [0.0; 3]), (65_535.0, [1.0; 3])].map(|(x, rgb)| ColorPoint { x, rgb }).to_vec();
    let opacities = vec![OpacityPoint { x: 0.0, opacity: 1.0 }];
    let style = Style { mode: Mode::Average, ..Style::default() };
    let look = Look { style, ..Look::new(TransferFunction::new(colors, opacities).unwrap(), 1.0) };
    let center = geometry.center_world();
    let projection = Projection::Parallel { parallel_scale: 8.0 };
    let camera = Camera::new(center - DVec3::Z * 300.25, center, DVec3::Y, projection).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(9, 9).unwrap() };
    let scene = Scene::new(look, view, Quality { exact: true, filter: Filter::Exact, ..Quality::default() }).unwrap();
    runtime().block_on(async {
        for kernel in kernels() {
            let (session, _nodes) = nodes_by(&kernel, &store, 2).await;
            let mut levels = LevelSessions::open(session).await.unwrap();
            let rule = Rule::Focus(store.manifest().geometry.world_from_voxel(DVec3::new(16.0, 16.0, 4.0)));
            let selection = levels.select(&scene, rule).unwrap();
            let tree = *selection.levels().finest();
            // By positions as they are, and if each counted as one.
            let (mut fine, mut whole) = ([0.0, 0.0], [0.0, 0.0]);
            for z in 0..256_u32 {
                let chunk = tree.chunk_of(BrickIndex([2, 2, z / 8]));
                let share = f64::from(-i32::from(selection.per_chunk()[tree.chunk_id(chunk)])).exp2();
                fine = [fine[0] + share * f64::from(z), fine[1] + share];
                whole = [whole[0] + f64::from(z), whole[1] + 1.0];
            }
            let [unweighted, want] = [fine, whole].map(|[sum, count]| sum / count * 256.0 / 65_535.0);
            assert!((unweighted - want).abs() > 0.05, "levels are as long: {unweighted} {want}");
            let frame = mixed(&mut levels, &scene, rule).await;
            let got = f64::from(frame.picture.pixels()[40].r);
            assert!((got - want).abs() < 0.01, "{got} for {want}; {unweighted} unweighted");
        }
    });
}

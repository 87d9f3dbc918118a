//! Where all of a volume is drawn on one coarser level, by a set of levels, the picture is that level's own.

use std::time::Duration;

use brickcast::embedded::{Backend, BackendChoice};
use brickcast::session::Session;
use brickcast::session::levels::LevelSessions;
use brickcast_volume::lod::LevelSet;
use brickcast_volume::scene::Transport;
use brickcast_volume::style::Style;
use brickcast_volume::{Camera, Projection};
use glam::DVec3;

use crate::levels::{alone, nodes_by, scene, store};
use crate::rig::{bits, runtime, worst};

/// From before, beside and within the volume, in both modes.
#[test]
fn all_on_one_level_is_that_level_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 8);
    let center = store.manifest().geometry.center_world();
    let perspective = Projection::Perspective { view_angle: 50.0 };
    runtime().block_on(async {
        let backend = Backend::open(BackendChoice::Cpu).unwrap();
        let (root, _nodes) = nodes_by(&backend, &store, 1).await;
        let mut levels = LevelSessions::open(Session::on(root.cluster().clone())).await.unwrap();
        for level in [1, 2] {
            let mut of_level = root.at_level(level).await.unwrap();
            for (eye, exact) in
                [([90.0, -40.0, 60.0], false), ([20.0, 15.0, -10.0], false), ([20.0, 15.0, -10.0], true)]
            {
                let camera = Camera::new(center + DVec3::from(eye), center, DVec3::Y, perspective).unwrap();
                let scene = scene(&store, Style::default()).seen_by(camera).with(|s| s.quality.exact = exact).unwrap();
                let count = levels.select(&scene, brickcast_volume::lod::Rule::Cone).unwrap().per_chunk().count();
                let set = LevelSet::new([(level, count as u32)]).unwrap();
                let selection = levels.select_again(&scene, &set).unwrap();
                let got = levels.render(&scene, &selection, Transport::F32, Duration::from_secs(60)).await.unwrap();
                let want = alone(&mut of_level, &scene).await;
                assert!(want.picture.pixels().iter().any(|p| p.a > 0.1), "nothing to see");
                let differ = worst(&got.picture, &want.picture);
                assert!(bits(&got.picture) == bits(&want.picture), "level {level}, {eye:?}, exact {exact}: {differ}");
            }
        }
    });
}

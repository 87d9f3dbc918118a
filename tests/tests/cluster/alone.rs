//! A cluster of one node, which goes in the middle of a frame: there is nobody to render it again.

use std::time::{Duration, Instant};

use brickcast_tests::proxy::Fault;
use brickcast_tests::rig::{MID_FRAME, Rig, render, run, scene};
use brickcast_tests::turn;
use brickcast_volume::PictureSize;
use brickcast_volume::scene::Transport;

/// What had come is shown, what is missing is told: right where it is there, and hatched where it is not.
#[test]
fn the_only_node_that_goes_mid_frame_leaves_what_it_drew() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(1).await;
        let mut session = rig.session().await;
        rig.good_frame(&mut session, 10.0).await;
        rig.proxies[0].set(Fault::Cut { after: 10 * MID_FRAME });
        let started = Instant::now();
        let scene = scene(&rig.store, 33.0).with(|s| s.view.size = PictureSize::new(1000, 800).unwrap()).unwrap();
        let frame = render(&mut session, &scene, 60).await.unwrap();
        assert!(!frame.complete && started.elapsed() < Duration::from_secs(40), "{:?}", started.elapsed());
        let problems = frame.problems.join("; ");
        assert!(problems.contains(&rig.proxies[0].address) && problems.contains("none is left"), "{problems}");
        rig.proxies[0].set(Fault::None);
        let want = render(&mut rig.reference, &scene, 60).await.unwrap();
        let (width, mut right, mut missing) = (1000, 0, 0);
        for (i, (got, want)) in frame.picture.pixels().iter().zip(want.picture.pixels()).enumerate() {
            let tile = [i % width / 64, i / width / 64].map(|v| v as u32);
            if frame.missing_tiles.contains(&tile) {
                missing += 1;
            } else {
                assert!(got == want, "pixel {i}, in a tile that is said to be there");
                right += u32::from(want.a > 0.3);
            }
        }
        assert!(right > 1000 && missing > 1000, "{right} right, {missing} missing");
        // It is asked again, and draws all.
        while session.render(&scene, Transport::F32, Duration::from_secs(60)).await.is_err() {
            assert!(started.elapsed() < Duration::from_secs(90), "not taken back");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        rig.good_frame(&mut session, 10.0).await;
    });
}

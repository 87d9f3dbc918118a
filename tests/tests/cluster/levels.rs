//! Pictures of several levels on real nodes: whoever is lost in the middle of one, it has the bits of one node.

use std::time::Duration;

use brickcast::session::levels::LevelSessions;
use brickcast::session::{Frame, Session};
use brickcast_tests::proxy::{Fault, Proxy};
use brickcast_tests::rig::{self, MID_FRAME, bits, open, run, scene};
use brickcast_tests::turn;
use brickcast_volume::lod::Rule;
use brickcast_volume::scene::Transport;
use brickcast_volume::store::Store;
use glam::DVec3;

async fn levels(store: &Store, nodes: &[String]) -> LevelSessions {
    let session: Session = open(store, nodes).await.unwrap();
    LevelSessions::open(session).await.unwrap()
}

async fn drawn(levels: &mut LevelSessions, store: &Store, azimuth: f64) -> Frame {
    let focus = store.manifest().geometry.world_from_voxel(DVec3::new(20.0, 30.0, 70.0));
    let (scene, limit) = (scene(store, azimuth), Duration::from_secs(60));
    let selection = levels.select(&scene, Rule::Focus(focus)).unwrap();
    let frame = levels.render(&scene, &selection, Transport::F32, limit).await.unwrap();
    assert!(frame.complete && frame.problems.is_empty(), "{:?}", frame.problems);
    let lod = frame.stats.lod.as_ref().unwrap();
    assert!(lod.in_view.iter().filter(|&&chunks| chunks > 0).count() >= 2, "{lod:?}");
    frame
}

#[test]
fn a_node_that_is_lost_in_the_middle_of_several_levels() {
    let _turn = turn(module_path!());
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let store = rig::store(folder.path());
        let nodes: Vec<_> = (0..4).map(|_| rig::node(folder.path())).collect();
        let mut one = levels(&store, std::slice::from_ref(&nodes[3].address)).await;
        let proxies: Vec<Proxy> = nodes[..3].iter().map(|node| Proxy::start(&node.address)).collect();
        let addresses: Vec<String> = proxies.iter().map(|proxy| proxy.address.clone()).collect();
        let mut three = levels(&store, &addresses).await;
        let well = drawn(&mut three, &store, 20.0).await;
        assert!(bits(&well) == bits(&drawn(&mut one, &store, 20.0).await), "three well nodes");
        assert_eq!((well.stats.faults.reissued, well.stats.nodes.len()), (0, 3), "{:?}", well.stats);
        proxies[2].set(Fault::Cut { after: MID_FRAME });
        let frame = drawn(&mut three, &store, 33.0).await;
        let faults = &frame.stats.faults;
        assert!(proxies[2].hits() > 0 && faults.reissued > 0, "{faults:?}");
        assert_eq!(
            faults.lost.iter().map(|lost| &lost.address).collect::<Vec<_>>(),
            [&proxies[2].address],
            "{faults:?}"
        );
        assert!(bits(&frame) == bits(&drawn(&mut one, &store, 33.0).await), "{faults:?}");
        // The next one does without it, on all levels.
        let next = drawn(&mut three, &store, 66.0).await;
        assert!(bits(&next) == bits(&drawn(&mut one, &store, 66.0).await));
    });
}

//! What nodes hold: any budget gives the same picture, and a dry run knows it beforehand.

use brickcast::embedded::planned_bytes;
use brickcast_volume::scene::MacrocellEdge;

use super::*;

/// A budget that holds a few bricks only: slower, never another picture.
#[test]
fn a_small_memory_budget_changes_no_bit() {
    let folder = tempfile::tempdir().unwrap();
    let input = volume_file(folder.path());
    let store = store(folder.path(), &input, 32);
    runtime().block_on(async {
        let kernel = Backend::open(BackendChoice::Cpu).unwrap();
        let mut frames = Vec::new();
        for budget in [1 << 30, 34 * 34 * 34 * 2 * 5] {
            let nodes = EmbeddedNodes::start(&kernel, 2, &store.path(), budget).await.unwrap();
            let mut session =
                Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash())).await.unwrap();
            let scene = scene(&store, cameras(&store)[0].1, (67, 53), true);
            session.load(&scene).await.unwrap();
            frames.push(bits(&render(&mut session, &scene, Transport::F32).await));
        }
        assert!(frames[0] == frames[1]);
    });
}

/// What `--dry-run` says a node would hold is what it holds: voxels and ghost layers, and macrocells, a fifth of them.
#[test]
#[tokio::main(flavor = "multi_thread")]
async fn planned_memory_is_what_nodes_hold() {
    let folder = tempfile::tempdir().unwrap();
    let input = volume_file(folder.path());
    let kernel = Backend::open(BackendChoice::Cpu).unwrap();
    for brick_size in [16, 64] {
        let store = store(folder.path(), &input, brick_size);
        let plain = scene(&store, cameras(&store)[0].1, (16, 16), false);
        let accelerated =
            |leap, macrocell| Acceleration { skip_empty: true, leap, macrocell, ..plain.quality.acceleration };
        let variants = [
            plain.with(|s| s.quality.acceleration.skip_empty = false),
            plain.with(|s| s.quality.acceleration = accelerated(Leap::Off, MacrocellEdge::Four)),
            plain.with(|s| s.quality.acceleration = accelerated(Leap::Macrocells(0.05), MacrocellEdge::Eight)),
            plain.with(|s| s.look.style.shading = Some(Phong::default())),
        ];
        for scene in variants.map(Result::unwrap) {
            let nodes = EmbeddedNodes::start(&kernel, 2, &store.path(), 1 << 30).await.unwrap();
            let addresses = nodes.addresses();
            let open = || Session::open_through(nodes.dial(), &addresses, StoreChoice::Hash(store.hash()));
            let mut session = open().await.unwrap();
            session.load(&scene).await.unwrap();
            let held: u64 = open().await.unwrap().members().map(|(_, node)| node.memory_used).sum();
            let planned: u64 = planned_bytes(session.store(), &scene, 2).iter().sum();
            assert!(held.abs_diff(planned) * 100 < held, "{:?}: {held}, {planned}", scene.quality.acceleration);
        }
    }
}

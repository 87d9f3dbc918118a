//! Throttled nodes, as processes with one thread that renders: processor time is then the node's own, whatever else
//! runs.

use std::path::Path;
use std::time::{Duration, Instant};

use brickcast::cluster::{Access, NodeClient};
use brickcast_proto::{LayerOrder, LoadRequest, NodeDescription, Part, Receipt, RenderOrder, Throttle, TileRect};
use brickcast_tests::process::{NodeProcess, brickcast_ok};
use brickcast_tests::turn;
use brickcast_volume::scene::{Filter, Look, Quality, Scene, Transport, ViewSpec};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{BrickId, Camera, ChunkId, Epoch, FrameId, MergeTree, Orbit, PictureSize, SessionId, TreeNode};
use futures_util::StreamExt as _;

const ONE_THREAD: [(&str, &str); 1] = [("RAYON_NUM_THREADS", "1")];
const LIMIT: Duration = Duration::from_secs(120);

/// A node on a volume that is translucent all over, so that every sample is taken.
struct Rig {
    node: NodeProcess,
    client: NodeClient,
    order: RenderOrder,
}

impl Rig {
    async fn new(folder: &Path, throttle: &str, side: u32) -> Self {
        if !folder.join("part").exists() {
            brickcast_ok(folder, &["phantom", "part.nrrd", "--dims", "64,64,64", "--pores", "2"]);
            // 8^3 bricks in 4^3 chunks.
            brickcast_ok(folder, &["prepare", "part.nrrd", "part", "--brick", "8"]);
        }
        let node = NodeProcess::start_with(folder, &["--backend", "cpu", "--throttle", throttle], &ONE_THREAD);
        let mut client = NodeClient::connect(&node.address, &Access::default()).await.unwrap();
        let store = client.open_store_named("part").await.unwrap();
        let geometry = store.manifest.geometry;
        let color = vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }];
        let opacity = vec![OpacityPoint { x: 0.0, opacity: 0.001 }];
        let look = Look::new(TransferFunction::new(color, opacity).unwrap(), geometry.min_spacing());
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let view = ViewSpec { camera, size: PictureSize::new(side, side).unwrap() };
        let plain = Quality { step: 0.25, early_termination: 1.0, ..Quality::default() };
        let scene = Scene::new(look, view, Quality { filter: Filter::Exact, ..plain }).unwrap();
        let chunks = MergeTree::of(store.manifest.grid).chunk_ids().collect();
        let layers = vec![LayerOrder { node: TreeNode(1), chunks, tiles: TileRect::of_picture(scene.view.size) }];
        let (frame, epoch, transport) = (FrameId(1), Epoch(1), Transport::F16);
        let order = RenderOrder {
            session: SessionId(1),
            frame,
            epoch,
            store: store.hash,
            scene,
            transport,
            layers,
            parts: Vec::new(),
        };
        let mut rig = Self { node, client, order };
        // Loading is not what is measured here.
        rig.load((0..512).map(BrickId::finest).collect()).await;
        rig
    }

    async fn load(&mut self, bricks: Vec<BrickId>) {
        let (store, scene) = (self.order.store, self.order.scene.clone());
        let request = LoadRequest {
            session: SessionId(1),
            store,
            bricks,
            scene,
            background: false,
            release: vec![],
            keep: vec![],
        };
        self.client.load(request).await.unwrap();
    }

    async fn render(&mut self) -> Receipt {
        let parts = self.client.render(self.order.clone()).await.unwrap();
        let parts: Vec<_> = tokio::time::timeout(LIMIT, parts.collect()).await.unwrap();
        match parts.into_iter().next_back().unwrap().unwrap().0.part {
            Part::Receipt(receipt) => receipt,
            other => panic!("the last part must be the receipt, not {other:?}"),
        }
    }

    async fn describe(&mut self) -> NodeDescription {
        self.client.describe().await.unwrap()
    }
}

/// Compared within each process: work and rest are of one clock's making, so that a busy machine changes nothing.
#[test]
#[tokio::main(flavor = "multi_thread")]
async fn a_throttled_node_declares_it_and_takes_so_many_times_its_own_work() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let mut whole = Rig::new(folder.path(), "1", 200).await;
    let mut third = Rig::new(folder.path(), "3", 200).await;
    assert_eq!(whole.describe().await.throttle, Throttle::NONE);
    assert_eq!(third.describe().await.throttle.get(), 3.0);
    let list = brickcast_ok(folder.path(), &["nodes", "--nodes", &third.node.address]);
    assert!(list.contains("throttle 3"), "{list}");
    let (fast, slow) = (whole.render().await, third.render().await);
    assert_eq!(fast.costs, slow.costs, "the same work");
    assert!(fast.costs.iter().map(|c| c.chunk).eq((0..64).map(ChunkId::new)), "{:?}", fast.costs);
    whole.order.layers[0].chunks = vec![ChunkId::new(37)];
    assert_eq!(whole.render().await.costs, fast.costs[37..38], "of a chunk on its own");
    let sum = |of: fn(&brickcast_proto::ChunkCost) -> u64| fast.costs.iter().map(of).sum::<u64>();
    assert!(fast.samples > 1_000_000 && fast.samples == sum(|c| c.samples) && fast.load_ms == 0.0, "{fast:?}");
    // So slow that no busy machine could do it in place of a rest.
    let slowest = Rig::new(folder.path(), "50", 200).await.render().await;
    for (receipt, throttle) in [(&fast, 1.0), (&slow, 3.0), (&slowest, 50.0)] {
        let own = receipt.work_ms / throttle;
        assert!(own > 5.0, "{own} ms are too few to be measured");
        assert!(receipt.render_ms >= own * throttle * 2.5 / 3.0, "{throttle}: {} ms, {own} ms own", receipt.render_ms);
    }
    // Processor time does not depend on what else runs, but for caches and the like.
    let ratio = slow.work_ms / fast.work_ms;
    assert!((1.5..6.0).contains(&ratio), "{ratio}");
}

#[test]
#[tokio::main(flavor = "multi_thread")]
async fn a_resting_node_ends_cancelled_frames_and_itself_soon() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    // It would rest for more than a minute.
    let mut rig = Rig::new(folder.path(), "100", 600).await;
    let mut parts = Box::pin(rig.client.render(rig.order.clone()).await.unwrap());
    // It says that it lives, and nothing else.
    let anything_else = async {
        loop {
            match parts.next().await {
                Some(Ok((part, _))) if matches!(part.part, Part::Progress { .. }) => {}
                other => return other,
            }
        }
    };
    let early = tokio::time::timeout(Duration::from_secs(2), anything_else).await;
    assert!(early.is_err(), "it should still rest: {early:?}");
    drop(parts);
    let cancelled = Instant::now();
    // It needs the turn that the frame had.
    rig.load(Vec::new()).await;
    assert!(cancelled.elapsed() < Duration::from_secs(30), "{:?}", cancelled.elapsed());
    // On SIGTERM the frame under way is finished, without the rest: that would take longer than the node has.
    rig.order.scene = rig.order.scene.with(|s| s.view.size = PictureSize::new(300, 300).unwrap()).unwrap();
    rig.order.layers[0].tiles = TileRect::of_picture(rig.order.scene.view.size);
    let parts = rig.client.render(rig.order.clone()).await.unwrap();
    let parts = tokio::spawn(async move { parts.collect::<Vec<_>>().await });
    tokio::time::sleep(Duration::from_millis(500)).await;
    let asked = Instant::now();
    let ended = tokio::task::spawn_blocking(move || rig.node.terminate()).await.unwrap();
    assert_eq!(ended, Some(0), "after {:?}", asked.elapsed());
    let last = parts.await.unwrap().into_iter().next_back().unwrap();
    assert!(matches!(&last, Ok((part, _)) if matches!(part.part, Part::Receipt(_))), "{last:?}");
}

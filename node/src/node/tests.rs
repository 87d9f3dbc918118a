//! Loading ahead beside frames, without a network.

use std::sync::atomic::Ordering;
use std::time::Duration;

use brickcast_proto::{LoadRequest, Part};
use brickcast_volume::scene::Scene;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{BrickGrid, BrickId, MergeTree, Orbit, SessionId, StoreHash};

use super::frames::STALL_TIMEOUT;
use super::*;
use crate::config::DataRoot;
use crate::testing::{DIMS, FakeRaycaster, make_store, ramp, scene, whole_order};

const BRICKS: u32 = 5 * 5 * 7;
const LIMIT: Duration = Duration::from_secs(60);

pub(super) struct Bench {
    _folder: tempfile::TempDir,
    pub(super) hash: StoreHash,
    pub(super) raycaster: Arc<FakeRaycaster>,
    pub(super) node: Arc<Node>,
}

impl Bench {
    pub(super) fn new() -> Self {
        Self::with_limit(STALL_TIMEOUT)
    }

    /// Gives clients up that take nothing for so long.
    pub(super) fn with_limit(stall_timeout: Duration) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let hash = make_store(&folder.path().join("ramp"), ramp);
        let raycaster = Arc::new(FakeRaycaster::new());
        let config = NodeConfig::new(DataRoot::Folder(folder.path().to_path_buf()), 1 << 24);
        let mut node = Node::new(config, raycaster.clone()).unwrap();
        node.stall_timeout = stall_timeout;
        Self { _folder: folder, hash, raycaster, node: Arc::new(node) }
    }

    /// Shows what is above `from`.
    fn scene(from: f64) -> Scene {
        let color = vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }];
        let opacity = vec![OpacityPoint { x: from, opacity: 0.0 }, OpacityPoint { x: from + 1.0, opacity: 0.5 }];
        let transfer_function = TransferFunction::new(color, opacity).unwrap();
        scene(64, 64, Orbit::default()).with(|s| s.look.transfer_function = transfer_function).unwrap()
    }

    /// For all bricks; every one of them is shown.
    fn load_all(&self) -> LoadRequest {
        let scene = Self::scene(-2.0);
        let bricks = (0..BRICKS).map(BrickId::finest).collect();
        let (session, store) = (SessionId(1), self.hash);
        LoadRequest { session, store, bricks, scene, background: true, release: Vec::new(), keep: Vec::new() }
    }

    /// Renders a corner of the volume.
    async fn render(&self) {
        let tree = MergeTree::of(BrickGrid::new(DIMS.into(), 8).unwrap());
        let order = whole_order(&tree, self.hash, Self::scene(170.0));
        let mut parts = self.node.clone().render(Caller::default(), order).await.unwrap();
        let mut last = None;
        while let Some(part) = parts.recv().await {
            last = Some(part.unwrap().part);
        }
        assert!(matches!(last, Some(Part::Receipt(_))), "{last:?}");
    }

    fn uploads(&self) -> usize {
        self.raycaster.uploads.load(Ordering::SeqCst)
    }

    async fn until(&self, is_so: impl Fn(&FakeRaycaster) -> bool) {
        let waiting = async {
            while !is_so(&self.raycaster) {
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
        };
        tokio::time::timeout(LIMIT, waiting).await.unwrap();
    }
}

/// By count, not by time: a frame that comes while bricks are loaded in the background waits for the one that is being
/// loaded (and for the next, where that had already begun), not for the many that are to follow.
#[tokio::test(flavor = "multi_thread")]
async fn a_frame_overtakes_loading_in_the_background() {
    let bench = Bench::new();
    bench.render().await;
    let shown = bench.uploads();
    assert!((1..90).contains(&shown), "{shown} of {BRICKS}: much must be left to load");
    let permits = bench.raycaster.hold_uploads();
    let (node, request) = (bench.node.clone(), bench.load_all());
    let loading = tokio::spawn(async move { node.load(Caller::default(), request).await });
    for overtaken in 0..3 {
        // A brick is on its way and cannot arrive.
        let before = bench.uploads();
        bench.until(|raycaster| raycaster.asked.load(Ordering::SeqCst) > before).await;
        let frame = bench.render();
        tokio::pin!(frame);
        let early = tokio::time::timeout(Duration::from_millis(100), &mut frame).await;
        assert!(early.is_err(), "the brick has the turn");
        // One permit after the other, each only when the frame does not come.
        while tokio::time::timeout(Duration::from_millis(200), &mut frame).await.is_err() {
            permits.send(()).unwrap();
        }
        let loaded = bench.uploads() - before;
        assert!((1..=8).contains(&loaded), "frame {overtaken} waited for {loaded} bricks");
        assert!(!loading.is_finished());
    }
    drop(permits);
    let receipt = tokio::time::timeout(LIMIT, loading).await.unwrap().unwrap().unwrap();
    assert_eq!((receipt.bricks, bench.uploads()), (BRICKS, BRICKS as usize));
    assert!(receipt.fits && receipt.bytes == receipt.resident_bytes, "{receipt:?}");
}

/// Law of adr 24: who waits for the turn waits for nothing that is loaded for later.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_loaded_beside_frames_needs_no_turn() {
    let bench = Bench::new();
    let _turn = bench.node.turns.turn(Client::Local).await;
    let beside = LoadRequest { keep: vec![StoreHash(7)], ..bench.load_all() };
    let load = bench.node.load(Caller::default(), beside);
    let receipt = tokio::time::timeout(LIMIT, load).await.expect("it waits for the turn").unwrap();
    assert!(receipt.fits && receipt.bytes > 0, "{receipt:?}");
    assert_eq!(bench.node.residency.occupancy().bricks, BRICKS as usize);
    let ordinary =
        tokio::time::timeout(Duration::from_millis(200), bench.node.load(Caller::default(), bench.load_all()));
    assert!(ordinary.await.is_err(), "others have to");
}

#[tokio::test(flavor = "multi_thread")]
async fn bricks_are_let_go_of_on_demand_and_others_take_their_room() {
    let bench = Bench::new();
    let all = bench.node.load(Caller::default(), bench.load_all()).await.unwrap();
    let (bricks, release) = (vec![BrickId::finest(0)], [5, 6, 7].map(BrickId::finest).to_vec());
    let receipt =
        bench.node.load(Caller::default(), LoadRequest { bricks, release, ..bench.load_all() }).await.unwrap();
    assert_eq!(bench.node.residency.occupancy().bricks, BRICKS as usize - 3);
    assert!(receipt.bytes > 0 && receipt.resident_bytes < all.resident_bytes, "{receipt:?}");
    // Loaded anew when they are wanted again, and they alone.
    let again = bench.node.load(Caller::default(), bench.load_all()).await.unwrap();
    assert_eq!((again.resident_bytes, bench.uploads()), (all.resident_bytes, BRICKS as usize + 3));
    let beyond = BrickId::finest(BRICKS);
    let unknown = LoadRequest { bricks: vec![], release: vec![beyond], ..bench.load_all() };
    assert!(matches!(
        bench.node.load(Caller::default(), unknown).await,
        Err(NodeError::NoSuchBrick { brick, .. }) if brick == beyond
    ));
}

/// Loading ahead must not hold up the end.
#[tokio::test(flavor = "multi_thread")]
async fn a_draining_node_ends_its_loading_after_a_brick() {
    let bench = Bench::new();
    let permits = bench.raycaster.hold_uploads();
    let (node, request) = (bench.node.clone(), bench.load_all());
    let loading = tokio::spawn(async move { node.load(Caller::default(), request).await });
    bench.until(|raycaster| raycaster.asked.load(Ordering::SeqCst) > 0).await;
    bench.node.drain();
    permits.send(()).unwrap();
    let ended = tokio::time::timeout(LIMIT, loading).await.unwrap().unwrap();
    assert!(matches!(ended, Err(NodeError::Draining)), "{ended:?}");
    assert_eq!(bench.uploads(), 1);
}

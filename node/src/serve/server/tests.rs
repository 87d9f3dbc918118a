//! A node over real loopback gRPC.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::atomic::Ordering;

use brickcast_proto::{FramePart, LoadRequest, NodeState, Part, Receipt, RenderOrder, StoreQuery};
use brickcast_volume::scene::Scene;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{BrickId, MergeTree, Orbit, SessionId, StoreHash};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tonic::transport::Channel;
use tonic::{Code, Status};

use super::*;
use crate::clients::limits::{MAX_FRAMES, MAX_LOADS, MAX_QUESTIONS, MAX_WAITING};
use crate::config::{DataRoot, NodeConfig};
use crate::serve::service::client::{Client, Frame, RawOrder, encode};
use crate::testing::{FakeRaycaster, make_store, make_store_of, ramp, scene, whole_order};

struct Served {
    folder: tempfile::TempDir,
    hash: StoreHash,
    raycaster: Arc<FakeRaycaster>,
    address: String,
    channel: Channel,
    stop: Option<oneshot::Sender<()>>,
    task: JoinHandle<Result<(), ServeError>>,
}

impl Served {
    async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let hash = make_store(&folder.path().join("ramp"), ramp);
        let raycaster = Arc::new(FakeRaycaster::new());
        let config = NodeConfig::new(DataRoot::Folder(folder.path().to_path_buf()), 1 << 24);
        let node = Arc::new(Node::new(config, raycaster.clone()).unwrap());
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (stop, stopped) = oneshot::channel();
        let task = tokio::spawn(serve(node, listener, async {
            let _ = stopped.await;
        }));
        let channel = transport::endpoint(&address, None).unwrap().connect().await.unwrap();
        Self { folder, hash, raycaster, address, channel, stop: Some(stop), task }
    }

    fn order(&self, width: u32, height: u32) -> RenderOrder {
        let grid = brickcast_volume::BrickGrid::new(crate::testing::DIMS.into(), 8).unwrap();
        whole_order(&MergeTree::of(grid), self.hash, scene(width, height, Orbit::default()))
    }

    /// Calls of the raycaster wait until this is dropped, by a test that fails too.
    fn hold(&self) -> Hold {
        self.raycaster.is_held.store(true, Ordering::SeqCst);
        Hold(self.raycaster.clone())
    }

    fn client(&self) -> Client {
        Client(self.channel.clone())
    }

    /// Over a connection of its own.
    async fn connect(&self) -> Client {
        self.connect_from(1).await
    }

    /// As another client of the node: from the loopback address of this number, which Linux has without being told.
    async fn connect_from(&self, number: u8) -> Client {
        let endpoint = transport::endpoint(&self.address, None).unwrap();
        let own = endpoint.local_address(Some(IpAddr::V4(Ipv4Addr::new(127, 0, 0, number))));
        Client(own.connect().await.unwrap())
    }

    async fn start(&self, order: &RenderOrder) -> Result<Frame, Status> {
        self.client().start(order.into()).await
    }

    /// All parts of a frame; the receipt is last.
    async fn render(&self, order: &RenderOrder) -> Result<(Vec<FramePart>, Receipt), Status> {
        self.start(order).await?.finish().await
    }
}

struct Hold(Arc<FakeRaycaster>);

impl Drop for Hold {
    fn drop(&mut self) {
        self.0.is_held.store(false, Ordering::SeqCst);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frame_comes_in_parts_and_ends_with_its_receipt() {
    let served = Served::new().await;
    let order = served.order(200, 140);
    let (parts, receipt) = served.render(&order).await.unwrap();
    assert!(parts.iter().all(|p| p.frame == order.frame && p.epoch == order.epoch));
    let tiles = parts.iter().filter(|p| matches!(p.part, Part::Tile(_))).count();
    assert_eq!(receipt.tiles as usize, tiles);
    assert_eq!(receipt.tiles + receipt.empty_tiles, order.layers[0].tiles.count());
    assert!(receipt.samples > 0 && receipt.owned_bytes > 0 && receipt.load_ms > 0.0, "{receipt:?}");
    // The second time, everything is resident.
    let (_, again) = served.render(&order).await.unwrap();
    assert_eq!((again.load_ms, again.decoded_bytes, again.bricks), (0.0, 0, receipt.bricks));
}

#[tokio::test(flavor = "multi_thread")]
async fn stores_are_described_prepared_and_refused_by_name() {
    let served = Served::new().await;
    let by_name = |name: &str, expected| StoreQuery::Name { name: name.to_owned(), expected };
    let client = served.client();
    let store = client.open_store(by_name("ramp", None)).await.unwrap();
    assert_eq!((store.hash, store.ranges.0.len()), (served.hash, 5 * 5 * 7));
    for (name, expected, code) in [
        ("../ramp", None, Code::InvalidArgument),
        ("rump", None, Code::NotFound),
        ("ramp", Some(StoreHash(1)), Code::FailedPrecondition),
    ] {
        let status = client.open_store(by_name(name, expected)).await.unwrap_err();
        assert_eq!(status.code(), code, "{status:?}");
        assert!(status.message().contains(name), "{status:?}");
    }
    let request = |bricks: std::ops::Range<u32>| {
        let bricks = bricks.map(BrickId::finest).collect();
        let (store, scene) = (served.hash, everything_shown());
        let session = SessionId(1);
        LoadRequest { session, store, bricks, scene, background: false, release: Vec::new(), keep: Vec::new() }
    };
    let receipt = client.load(request(0..175)).await.unwrap();
    assert!(receipt.fits && receipt.bricks == 175, "{receipt:?}");
    assert_eq!(receipt.owned_bytes, 40 * 33 * 50);
    assert_eq!(served.raycaster.uploads.load(Ordering::SeqCst), 175);
    assert_eq!(client.load(request(175..176)).await.unwrap_err().code(), Code::InvalidArgument);
    let node = client.describe().await;
    assert_eq!((node.resident_bricks, node.memory_used), (175, receipt.resident_bytes));
    assert_eq!((node.state, node.protocol), (NodeState::Serving, brickcast_proto::PROTOCOL_VERSION));
    assert_eq!(node.stores[0].name, "ramp");
}

/// Law 6, the disk's half: a link that leads out is not followed, though it came after the store was opened, and the
/// node goes on.
#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn links_that_come_after_a_store_was_opened_are_refused() {
    let served = Served::new().await;
    let at = |path: &str| served.folder.path().join(path);
    let halos = make_store_of(16, &at("halos"), ramp);
    let outside = tempfile::tempdir().unwrap();
    let client = served.client();
    let open = |name: &str| client.open_store(StoreQuery::Name { name: name.to_owned(), expected: None });
    let load = || {
        client.load(LoadRequest {
            session: SessionId(1),
            store: halos,
            bricks: (0..36).map(BrickId::finest).collect(),
            scene: everything_shown(),
            background: false,
            release: Vec::new(),
            keep: Vec::new(),
        })
    };
    for (link, named) in [("0/c/0/0/0", "0/c/0/0/0"), ("0", "0/c/0/0/0"), ("halos.bin", "halos.bin")] {
        open("halos").await.unwrap();
        let (link, kept) = (at("halos").join(link), outside.path().join("kept"));
        std::fs::rename(&link, &kept).unwrap();
        std::os::unix::fs::symlink(&kept, &link).unwrap();
        let status = load().await.unwrap_err();
        assert_eq!(status.code(), Code::DataLoss, "{status:?}");
        assert!(["`halos`", named, "link"].iter().all(|w| status.message().contains(w)), "{status:?}");
        // It was closed, and does not open as it is.
        let status = open("halos").await.unwrap_err();
        assert!(status.message().contains(named) || link.ends_with("0"), "{status:?}");
        served.render(&served.order(64, 64)).await.unwrap();
        std::fs::remove_file(&link).unwrap();
        std::fs::rename(&kept, &link).unwrap();
    }
    open("halos").await.unwrap();
    load().await.unwrap();
    std::fs::rename(at("halos/brickcast.json"), outside.path().join("kept")).unwrap();
    std::os::unix::fs::symlink(outside.path().join("kept"), at("halos/brickcast.json")).unwrap();
    let status = open("halos").await.unwrap_err();
    assert!(status.message().contains("brickcast.json lies behind a link"), "{status:?}");
}

/// Opacity for every value, so that every brick is loaded.
fn everything_shown() -> Scene {
    let color = vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }];
    let transfer_function = TransferFunction::new(color, vec![OpacityPoint { x: 0.0, opacity: 0.5 }]).unwrap();
    scene(64, 64, Orbit::default()).with(|s| s.look.transfer_function = transfer_function).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_panic_while_rendering_is_an_internal_error_not_a_dead_node() {
    let served = Served::new().await;
    served.raycaster.panic_in_call.store(0, Ordering::SeqCst);
    let order = served.order(64, 64);
    let status = served.render(&order).await.unwrap_err();
    assert_eq!(status.code(), Code::Internal);
    assert!(status.message().contains("told to panic"), "{status:?}");
    served.render(&order).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unknown_store_is_named_with_what_is_there() {
    let served = Served::new().await;
    let mut order = served.order(64, 64);
    order.store = StoreHash(12);
    let status = served.render(&order).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    assert!(status.message().contains("`ramp`") && status.message().contains(&order.store.to_string()), "{status:?}");
}

/// An xorshift generator's next number below `n`.
fn random(state: &mut u64, n: usize) -> usize {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state % n as u64) as usize
}

/// A good order's bytes with up to five of them changed or cut out, as an order that can be sent.
fn mutated(good: &[u8], state: &mut u64) -> RawOrder {
    loop {
        let mut bytes = good.to_vec();
        for _ in 0..=random(state, 4) {
            let at = random(state, bytes.len());
            match random(state, 3) {
                0 => bytes[at] ^= 1 << random(state, 8),
                1 => bytes[at] = random(state, 256) as u8,
                _ => drop(bytes.drain(at..(at + random(state, 9)).min(bytes.len()))),
            }
        }
        // Legal but large pictures would only make the test slow.
        if let Some(order) = RawOrder::decode(&bytes).filter(|order| order.pixels() <= 1 << 13) {
            return order;
        }
    }
}

/// Law 6, the network's half: whatever bytes come as an order, the node answers and goes on. Several are under way at
/// once, fewer than the node lets wait: an order that is turned away unread would test nothing.
#[tokio::test(flavor = "multi_thread")]
async fn mutated_orders_keep_the_node_alive() {
    const SENDERS: u64 = 8;
    const EACH: u64 = 1250;
    const { assert!(SENDERS < MAX_WAITING as u64 && SENDERS * EACH >= 10_000) };
    let served = Served::new().await;
    let good = encode(&served.order(40, 30));
    let mut senders = Vec::new();
    for sender in 1..=SENDERS {
        let (good, client) = (good.clone(), served.connect().await);
        senders.push(tokio::spawn(async move {
            let mut state = 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(sender);
            let mut refused = 0;
            for _ in 0..EACH {
                let order = mutated(&good, &mut state);
                let answer = async { client.start(order).await?.drain().await };
                let outcome = tokio::time::timeout(Duration::from_secs(20), answer).await;
                if let Err(status) = outcome.expect("an order must not hang") {
                    use Code::{Internal, ResourceExhausted, Unavailable, Unknown};
                    let fatal = [Internal, Unknown, Unavailable, ResourceExhausted].contains(&status.code());
                    assert!(!fatal, "{status:?}");
                    refused += 1;
                }
            }
            refused
        }));
    }
    let mut refused = 0;
    for sender in senders {
        refused += sender.await.unwrap();
    }
    let sent = SENDERS * EACH;
    assert!((sent / 6..sent).contains(&refused), "{refused} of {sent}: the mutations must hurt, but not always");
    served.render(&served.order(40, 30)).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(target_os = "linux"), ignore = "wants several loopback addresses")]
async fn too_many_waiting_orders_are_turned_away_and_a_lost_client_gives_its_place_back() {
    let served = Served::new().await;
    // A frame that takes its time has the turn.
    let held = served.hold();
    let hog = served.start(&served.order(64, 64)).await.unwrap();
    let mut waiting = Vec::new();
    let small = served.order(64, 64);
    for number in 2.. {
        let client = served.connect_from(number).await;
        for _ in 0..MAX_FRAMES.min(MAX_WAITING - waiting.len()) {
            waiting.push(client.start((&small).into()).await.unwrap());
        }
        if waiting.len() == MAX_WAITING {
            break;
        }
    }
    let status = served.start(&small).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
    drop(hog);
    drop(held);
    for stream in waiting {
        tokio::time::timeout(Duration::from_secs(20), stream.finish()).await.unwrap().unwrap();
    }
    served.render(&small).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn health_and_reflection_answer_and_shutdown_finishes_frames() {
    let mut served = Served::new().await;
    let mut health = tonic_health::pb::health_client::HealthClient::new(served.channel.clone());
    for service in HEALTH_NAMES {
        let request = tonic_health::pb::HealthCheckRequest { service: service.to_owned() };
        let answer = health.check(request).await.unwrap().into_inner();
        assert_eq!(answer.status(), tonic_health::pb::health_check_response::ServingStatus::Serving, "{service}");
    }
    let mut reflection =
        tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient::new(served.channel.clone());
    let request = tonic_reflection::pb::v1::ServerReflectionRequest {
        host: String::new(),
        message_request: Some(
            tonic_reflection::pb::v1::server_reflection_request::MessageRequest::FileContainingSymbol(
                "brickcast.v1.Render".to_owned(),
            ),
        ),
    };
    let mut answers = reflection.server_reflection_info(tokio_stream::once(request)).await.unwrap().into_inner();
    let answer = answers.message().await.unwrap().unwrap().message_response.unwrap();
    use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
    assert!(matches!(answer, MessageResponse::FileDescriptorResponse(_)), "{answer:?}");
    drop(answers);

    let stream = served.start(&served.order(1024, 1024)).await.unwrap();
    served.stop.take().unwrap().send(()).unwrap();
    stream.finish().await.unwrap();
    tokio::time::timeout(DRAIN_TIMEOUT + CLOSE_TIMEOUT, served.task).await.unwrap().unwrap().unwrap();
}

/// Rendered to the end, not only sent: the frame that has the turn, and the one that waits for it.
#[tokio::test(flavor = "multi_thread")]
async fn frames_that_are_not_rendered_yet_at_the_shutdown_are_finished() {
    let mut served = Served::new().await;
    let request = tonic_health::pb::HealthCheckRequest { service: String::new() };
    let mut health = tonic_health::pb::health_client::HealthClient::new(served.channel.clone());
    let mut states = health.watch(request).await.unwrap().into_inner();
    let held = served.hold();
    let order = served.order(200, 140);
    let frames = [served.start(&order).await.unwrap(), served.start(&order).await.unwrap()];
    served.stop.take().unwrap().send(()).unwrap();
    let gone = tonic_health::pb::health_check_response::ServingStatus::NotServing;
    while states.message().await.unwrap().unwrap().status() != gone {}
    // One that gives its frames up does so right after that.
    tokio::time::sleep(Duration::from_millis(200)).await;
    drop(held);
    for frame in frames {
        let (_, receipt) = frame.finish().await.unwrap();
        assert_eq!(receipt.tiles + receipt.empty_tiles, order.layers[0].tiles.count());
    }
    drop(states);
    tokio::time::timeout(DRAIN_TIMEOUT + CLOSE_TIMEOUT, served.task).await.unwrap().unwrap().unwrap();
}

mod clients;

//! Floods: what one client can do to a node by sheer number or size, while another is served all along. The other comes
//! from another address: that is what makes it another client.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use brickcast::plan::{Assignment, Shown};
use brickcast::session::Session;
use brickcast_node::clients::limits::{MAX_FRAMES, MAX_LOADS, MAX_QUESTIONS};
use brickcast_node::serve::arrival::SILENCE;
use brickcast_proto::credentials::Badge;
use brickcast_proto::{RenderOrder, transport, wire};
use brickcast_tests::process::NodeProcess;
use brickcast_tests::{rig, turn};
use brickcast_volume::scene::Transport;
use brickcast_volume::store::Store;
use brickcast_volume::{Epoch, FrameId, SessionId};
use bytes::Bytes;
use tokio::io::AsyncReadExt as _;
use tokio::net::TcpStream;
use tokio::task::{JoinHandle, JoinSet};
use tonic::Code;
use wire::render_client::RenderClient;

/// The victim's frames take longer than this only where the flood gets through: it waits for at most one frame of the
/// flood, of some milliseconds, on a machine that the flood keeps busy too.
const PATIENCE: Duration = Duration::from_secs(20);
/// Resident memory that a flood may add, MiB: receive windows and orders of all connections that are let in.
const MAY_GROW: u64 = 700;

fn resident_mib(node: &NodeProcess) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", node.id())).unwrap();
    let line = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() / 1024
}

/// Someone who renders all the while, and how long each frame took.
struct Victim {
    stop: Arc<AtomicBool>,
    frames: Arc<AtomicUsize>,
    task: JoinHandle<Vec<Duration>>,
}

impl Victim {
    fn start(mut session: Session, store: &Store) -> Self {
        let (stop, frames) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        let (stopped, counted, scene) = (stop.clone(), frames.clone(), rig::scene(store, 10.0));
        let task = tokio::spawn(async move {
            let mut times = Vec::new();
            while !stopped.load(Ordering::SeqCst) {
                let started = Instant::now();
                let frame = rig::render(&mut session, &scene, PATIENCE.as_secs()).await.unwrap();
                assert!(frame.complete, "{:?}", frame.problems);
                times.push(started.elapsed());
                counted.fetch_add(1, Ordering::SeqCst);
            }
            times
        });
        Self { stop, frames, task }
    }

    /// Every frame was complete, and some more come while what the flood holds is held: by count, not by time, since a
    /// loaded machine may need seconds for the one that the flood itself delays.
    async fn served(self, what: &str) {
        let wanted = self.frames.load(Ordering::SeqCst) + 3;
        while self.frames.load(Ordering::SeqCst) < wanted && !self.task.is_finished() {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        self.stop.store(true, Ordering::SeqCst);
        let mut times = self.task.await.unwrap();
        times.sort_unstable();
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_millis();
        eprintln!("{what}: {} frames of another client, median {} ms, slowest {} ms", times.len(), at(0.5), at(1.0));
        assert!(times.len() >= 3, "{what}: {times:?}");
    }
}

/// The loopback addresses that the flood and the victim come from.
const FLOOD: u8 = 1;
const VICTIM: u8 = 2;

/// An order for the whole of the store.
fn order(session: &Session, store: &Store) -> wire::RenderOrder {
    let scene = rig::scene(store, 0.0);
    let view = scene.view_of(&store.manifest().geometry).unwrap();
    let shown = Shown::in_scene(session.store(), &scene);
    let layers = Assignment::contiguous(&shown, 1).orders(&shown, &view).remove(0).concat();
    let order = RenderOrder {
        session: SessionId(7),
        frame: FrameId(1),
        epoch: Epoch(1),
        store: store.hash(),
        scene,
        transport: Transport::F32,
        layers,
        parts: Vec::new(),
    };
    (&order).into()
}

struct Target {
    folder: tempfile::TempDir,
    store: Store,
    node: NodeProcess,
}

impl Target {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = rig::store(folder.path());
        let node = rig::node(folder.path());
        Self { folder, store, node }
    }

    async fn session(&self, client: u8) -> Session {
        rig::open_from(client, &self.store, std::slice::from_ref(&self.node.address)).await.unwrap()
    }

    /// Takes at most `window` bytes ahead of what is read.
    async fn connect(&self, client: u8, window: u32) -> RenderClient<transport::Line> {
        let endpoint = transport::endpoint(&self.node.address, None).unwrap().initial_stream_window_size(window);
        let channel = endpoint.local_address(Some(rig::loopback(client))).connect().await.unwrap();
        transport::render_client(transport::line(channel, Badge::default()))
    }

    fn data(&self) -> &Path {
        self.folder.path()
    }
}

/// 10,000 calls over 200 connections that nobody reads.
#[test]
fn ten_thousand_open_streams_are_shed_and_others_are_served() {
    let _turn = turn(module_path!());
    const CONNECTIONS: usize = 200;
    const EACH: usize = 50;
    rig::run(async {
        let target = Target::new();
        assert!(target.data().join("part").is_dir());
        let session = target.session(VICTIM).await;
        let order = order(&session, &target.store);
        let before = resident_mib(&target.node);
        let victim = Victim::start(session, &target.store);
        let mut flood = JoinSet::new();
        for _ in 0..CONNECTIONS {
            let client = target.connect(FLOOD, transport::STREAM_WINDOW).await;
            for _ in 0..EACH {
                let (mut client, order) = (client.clone(), order.clone());
                flood.spawn(async move {
                    let answer = client.render_frame(order).await;
                    // What was let in stays open, unread, until all are there.
                    answer.map_err(|status| status.code())
                });
            }
        }
        let (mut open, mut shed) = (Vec::new(), 0);
        while let Some(outcome) = flood.join_next().await {
            match outcome.unwrap() {
                Ok(stream) => open.push(stream),
                Err(Code::ResourceExhausted) => shed += 1,
                Err(other) => panic!("refused by {other:?}"),
            }
        }
        eprintln!("{} of {} let in, {shed} shed", open.len(), CONNECTIONS * EACH);
        assert!(shed > 0 && shed + open.len() == CONNECTIONS * EACH);
        victim.served("10,000 streams").await;
        drop(open);
        let grown = resident_mib(&target.node) - before;
        eprintln!("10,000 streams: the node grew by {grown} MiB");
        assert!(grown < MAY_GROW, "{grown} MiB");
    });
}

/// A frame that was let in and that nobody reads.
type Unread = tonic::Streaming<wire::FramePart>;

/// What the tasks of a flood share.
#[derive(Default)]
struct Flood {
    over: AtomicBool,
    /// Frames that it got to the end, and orders that were refused.
    served: AtomicUsize,
    shed: AtomicUsize,
}

impl Flood {
    /// Over each of 20 connections, two orders after two, again and again; frames that are let in are read, or else
    /// held.
    async fn start(self: &Arc<Self>, target: &Target, order: &wire::RenderOrder, reads: bool) -> JoinSet<Vec<Unread>> {
        let mut tasks = JoinSet::new();
        for _ in 0..20 {
            let client = target.connect(FLOOD, if reads { transport::STREAM_WINDOW } else { 1 << 16 }).await;
            for _ in 0..2 {
                tasks.spawn(self.clone().send(client.clone(), order.clone(), reads));
            }
        }
        tasks
    }

    /// Returns the frames that it holds at the end.
    async fn send(
        self: Arc<Self>,
        mut client: RenderClient<transport::Line>,
        order: wire::RenderOrder,
        reads: bool,
    ) -> Vec<Unread> {
        let mut held = Vec::new();
        while !self.over.load(Ordering::SeqCst) {
            match client.render_frame(order.clone()).await {
                Ok(frame) if reads => {
                    let mut parts = frame.into_inner();
                    while parts.message().await.unwrap().is_some() {}
                    self.served.fetch_add(1, Ordering::SeqCst);
                }
                Ok(frame) => held.push(frame.into_inner()),
                Err(status) => {
                    assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
                    self.shed.fetch_add(1, Ordering::SeqCst);
                    tokio::time::sleep(Duration::from_millis(1)).await;
                }
            }
        }
        held
    }
}

/// Renders `frames` frames from the victim's address, two at a time, so that one waits all along; none may be refused.
async fn render_frames(target: &Target, order: &wire::RenderOrder, frames: usize) {
    let mut lines = JoinSet::new();
    for _ in 0..2 {
        let (mut client, order) = (target.connect(VICTIM, transport::STREAM_WINDOW).await, order.clone());
        lines.spawn(async move {
            for _ in 0..frames / 2 {
                let mut parts = client.render_frame(order.clone()).await.unwrap().into_inner();
                while parts.message().await.unwrap().is_some() {}
            }
        });
    }
    while let Some(line) = lines.join_next().await {
        line.unwrap();
    }
}

/// Frames that nobody takes, and orders without end: none of another client's orders is refused.
#[test]
fn a_client_that_holds_frames_open_gets_nobody_else_refused() {
    let _turn = turn(module_path!());
    rig::run(async {
        let target = Target::new();
        let order = order(&target.session(VICTIM).await, &target.store);
        let flood = Arc::new(Flood::default());
        let tasks = flood.start(&target, &order, false).await;
        render_frames(&target, &order, 20).await;
        flood.over.store(true, Ordering::SeqCst);
        // All of them at once: one that ended would let another in.
        let held = tasks.join_all().await;
        assert_eq!(held.iter().map(Vec::len).sum::<usize>(), MAX_FRAMES, "of 20 connections");
        assert!(flood.shed.load(Ordering::SeqCst) > 0);
    });
}

/// The node serves clients in turn, not orders: a flood that takes its frames as fast as they come gets about one for
/// each of the victim's. In the order of their coming it would be as many as it may have open, for two of the victim's.
#[test]
fn a_flood_of_orders_gets_one_frame_for_each_of_another_client() {
    let _turn = turn(module_path!());
    const FRAMES: usize = 40;
    rig::run(async {
        let target = Target::new();
        let order = order(&target.session(VICTIM).await, &target.store);
        let flood = Arc::new(Flood::default());
        let tasks = flood.start(&target, &order, true).await;
        // Until the flood has all places that it gets.
        while flood.served.load(Ordering::SeqCst) < MAX_FRAMES {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        let before = flood.served.load(Ordering::SeqCst);
        render_frames(&target, &order, FRAMES).await;
        let between = flood.served.load(Ordering::SeqCst) - before;
        flood.over.store(true, Ordering::SeqCst);
        tasks.join_all().await;
        eprintln!("{between} frames of the flood while {FRAMES} of another client");
        assert!(between <= 2 * FRAMES, "{between} of the flood, {FRAMES} of the victim");
    });
}

/// Orders and questions of which only a half comes hold places of the client that sends them, and not for long.
#[test]
fn half_messages_are_given_up_by_name() {
    let _turn = turn(module_path!());
    rig::run(async {
        let target = Target::new();
        let victim = Victim::start(target.session(VICTIM).await, &target.store);
        let (mut calls, mut open) = (JoinSet::new(), Vec::new());
        let started = Instant::now();
        for _ in 0..10 {
            let tcp = TcpStream::connect(&target.node.address).await.unwrap();
            let (mut send, connection) = h2::client::handshake(tcp).await.unwrap();
            tokio::spawn(connection);
            for call in ["Render/RenderFrame", "Cluster/Prepare", "Cluster/OpenStore"] {
                let (answer, mut body) = send.send_request(request(call), false).unwrap();
                body.send_data(Bytes::from_static(&[0, 0, 0, 0, 100, 1, 2, 3]), false).unwrap();
                open.push(body);
                calls.spawn(answer);
            }
            open.push(send.send_request(request("Cluster/Describe"), false).unwrap().1);
        }
        // Waits for a place, as every client of this address now does.
        let mut session = target.session(FLOOD).await;
        let mut given_up = 0;
        while let Some(answer) = calls.join_next().await {
            let answer = answer.unwrap().unwrap();
            let word = |name: &str| answer.headers()[name].to_str().unwrap().replace("%20", " ");
            match Code::from(word("grpc-status").parse::<i32>().unwrap()) {
                Code::Aborted => {
                    assert!(word("grpc-message").starts_with("nothing more of the request came"), "{answer:?}");
                    given_up += 1;
                }
                Code::ResourceExhausted => {}
                other => panic!("{other:?}: {answer:?}"),
            }
        }
        assert!(started.elapsed() < SILENCE + PATIENCE, "{:?}", started.elapsed());
        assert!((MAX_FRAMES + MAX_LOADS..=MAX_FRAMES + MAX_LOADS + MAX_QUESTIONS).contains(&given_up), "{given_up}");
        victim.served("half messages").await;
        // All of it is free again, though the connections are open still.
        session.load(&rig::scene(&target.store, 0.0)).await.unwrap();
    });
}

fn request(call: &str) -> http::Request<()> {
    http::Request::post(format!("http://node/brickcast.v1.{call}"))
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .body(())
        .unwrap()
}

/// A message that says it has 1 GiB is refused by its first bytes, whatever follows.
#[test]
fn a_message_of_a_gibibyte_is_refused_unread() {
    let _turn = turn(module_path!());
    rig::run(async {
        let target = Target::new();
        let before = resident_mib(&target.node);
        let victim = Victim::start(target.session(VICTIM).await, &target.store);
        for call in ["Render/RenderFrame", "Cluster/Prepare", "Cluster/OpenStore", "Cluster/Describe"] {
            let tcp = TcpStream::connect(&target.node.address).await.unwrap();
            let (mut send, connection) = h2::client::handshake(tcp).await.unwrap();
            tokio::spawn(connection);
            let (answer, mut body) = send.send_request(request(call), false).unwrap();
            let mut head = vec![0];
            head.extend((1_u32 << 30).to_be_bytes());
            head.resize(4096, 7);
            body.send_data(Bytes::from(head), false).unwrap();
            let answer = tokio::time::timeout(Duration::from_secs(10), answer).await.unwrap().unwrap();
            let status = answer.headers().get("grpc-status").map(|s| s.to_str().unwrap().to_owned());
            let code = status.map(|s| Code::from(s.parse::<i32>().unwrap()));
            assert!(matches!(code, Some(Code::OutOfRange | Code::ResourceExhausted)), "{call}: {code:?}");
        }
        victim.served("1 GiB messages").await;
        let grown = resident_mib(&target.node) - before;
        assert!(grown < 200, "{grown} MiB");
    });
}

/// Connections that say nothing are closed, and then newcomers are let in again.
#[test]
fn silent_connections_are_closed_and_make_room() {
    let _turn = turn(module_path!());
    const SILENT: usize = brickcast_node::serve::connections::MAX_CONNECTIONS + 50;
    rig::run(async {
        let target = Target::new();
        let victim = Victim::start(target.session(VICTIM).await, &target.store);
        let mut silent = Vec::new();
        for _ in 0..SILENT {
            silent.push(TcpStream::connect(&target.node.address).await.unwrap());
        }
        let limit = brickcast_node::serve::connections::HELLO_TIMEOUT + Duration::from_secs(5);
        for stream in &mut silent {
            let ended = tokio::time::timeout(limit, stream.read(&mut [0; 64])).await;
            // Closed or reset; nothing is ever said to a peer that says nothing (but HTTP/2's own greeting).
            while let Ok(Ok(n)) = ended {
                if n == 0 || tokio::time::timeout(limit, stream.read(&mut [0; 64])).await.unwrap().unwrap_or(0) == 0 {
                    break;
                }
            }
            assert!(ended.is_ok(), "a silent connection stays open");
        }
        target.session(FLOOD).await;
        victim.served("silent connections").await;
    });
}

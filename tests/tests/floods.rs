//! Floods: what one client can do to a node by sheer number or size, while another is served all along.

#![allow(clippy::unwrap_used)] // helpers of tests are tests
#![cfg(unix)]

#[allow(dead_code)] // of tests of faults
mod fault_support;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use brickcast::plan::{Assignment, Shown};
use brickcast::session::Session;
use brickcast_proto::credentials::Badge;
use brickcast_proto::{RenderOrder, transport, wire};
use brickcast_tests::process::NodeProcess;
use brickcast_volume::scene::Transport;
use brickcast_volume::store::Store;
use brickcast_volume::{Epoch, FrameId, View};
use bytes::Bytes;
use tokio::io::AsyncReadExt as _;
use tokio::net::TcpStream;
use tokio::task::JoinHandle;
use tonic::Code;

/// The victim's frames take longer than this only where the flood gets through: it waits for at most the frames that others
/// have open, of some milliseconds each, on a machine that the flood keeps busy too.
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
        let (stopped, counted, scene) = (stop.clone(), frames.clone(), fault_support::scene(store, 10.0));
        let task = tokio::spawn(async move {
            let mut times = Vec::new();
            while !stopped.load(Ordering::SeqCst) {
                let started = Instant::now();
                let frame = fault_support::render(&mut session, &scene, PATIENCE.as_secs()).await.unwrap();
                assert!(frame.complete, "{:?}", frame.problems);
                times.push(started.elapsed());
                counted.fetch_add(1, Ordering::SeqCst);
            }
            times
        });
        Self { stop, frames, task }
    }

    /// Every frame was complete, and some more come while what the flood holds is held: by count, not by time, since a loaded
    /// machine may need seconds for the one that the flood itself delays.
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

/// An order for the whole of the store.
fn order(session: &Session, store: &Store) -> wire::RenderOrder {
    let scene = fault_support::scene(store, 0.0);
    let view = View::new(&store.manifest().geometry, &scene.camera, scene.size, scene.step).unwrap();
    let shown = Shown::in_scene(session.store(), &scene);
    let layers = Assignment::contiguous(&shown, 1).orders(&shown, &view).remove(0);
    let order = RenderOrder {
        frame: FrameId(1),
        epoch: Epoch(1),
        store: store.hash(),
        scene,
        transport: Transport::F32,
        layers,
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
        let store = fault_support::store(folder.path());
        let node = fault_support::node(folder.path());
        Self { folder, store, node }
    }

    async fn session(&self) -> Session {
        fault_support::open(&self.store, std::slice::from_ref(&self.node.address)).await.unwrap()
    }

    fn data(&self) -> &Path {
        self.folder.path()
    }
}

/// 10,000 calls over 200 connections that nobody reads.
#[test]
fn ten_thousand_open_streams_are_shed_and_others_are_served() {
    const CONNECTIONS: usize = 200;
    const EACH: usize = 50;
    fault_support::run(async {
        let target = Target::new();
        assert!(target.data().join("part").is_dir());
        let session = target.session().await;
        let order = order(&session, &target.store);
        let before = resident_mib(&target.node);
        let victim = Victim::start(session, &target.store);
        let mut flood = tokio::task::JoinSet::new();
        for _ in 0..CONNECTIONS {
            let endpoint = transport::endpoint(&target.node.address, None).unwrap();
            let channel = endpoint.connect().await.unwrap();
            for _ in 0..EACH {
                let (line, order) = (transport::line(channel.clone(), Badge::default()), order.clone());
                flood.spawn(async move {
                    let answer = transport::render_client(line).render_frame(order).await;
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

/// A message that says it has 1 GiB is refused by its first bytes, whatever follows.
#[test]
fn a_message_of_a_gibibyte_is_refused_unread() {
    fault_support::run(async {
        let target = Target::new();
        let before = resident_mib(&target.node);
        let victim = Victim::start(target.session().await, &target.store);
        for call in ["Render/RenderFrame", "Cluster/Prepare", "Cluster/OpenStore", "Cluster/Describe"] {
            let tcp = TcpStream::connect(&target.node.address).await.unwrap();
            let (mut send, connection) = h2::client::handshake(tcp).await.unwrap();
            tokio::spawn(connection);
            let request = http::Request::post(format!("http://node/brickcast.v1.{call}"))
                .header("content-type", "application/grpc")
                .header("te", "trailers")
                .body(())
                .unwrap();
            let (answer, mut body) = send.send_request(request, false).unwrap();
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
    const SILENT: usize = brickcast_node::connections::MAX_CONNECTIONS + 50;
    fault_support::run(async {
        let target = Target::new();
        let victim = Victim::start(target.session().await, &target.store);
        let mut silent = Vec::new();
        for _ in 0..SILENT {
            silent.push(TcpStream::connect(&target.node.address).await.unwrap());
        }
        let limit = brickcast_node::connections::HELLO_TIMEOUT + Duration::from_secs(5);
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
        target.session().await;
        victim.served("silent connections").await;
    });
}

//! Frames that are cancelled in bursts cost nobody a connection: neither the client that cancels, whatever its node
//! takes for too many, nor another. And calls that are reset by the thousand, as an attack, cost only their own.

use std::io::{Read as _, Write as _};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::stage::{Other, Stage, bits};
use brickcast::session::Session;
use brickcast_proto::credentials::Badge;
use brickcast_proto::transport::{Line, MAX_RESETS_UNSEEN};
use brickcast_proto::{transport, wire};
use brickcast_tests::process::NodeProcess;
use brickcast_tests::{rig, turn};
use brickcast_volume::scene::{Scene, Transport};
use tonic::transport::{Channel, Server};
use tonic::{Request, Response, Status};
use wire::cluster_client::ClusterClient;
use wire::render_client::RenderClient;

const BURST: usize = 1000;
/// h2's limit of calls that are reset before they are taken up, which other software and older nodes have.
const USUAL_LIMIT: usize = 20;

/// Begins a frame `count` times, and drops it 1 to 4 ms later: before the order is sent, before it is taken up, among
/// its tiles.
async fn cancel_frames(session: &mut Session, scene: &Scene, count: usize) {
    for i in 0..count {
        let frame = session.render(scene, Transport::F32, Duration::from_secs(60));
        // Some may be done before.
        tokio::time::timeout(Duration::from_millis(1 + i as u64 % 4), frame).await.ok();
    }
}

/// By other software than ours, that does not pace itself: all of them before the node takes up any.
#[test]
fn a_node_bears_a_thousand_calls_that_were_reset_before_it_saw_them() {
    let _turn = turn(module_path!());
    rig::run(async {
        let stage = Stage::new();
        let (mut session, opened) = stage.session(1, &stage.node.address).await;
        let scene = stage.scene(0.0);
        let want = bits(&mut session, &scene).await;
        let other = Other::start(&stage).await;
        let channel = opened.first.lock().unwrap().clone().unwrap();
        // Not for so long that a ping misses its answer.
        rig::signal(&stage.node, "-STOP");
        reset_calls(&channel, BURST, Duration::from_millis(700)).await;
        rig::signal(&stage.node, "-CONT");
        for _ in 0..3 {
            assert!(bits(&mut session, &scene).await == want, "other bits");
        }
        assert_eq!(opened.count(), 1, "the connection was closed");
        other.served("calls of other software").await;
    });
}

/// Calls that are sent, and reset at once; as many as `limit` lets, but no less than twice what h2 bears.
async fn reset_calls(channel: &Channel, count: usize, limit: Duration) -> usize {
    let started = Instant::now();
    let mut sent = 0;
    while sent < count && (started.elapsed() < limit || sent < 2 * USUAL_LIMIT) {
        let calls: Vec<_> = (0..50)
            .map(|_| {
                let mut cluster = transport::cluster_client(transport::line(channel.clone(), Badge::default()));
                tokio::spawn(async move { cluster.describe(wire::DescribeRequest {}).await })
            })
            .collect();
        // Long enough that they are on their way.
        tokio::time::sleep(Duration::from_millis(8)).await;
        sent += calls.len();
        for call in calls {
            call.abort();
            call.await.ok();
        }
    }
    eprintln!("{sent} calls were reset in {:?}", started.elapsed());
    sent
}

#[test]
fn a_thousand_frames_cancelled_in_a_burst_cost_no_connection() {
    let _turn = turn(module_path!());
    rig::run(async {
        let stage = Stage::new();
        let (mut session, opened) = stage.session(1, &stage.node.address).await;
        let scene = stage.scene(0.0);
        let want = bits(&mut session, &scene).await;
        let other = Other::start(&stage).await;
        let started = Instant::now();
        cancel_frames(&mut session, &scene, BURST).await;
        assert!(bits(&mut session, &scene).await == want, "other bits");
        eprintln!("{BURST} cancelled frames and one more took {:?}", started.elapsed());
        assert!(started.elapsed() < Duration::from_secs(60), "{:?}", started.elapsed());
        assert_eq!(opened.count(), 1, "the connection was closed");
        other.served("cancelled frames").await;
    });
}

/// A node that closes connections at the usual limit, and takes calls up only now and then.
struct Older {
    render: RenderClient<Line>,
    cluster: ClusterClient<Line>,
}

#[tonic::async_trait]
impl wire::render_server::Render for Older {
    type RenderFrameStream = tonic::Streaming<wire::FramePart>;

    async fn render_frame(
        &self,
        request: Request<wire::RenderOrder>,
    ) -> Result<Response<Self::RenderFrameStream>, Status> {
        self.render.clone().render_frame(request.into_inner()).await
    }
}

#[tonic::async_trait]
impl wire::cluster_server::Cluster for Older {
    async fn describe(&self, r: Request<wire::DescribeRequest>) -> Result<Response<wire::NodeDescription>, Status> {
        self.cluster.clone().describe(r.into_inner()).await
    }

    async fn open_store(&self, r: Request<wire::OpenStoreRequest>) -> Result<Response<wire::StoreDescription>, Status> {
        self.cluster.clone().open_store(r.into_inner()).await
    }

    async fn prepare(&self, r: Request<wire::PrepareRequest>) -> Result<Response<wire::PrepareReceipt>, Status> {
        self.cluster.clone().prepare(r.into_inner()).await
    }
}

impl Older {
    /// In front of `node`, on a thread that sleeps most of the time. Its address.
    fn start(node: &str) -> String {
        let (node, listener) = (node.to_owned(), std::net::TcpListener::bind("127.0.0.1:0").unwrap());
        let address = listener.local_addr().unwrap().to_string();
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
            runtime.block_on(async {
                let channel = transport::endpoint(&node, None).unwrap().connect().await.unwrap();
                let line = transport::line(channel, Badge::default());
                let (render, cluster) =
                    (transport::render_client(line.clone()), transport::cluster_client(line.clone()));
                let older = || Self { render: render.clone(), cluster: cluster.clone() };
                tokio::spawn(async {
                    loop {
                        std::thread::sleep(Duration::from_millis(100));
                        tokio::time::sleep(Duration::from_millis(20)).await;
                    }
                });
                listener.set_nonblocking(true).unwrap();
                let incoming = transport::incoming(tokio::net::TcpListener::from_std(listener).unwrap());
                Server::builder()
                    .http2_max_pending_accept_reset_streams(Some(USUAL_LIMIT))
                    .add_service(tonic_health::server::health_reporter().1)
                    .add_service(transport::render_server(older()))
                    .add_service(transport::cluster_server(older()))
                    .serve_with_incoming(incoming)
                    .await
                    .unwrap();
            });
        });
        address
    }
}

/// Paced, no burst of ours meets the limit.
#[test]
fn cancelled_frames_cost_no_connection_to_a_node_with_the_usual_limit() {
    let _turn = turn(module_path!());
    rig::run(async {
        let stage = Stage::new();
        let (mut session, opened) = stage.session(1, &Older::start(&stage.node.address)).await;
        let scene = stage.scene(0.0);
        let want = bits(&mut session, &scene).await;
        cancel_frames(&mut session, &scene, BURST / 2).await;
        assert!(bits(&mut session, &scene).await == want, "other bits");
        assert_eq!(opened.count(), 1, "the connection was closed");
    });
}

/// A connection that is closed over cancelled calls all the same is no loss of its node: what it took is ordered again.
#[test]
fn what_a_closed_connection_took_is_ordered_again() {
    let _turn = turn(module_path!());
    rig::run(async {
        let stage = Stage::new();
        let (mut session, opened) = stage.session(1, &Older::start(&stage.node.address)).await;
        let scene = stage.scene(0.0);
        let want = bits(&mut session, &scene).await;
        let (mut again, mut epochs) = (0, Vec::new());
        let channel = opened.first.lock().unwrap().clone().unwrap();
        let started = Instant::now();
        while again == 0 && started.elapsed() < Duration::from_secs(60) {
            cancel_frames(&mut session, &scene, 4).await;
            // On the same connection, by someone who does not pace himself.
            let channel = channel.clone();
            let resets =
                tokio::spawn(async move { reset_calls(&channel, 5 * USUAL_LIMIT, Duration::from_millis(60)).await });
            let frame = rig::render(&mut session, &scene, 60).await.unwrap();
            assert!(frame.complete && frame.stats.faults.lost.is_empty(), "{:?}", frame.stats.faults);
            assert!(rig::bits(&frame) == want, "other bits");
            again += frame.stats.faults.reissued;
            epochs.push(frame.stats.faults.epoch);
            resets.await.unwrap();
        }
        assert!(bits(&mut session, &scene).await == want, "other bits");
        let closed = opened.count() - 1;
        eprintln!("{} frames, {closed} connections closed, {again} layers ordered again", epochs.len());
        assert!(closed > 0 && again > 0);
        assert!(epochs.iter().all(|e| *e == epochs[0]), "the node was lost between frames: {epochs:?}");
    });
}

fn http2(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    [&(payload.len() as u32).to_be_bytes()[1..], &[kind, flags], &stream.to_be_bytes(), payload].concat()
}

/// The headers of a call, with these flags.
fn call(stream: u32, flags: u8) -> Vec<u8> {
    let text = |s: &str| [&[s.len() as u8], s.as_bytes()].concat();
    let path = text("/brickcast.v1.Render/RenderFrame");
    let head = [&[0x83, 0x86, 0x04], &path[..], &[0x01], &text("node"), &[0x0f, 0x10], &text("application/grpc")];
    http2(1, 4 | flags, stream, &head.concat())
}

/// The bytes of calls that are reset at once.
fn resets(numbers: std::ops::Range<u32>) -> Vec<u8> {
    numbers.flat_map(|n| [call(2 * n + 1, 0), http2(3, 0, 2 * n + 1, &[0, 0, 0, 8])].concat()).collect()
}

/// An HTTP/2 connection by hand.
fn plain_connection(address: &str) -> std::net::TcpStream {
    let mut tcp = std::net::TcpStream::connect(address).unwrap();
    tcp.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    tcp.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0").unwrap();
    tcp
}

/// Makes a call and waits for its answer: the node took up all calls before it, too.
fn await_call(tcp: &mut std::net::TcpStream, number: u32) {
    tcp.write_all(&call(2 * number + 1, 1)).unwrap();
    loop {
        let mut head = [0; 9];
        tcp.read_exact(&mut head).unwrap();
        let mut payload = vec![0; u32::from_be_bytes([0, head[0], head[1], head[2]]) as usize];
        tcp.read_exact(&mut payload).unwrap();
        if head[3] == 1 && head[5..] == (2 * number + 1).to_be_bytes() {
            return;
        }
    }
}

fn memory_mib(node: &NodeProcess) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", node.id())).unwrap();
    let line = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() / 1024
}

/// Rapid reset (CVE-2023-44487): above the limit the connection ends, below it the node bears it; both by a client of
/// another address than the one that is served.
#[test]
fn resets_without_end_cost_their_own_connection_only() {
    let _turn = turn(module_path!());
    const CONNECTIONS: usize = 20;
    const EACH: u32 = 20_000;
    rig::run(async {
        let stage = Stage::new();
        let other = Other::start(&stage).await;
        let before = memory_mib(&stage.node);
        let address = stage.node.address.clone();
        let attack = tokio::task::spawn_blocking(move || {
            let bytes = Arc::new(resets(0..EACH));
            let attackers: Vec<_> = (0..CONNECTIONS)
                .map(|_| {
                    let (address, bytes) = (address.clone(), bytes.clone());
                    std::thread::spawn(move || {
                        let mut tcp = plain_connection(&address);
                        let whole = tcp.write_all(&bytes).is_ok();
                        let mut heard = Vec::new();
                        // It ends, or this times out.
                        let ended = tcp.read_to_end(&mut heard);
                        let word = heard.windows(15).any(|w| w == b"too_many_resets");
                        (whole, ended.map_err(|e| e.kind()), word)
                    })
                })
                .collect();
            attackers.into_iter().map(|a| a.join().unwrap()).collect::<Vec<_>>()
        });
        let ends = attack.await.unwrap();
        let words = ends.iter().filter(|(_, _, word)| *word).count();
        let timed_out = |e: &Result<usize, std::io::ErrorKind>| matches!(e, Err(std::io::ErrorKind::WouldBlock));
        let closed = ends.iter().filter(|(_, ended, _)| !timed_out(ended)).count();
        let grown = memory_mib(&stage.node) - before;
        eprintln!("above the limit: {closed} of {CONNECTIONS} closed, {words} in words; the node grew by {grown} MiB");
        assert!(closed == CONNECTIONS && words > 0, "{ends:?}");
        // Below it nothing is closed, and each call costs some time.
        let address = stage.node.address.clone();
        let started = Instant::now();
        let below = tokio::task::spawn_blocking(move || {
            let mut tcp = plain_connection(&address);
            let step = MAX_RESETS_UNSEEN as u32 / 2;
            for i in 0..EACH / step {
                tcp.write_all(&resets(i * step..(i + 1) * step - 1)).unwrap();
                await_call(&mut tcp, (i + 1) * step - 1);
            }
        });
        below.await.unwrap();
        let grown = memory_mib(&stage.node) - before;
        eprintln!("below the limit: {EACH} resets in {:?}; the node grew by {grown} MiB", started.elapsed());
        assert!(grown < 200, "{grown} MiB");
        other.served("resets without end").await;
    });
}

//! A cluster on a network that only exists in this process: nodes and compositor are the real ones, clocks and cables
//! are not.
//!
//! Every host is ticked in turn by one thread, on a clock that stands still while anything computes: rendering takes no
//! simulated time, only the network does. A node's queue of parts must therefore hold a whole order ([`SIZE`] is that
//! small): a renderer that waits for its client would wait for a thread that waits for it.

use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use brickcast::cluster::{Access, CallError, Dial, NodeClient, Target};
use brickcast::embedded::{Backend, BackendChoice, EmbeddedNodes};
use brickcast::session::{Frame, Session, SessionError, StoreChoice};
use brickcast_node::cpu::CpuRaycaster;
use brickcast_node::serve::admission::Admission;
use brickcast_node::{DataRoot, Node, NodeConfig, serve_incoming};
use brickcast_proto::credentials::Badge;
use brickcast_proto::transport::CONNECT_TIMEOUT;
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::scene::{Filter, Look, Quality, Scene, Transport, ViewSpec};
use brickcast_volume::store::{PrepareOptions, Store, prepare};
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use brickcast_volume::{Camera, Orbit, PictureSize, StoreHash};
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep};
use tonic::transport::Uri;
use tonic::transport::server::{Connected, TcpConnectInfo};
use turmoil::net::{TcpListener, TcpStream};

pub(crate) const NODES: [&str; 3] = ["node-a", "node-b", "node-c"];
const PORT: u16 = 7000;
const DIMS: [usize; 3] = [40, 36, 32];
/// Two tiles.
const SIZE: (u32, u32) = (128, 64);
const VIEWS: usize = 4;
/// What a node sends at once, bytes, and how long that takes: a share of a frame is spread over some 60 ms, so that
/// faults find it at every stage.
const PACKET: usize = 256;
const PACKET_TIME: Duration = Duration::from_millis(1);
/// Of every frame.
pub(crate) const DEADLINE: Duration = Duration::from_secs(30);

/// A store, some views of it, and the bits that one node draws of each.
pub(crate) struct Subject {
    _folder: tempfile::TempDir,
    path: PathBuf,
    hash: StoreHash,
    views: Vec<(Scene, Vec<[u32; 4]>)>,
}

/// Something everywhere, so that every node has pixels to send.
fn volume(path: &Path) {
    let [x, y, z] = DIMS;
    let header = format!("NRRD0004\ntype: uint8\ndimension: 3\nsizes: {x} {y} {z}\nencoding: raw\n\n");
    let values = (0..x * y * z).map(|i| 60 + (i % x * 3 + i / x % y * 2 + i / (x * y)) as u8 % 190);
    std::fs::write(path, header.into_bytes().into_iter().chain(values).collect::<Vec<u8>>()).unwrap();
}

fn scene(store: &Store, azimuth: f64) -> Scene {
    let manifest = store.manifest();
    let (lo, hi) = manifest.range;
    let orbit = Orbit { azimuth, elevation: 20.0, ..Orbit::default() };
    let function = TransferFunction::window(lo - (hi - lo), hi, 0.05, Colormap::Viridis).unwrap();
    let camera = Camera::orbit(&manifest.geometry, orbit).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(SIZE.0, SIZE.1).unwrap() };
    let whole = Quality { step: 1.0, early_termination: 1.0, exact: true, ..Quality::default() };
    let quality = Quality { filter: Filter::Exact, ..whole };
    Scene::new(Look::new(function, manifest.geometry.min_spacing()), view, quality).unwrap()
}

fn bits(frame: &Frame) -> Vec<[u32; 4]> {
    frame.picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

impl Subject {
    pub(crate) fn new() -> Rc<Self> {
        let folder = tempfile::tempdir().unwrap();
        let (file, path) = (folder.path().join("part.nrrd"), folder.path().join("part"));
        volume(&file);
        let mut source = format::open(&file, &RawHints::default()).unwrap();
        let options = PrepareOptions { brick_size: 8, ..PrepareOptions::default() };
        prepare(source.as_mut(), &path, &options, &mut |_| {}).unwrap();
        let store = Store::open(&path).unwrap();
        let hash = store.hash();
        // One node, on the network that there is.
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
        let views = runtime.block_on(async {
            let opened = Backend::open(BackendChoice::Cpu).unwrap();
            let one = EmbeddedNodes::start(&opened, 1, &path, 1 << 28).await.unwrap();
            let choice = StoreChoice::Hash(hash);
            let mut session = Session::open_through(one.dial(), &one.addresses(), choice).await.unwrap();
            let mut views = Vec::new();
            for view in 0..VIEWS {
                let scene = scene(&store, view as f64 * 47.0);
                let frame = session.render(&scene, Transport::F32, Duration::from_secs(60)).await.unwrap();
                assert!(frame.complete && frame.picture.pixels().iter().any(|p| p.a > 0.3), "nothing to see");
                views.push((scene, bits(&frame)));
            }
            views
        });
        Rc::new(Self { _folder: folder, path, hash, views })
    }

    pub(crate) fn scene(&self, number: usize) -> &Scene {
        &self.views[number % VIEWS].0
    }

    /// # Panics
    /// Where the frame is not complete, or not what one node draws.
    pub(crate) fn check(&self, number: usize, frame: &Frame) {
        assert!(frame.complete && frame.problems.is_empty(), "frame {number}: {:?}", frame.problems);
        let want = &self.views[number % VIEWS].1;
        assert!(bits(frame) == *want, "frame {number}: other bits than one node's: {:?}", frame.stats.faults);
    }

    /// A session through the simulated network; called on a simulated host.
    pub(crate) async fn session(&self) -> Result<Session, SessionError> {
        let addresses = NODES.map(|name| format!("{name}:{PORT}"));
        let mut session =
            Session::open_through(Dial::through(connect), &addresses, StoreChoice::Hash(self.hash)).await?;
        session.load(self.scene(0)).await?;
        Ok(session)
    }

    /// One life of a node; each has another identity.
    pub(crate) async fn serve(path: PathBuf) -> turmoil::Result {
        let config = NodeConfig::new(DataRoot::Single(path), 1 << 28);
        let node = Arc::new(Node::new(config, Arc::new(CpuRaycaster::new()))?);
        let listener = TcpListener::bind(("0.0.0.0", PORT)).await?;
        let incoming = futures_util::stream::unfold(listener, async |listener| {
            let accepted = listener.accept().await.map(|(stream, _)| Slow::new(stream));
            Some((accepted, listener))
        });
        Ok(serve_incoming(node, incoming, Admission::default(), std::future::pending()).await?)
    }

    /// A simulation with the nodes, and no client yet.
    pub(crate) fn simulation(&self, seed: u64, latency: Duration) -> turmoil::Sim<'static> {
        let mut sim = turmoil::Builder::new()
            .rng_seed(seed)
            .simulation_duration(Duration::from_secs(120))
            .min_message_latency(Duration::from_millis(1))
            .max_message_latency(latency)
            .tcp_capacity(1024)
            .build();
        for name in NODES {
            let path = self.path.clone();
            sim.host(name, move || Self::serve(path.clone()));
        }
        sim
    }
}

async fn connect(target: Target) -> Result<NodeClient, CallError> {
    let unreachable = |reason: String| CallError::Unreachable { address: target.address.clone(), reason };
    let endpoint = NodeClient::endpoint(&target.address, &Access::default())?;
    let connecting = endpoint.connect_with_connector(tower::service_fn(async |uri: Uri| {
        let host = uri.host().unwrap_or_default().to_owned();
        Ok::<_, io::Error>(TokioIo::new(TcpStream::connect((host, PORT)).await?))
    }));
    let channel = tokio::time::timeout(CONNECT_TIMEOUT, connecting).await;
    let channel = channel.map_err(|_| unreachable("no connection in time".to_owned()))?;
    let channel = channel.map_err(|e| unreachable(e.to_string()))?;
    Ok(NodeClient::over(&target.address, channel, Badge::default()))
}

/// A node's end of a connection, which sends [`PACKET`] bytes every [`PACKET_TIME`].
struct Slow {
    stream: TcpStream,
    rest: Pin<Box<Sleep>>,
}

impl Slow {
    fn new(stream: TcpStream) -> Self {
        Self { stream, rest: Box::pin(sleep(Duration::ZERO)) }
    }
}

impl Connected for Slow {
    type ConnectInfo = TcpConnectInfo;

    fn connect_info(&self) -> TcpConnectInfo {
        TcpConnectInfo { local_addr: self.stream.local_addr().ok(), remote_addr: self.stream.peer_addr().ok() }
    }
}

impl AsyncRead for Slow {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buf)
    }
}

impl AsyncWrite for Slow {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        ready!(self.rest.as_mut().poll(context));
        let sent = ready!(Pin::new(&mut self.stream).poll_write(context, &bytes[..bytes.len().min(PACKET)]))?;
        self.rest.as_mut().reset(Instant::now() + PACKET_TIME);
        Poll::Ready(Ok(sent))
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

/// What a frame was like, in simulated time.
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    pub(crate) took: Duration,
    pub(crate) reissued: usize,
    pub(crate) lost: Vec<String>,
    /// Nodes that contributed layers.
    pub(crate) nodes: usize,
}

/// What client and driver of a simulation tell each other.
#[derive(Debug, Default)]
pub(crate) struct Log {
    pub(crate) frames: Vec<Seen>,
    /// The frame that the fault is meant for is under way.
    pub(crate) armed: bool,
    /// The fault is over.
    pub(crate) healed: bool,
}

pub(crate) type SharedLog = Rc<RefCell<Log>>;

/// Renders frame `number`, checks it, and notes it.
pub(crate) async fn render(subject: &Subject, session: &mut Session, number: usize, log: &SharedLog) {
    let started = Instant::now();
    let frame = session.render(subject.scene(number), Transport::F32, DEADLINE).await.unwrap();
    subject.check(number, &frame);
    let faults = &frame.stats.faults;
    log.borrow_mut().frames.push(Seen {
        took: started.elapsed(),
        reissued: faults.reissued,
        lost: faults.lost.iter().map(|lost| lost.why.clone()).collect(),
        nodes: frame.stats.nodes.iter().filter(|n| n.layers > 0).count(),
    });
}

//! What tests of cancelled frames share: a node, sessions whose connections are counted, and another client.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use brickcast::cluster::{Access, CallError, Dial, NodeClient, Target};
use brickcast::session::{Session, StoreChoice};
use brickcast_proto::credentials::Badge;
use brickcast_tests::process::NodeProcess;
use brickcast_volume::scene::Scene;
use brickcast_volume::store::Store;
use hyper_util::rt::TokioIo;
use tokio::net::TcpStream;
use tonic::transport::{Channel, Uri};

use brickcast_tests::rig;

pub(crate) struct Stage {
    _folder: tempfile::TempDir,
    pub(crate) store: Store,
    pub(crate) node: NodeProcess,
}

impl Stage {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = rig::store(folder.path());
        let node = rig::node(folder.path());
        Self { _folder: folder, store, node }
    }

    pub(crate) fn scene(&self, azimuth: f64) -> Scene {
        rig::scene(&self.store, azimuth)
    }

    /// From `client`'s address; its connections are counted, and kept.
    pub(crate) async fn session(&self, client: u8, address: &str) -> (Session, Arc<Opened>) {
        let opened = Arc::new(Opened::default());
        let dial = Dial::through({
            let opened = opened.clone();
            move |target| connect(client, target, opened.clone())
        });
        let choice = StoreChoice::Hash(self.store.hash());
        (Session::open_through(dial, &[address.to_owned()], choice).await.unwrap(), opened)
    }
}

/// Connections that a session opened.
#[derive(Default)]
pub(crate) struct Opened {
    count: AtomicUsize,
    pub(crate) first: Mutex<Option<Channel>>,
}

impl Opened {
    pub(crate) fn count(&self) -> usize {
        self.count.load(Ordering::SeqCst)
    }
}

pub(crate) async fn connect(client: u8, target: Target, opened: Arc<Opened>) -> Result<NodeClient, CallError> {
    let endpoint = NodeClient::endpoint(&target.address, &Access::default())?;
    let counted = opened.clone();
    let connector = tower::service_fn(move |uri: Uri| {
        counted.count.fetch_add(1, Ordering::SeqCst);
        async move {
            let socket = tokio::net::TcpSocket::new_v4()?;
            socket.bind((rig::loopback(client), 0).into())?;
            let to = uri.authority().unwrap().as_str().parse().unwrap();
            let stream: TcpStream = socket.connect(to).await?;
            stream.set_nodelay(true)?;
            Ok::<_, std::io::Error>(TokioIo::new(stream))
        }
    });
    let channel = endpoint.connect_with_connector(connector).await;
    let channel =
        channel.map_err(|e| CallError::Unreachable { address: target.address.clone(), reason: format!("{e:?}") })?;
    opened.first.lock().unwrap().get_or_insert(channel.clone());
    Ok(NodeClient::over(&target.address, channel, Badge::default()))
}

/// Another client, that renders all the while.
pub(crate) struct Other {
    stop: Arc<AtomicBool>,
    task: tokio::task::JoinHandle<Vec<Duration>>,
    opened: Arc<Opened>,
}

impl Other {
    pub(crate) async fn start(stage: &Stage) -> Self {
        let (mut session, opened) = stage.session(2, &stage.node.address).await;
        let (stop, scene) = (Arc::new(AtomicBool::new(false)), stage.scene(10.0));
        let stopped = stop.clone();
        let want = bits(&mut session, &scene).await;
        let task = tokio::spawn(async move {
            let mut times = Vec::new();
            while !stopped.load(Ordering::SeqCst) || times.len() < 3 {
                let started = Instant::now();
                assert!(bits(&mut session, &scene).await == want, "other bits");
                times.push(started.elapsed());
            }
            times
        });
        Self { stop, task, opened }
    }

    pub(crate) async fn served(self, what: &str) {
        self.stop.store(true, Ordering::SeqCst);
        let mut times = self.task.await.unwrap();
        times.sort_unstable();
        let (median, slowest) = (times[times.len() / 2], times[times.len() - 1]);
        eprintln!("{what}: {} frames of another client, median {median:?}, slowest {slowest:?}", times.len());
        assert!(slowest < Duration::from_secs(20), "{what}: {slowest:?}");
        assert_eq!(self.opened.count(), 1, "{what}: another client's connection");
    }
}

/// Of a frame that nothing happened to: complete, no node lost.
pub(crate) async fn bits(session: &mut Session, scene: &Scene) -> Vec<[u32; 4]> {
    let frame = rig::render(session, scene, 60).await.unwrap();
    assert!(frame.complete && frame.stats.faults.lost.is_empty(), "{:?} {:?}", frame.problems, frame.stats.faults);
    rig::bits(&frame)
}

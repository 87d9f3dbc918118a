//! What the tests of faults share: a store, nodes behind proxies, a session, and the bits that every frame must have.

use std::net::{IpAddr, Ipv4Addr};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use crate::process::{NodeProcess, brickcast_ok};
use crate::proxy::{Fault, Proxy};
use brickcast::cluster::{Access, CallError, Dial, NodeClient, Target};
use brickcast::session::{Frame, Session, SessionError, StoreChoice};
use brickcast_proto::credentials::Badge;
use brickcast_volume::scene::{Filter, Look, Quality, Scene, Transport, ViewSpec};
use brickcast_volume::store::Store;
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use brickcast_volume::{Camera, Orbit, PictureSize};

/// Bytes of tiles after which a node is surely in the middle of a frame: a share of a third is about 500 KiB of f32.
pub const MID_FRAME: u64 = 60_000;

/// A prepared part of 96 x 80 x 88 voxels in bricks of 16, named `part` in the folder.
pub fn store(folder: &Path) -> Store {
    brickcast_ok(folder, &["phantom", "part.nrrd", "--dims", "96,80,88", "--pores", "2"]);
    brickcast_ok(folder, &["prepare", "part.nrrd", "part", "--brick", "16"]);
    Store::open(&folder.join("part")).unwrap()
}

/// Something in every brick, in exact mode; `azimuth` in degrees.
pub fn scene(store: &Store, azimuth: f64) -> Scene {
    let manifest = store.manifest();
    let (lo, hi) = manifest.range;
    let orbit = Orbit { azimuth, elevation: 20.0, ..Orbit::default() };
    let function = TransferFunction::window(lo - (hi - lo), hi, 0.05, Colormap::Viridis).unwrap();
    let camera = Camera::orbit(&manifest.geometry, orbit).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(320, 256).unwrap() };
    let whole = Quality { step: 1.0, early_termination: 1.0, exact: true, ..Quality::default() };
    let quality = Quality { filter: Filter::Exact, ..whole };
    Scene::new(Look::new(function, manifest.geometry.min_spacing()), view, quality).unwrap()
}

pub fn node(folder: &Path) -> NodeProcess {
    NodeProcess::start(folder, &["--backend", "cpu"])
}

pub fn signal(node: &NodeProcess, name: &str) {
    let id = node.id().to_string();
    assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
}

/// Nodes, each behind a proxy.
#[derive(Debug)]
pub struct Rig {
    pub folder: tempfile::TempDir,
    pub store: Arc<Store>,
    pub nodes: Vec<NodeProcess>,
    pub proxies: Vec<Proxy>,
    /// Of the pictures, pixels.
    pub size: (u32, u32),
    /// Seconds that a frame may take; a node that falls silent is given up after half of them.
    pub deadline: u64,
    /// What one node draws, per azimuth asked for.
    pub reference: Session,
    _one: NodeProcess,
}

impl Rig {
    pub async fn new(count: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Arc::new(store(folder.path()));
        let one = node(folder.path());
        let reference = open(&store, std::slice::from_ref(&one.address)).await.unwrap();
        let nodes: Vec<NodeProcess> = (0..count).map(|_| node(folder.path())).collect();
        let proxies = nodes.iter().map(|n| Proxy::start(&n.address)).collect();
        Self { folder, store, nodes, proxies, size: (320, 256), deadline: 60, reference, _one: one }
    }

    /// Ends a node, if it has not ended, and starts another at its address, with these flags.
    pub fn restart(&mut self, index: usize, flags: &[&str]) {
        let node = &mut self.nodes[index];
        node.kill();
        let address = node.address.clone();
        *node = NodeProcess::start_at(self.folder.path(), &address, &[&["--backend", "cpu"], flags].concat());
    }

    pub fn addresses(&self) -> Vec<String> {
        self.proxies.iter().map(|p| p.address.clone()).collect()
    }

    /// A session on all nodes, that has rendered a frame: connections and kernels are warm, nothing went wrong.
    pub async fn session(&mut self) -> Session {
        let mut session = open(&self.store, &self.addresses()).await.unwrap();
        session.load(&scene(&self.store, 0.0)).await.unwrap();
        let frame = self.good_frame(&mut session, 0.0).await;
        assert_eq!((frame.stats.faults.reissued, frame.stats.faults.lost.len()), (0, 0), "{:?}", frame.stats.faults);
        for node in &frame.stats.nodes {
            assert!(node.layers > 0, "{node:?} contributed nothing");
        }
        session
    }

    /// A complete frame with the bits of one node.
    pub async fn good_frame(&mut self, session: &mut Session, azimuth: f64) -> Frame {
        let mut scene = scene(&self.store, azimuth);
        scene = scene.with(|s| s.view.size = PictureSize::new(self.size.0, self.size.1).unwrap()).unwrap();
        let frame = render(session, &scene, self.deadline).await.unwrap();
        assert!(frame.complete && frame.problems.is_empty(), "{:?}", frame.problems);
        let want = render(&mut self.reference, &scene, 60).await.unwrap();
        assert!(want.complete && want.picture.pixels().iter().any(|p| p.a > 0.3), "nothing to see");
        assert!(bits(&frame) == bits(&want), "other bits than one node's: {:?}", frame.stats.faults);
        frame
    }

    /// The next frame meets `fault` at the last node, is reissued, and shows the right bits all the same.
    pub async fn survives(&mut self, session: &mut Session, fault: Fault) -> Frame {
        let last = self.proxies.len() - 1;
        self.proxies[last].set(fault);
        let frame = self.good_frame(session, 33.0).await;
        let faults = &frame.stats.faults;
        assert!(self.proxies[last].hits() > 0, "{fault:?} did not strike");
        assert!(faults.reissued > 0, "{fault:?} did not hurt: {faults:?}");
        assert_eq!(faults.lost.len(), 1, "{faults:?}");
        assert!(faults.lost[0].address == self.proxies[last].address, "{faults:?}");
        assert!(faults.lost[0].why.contains(&self.proxies[last].address), "{faults:?}");
        frame
    }
}

pub async fn open(store: &Store, nodes: &[String]) -> Result<Session, SessionError> {
    Session::open(nodes, StoreChoice::Hash(store.hash())).await
}

/// A loopback address of many, all of which Linux has without being told: a client of its own to a node.
pub fn loopback(number: u8) -> IpAddr {
    IpAddr::V4(Ipv4Addr::new(127, 0, 0, number))
}

/// A session from [`loopback`].
pub async fn open_from(number: u8, store: &Store, nodes: &[String]) -> Result<Session, SessionError> {
    let dial = Dial::through(move |target: Target| async move {
        let endpoint = NodeClient::endpoint(&target.address, &Access::default())?;
        let channel = endpoint.local_address(Some(loopback(number))).connect().await;
        let channel = channel
            .map_err(|e| CallError::Unreachable { address: target.address.clone(), reason: format!("{e:?}") })?;
        Ok(NodeClient::over(&target.address, channel, Badge::default()))
    });
    Session::open_through(dial, nodes, StoreChoice::Hash(store.hash())).await
}

pub async fn render(session: &mut Session, scene: &Scene, seconds: u64) -> Result<Frame, SessionError> {
    session.render(scene, Transport::F32, Duration::from_secs(seconds)).await
}

pub fn bits(frame: &Frame) -> Vec<[u32; 4]> {
    frame.picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

pub fn run(test: impl Future<Output = ()>) {
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap().block_on(test);
}

//! What the tests of leaping share: phantoms, stores, nodes inside the process, pictures.

use std::path::{Path, PathBuf};
use std::time::Duration;

use brickcast::embedded::{Backend, BackendChoice, EmbeddedNodes};
use brickcast::picture::Picture;
use brickcast::session::{Frame, Session, StoreChoice};
use brickcast_harness::leave_out;
use brickcast_volume::PictureSize;
use brickcast_volume::camera::{Camera, Orbit};
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::phantom::{PhantomOptions, write_phantom};
use brickcast_volume::scene::{Look, Quality, Scene, Transport, ViewSpec};
use brickcast_volume::store::{PrepareOptions, RegionOptions, Segmentation, Store, prepare};
use brickcast_volume::transfer_function::TransferFunction;

pub(crate) fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap()
}

/// The CPU's, and the GPU's where there is one.
pub(crate) fn kernels() -> Vec<Backend> {
    let mut kernels = vec![Backend::open(BackendChoice::Cpu).unwrap()];
    match Backend::open(BackendChoice::Gpu) {
        Ok(gpu) => kernels.push(gpu),
        Err(error) => leave_out(format_args!("no GPU kernel: {error}")),
    }
    kernels
}

pub(crate) fn phantom(folder: &Path, name: &str, dims: [u32; 3], pores: u32, noise: f64) -> PathBuf {
    let path = folder.join(format!("{name}.nrrd"));
    let options = PhantomOptions { dims, pores, noise, ..PhantomOptions::default() };
    write_phantom(&path, &options, &mut |_, _| {}).unwrap();
    path
}

/// A store of `input`, made once.
pub(crate) fn prepared(input: &Path, folder: &Path, brick_size: u32, segmentation_range: Option<f64>) -> Store {
    let stem = input.file_stem().unwrap().to_string_lossy().into_owned();
    let target = folder.join(format!("{stem}-{brick_size}-{segmentation_range:?}"));
    if !target.is_dir() {
        let mut source = format::open(input, &RawHints::default()).unwrap();
        let regions = segmentation_range.map(|segmentation_range| RegionOptions {
            segmentation: Segmentation::Windows { range: segmentation_range },
            min_region: 0,
        });
        let range = (segmentation_range.is_none() && stem == "flat").then_some((0.0, 65535.0));
        let options = PrepareOptions { brick_size, regions, range, ..PrepareOptions::default() };
        prepare(source.as_mut(), &target, &options, &mut |_| {}).unwrap();
    }
    Store::open(&target).unwrap()
}

pub(crate) fn orbit(store: &Store, orbit: Orbit) -> Camera {
    Camera::orbit(&store.manifest().geometry, orbit).unwrap()
}

/// The plain loop at step 0.5.
pub(crate) fn scene(store: &Store, camera: Camera, transfer_function: TransferFunction) -> Scene {
    let look = Look::new(transfer_function, store.manifest().geometry.min_spacing());
    let view = ViewSpec { camera, size: PictureSize::new(96, 80).unwrap() };
    Scene::new(look, view, Quality { early_termination: 1.0, ..Quality::default() }).unwrap()
}

/// Nodes inside this process and a session with them.
#[derive(Debug)]
pub(crate) struct Rig {
    pub(crate) session: Session,
    _nodes: EmbeddedNodes,
}

impl Rig {
    pub(crate) async fn start(opened: &Backend, store: &Store, count: usize) -> Self {
        let nodes = EmbeddedNodes::start(opened, count, &store.path(), 1 << 30).await.unwrap();
        let session =
            Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash())).await.unwrap();
        Self { session, _nodes: nodes }
    }

    pub(crate) async fn render(&mut self, scene: &Scene) -> Frame {
        let frame = self.session.render(scene, Transport::F32, Duration::from_secs(120)).await.unwrap();
        assert!(frame.complete, "{:?}", frame.problems);
        frame
    }
}

pub(crate) fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

/// The largest difference of any channel.
pub(crate) fn worst(a: &Picture, b: &Picture) -> f32 {
    let pairs = a.pixels().iter().zip(b.pixels());
    pairs.flat_map(|(p, q)| (0..4).map(move |c| (p.to_array()[c] - q.to_array()[c]).abs())).fold(0.0, f32::max)
}

/// Pixels in which the pores show plainly (opacity with them against without, by more than noise could), and those of
/// them in which the fast pictures show less than half of it.
pub(crate) fn contrast(
    plain_with: &Picture,
    plain_without: &Picture,
    fast_with: &Picture,
    fast_without: &Picture,
) -> (usize, usize) {
    const SHOWN: f32 = 2.0 / 255.0;
    let alphas = |p: &Picture| p.pixels().iter().map(|p| p.a).collect::<Vec<_>>();
    let [p1, p0, f1, f0] = [plain_with, plain_without, fast_with, fast_without].map(alphas);
    let shown = |i: &usize| (p0[*i] - p1[*i]).abs() > SHOWN;
    let all = (0..p1.len()).filter(shown).count();
    let lost = (0..p1.len()).filter(shown).filter(|&i| (f0[i] - f1[i]) / (p0[i] - p1[i]) < 0.5).count();
    (all, lost)
}

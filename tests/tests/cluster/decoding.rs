//! What nodes decode beyond what they own: ghost layers must not multiply the work.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use brickcast::cluster::Dial;
use brickcast::embedded::{Backend, BackendChoice, EmbeddedNodes};
use brickcast::session::{LoadStats, Session, StoreChoice};
use brickcast_node::cpu::CpuRaycaster;
use brickcast_node::{DataRoot, Node, NodeConfig, serve};
use brickcast_tests::process::shared_data_too;
use brickcast_tests::turn;
use brickcast_volume::PictureSize;
use brickcast_volume::camera::{Camera, Orbit};
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::phantom::{PhantomOptions, write_phantom};
use brickcast_volume::scene::{Acceleration, Leap, Look, Quality, Scene, ViewSpec};
use brickcast_volume::store::{PrepareOptions, RegionOptions, Segmentation, Store, prepare};
use brickcast_volume::style::{Integration, Style, TableSize};
use brickcast_volume::transfer_function::TransferFunction;
use tokio::net::TcpListener;
use tokio::task::JoinSet;

/// Decoded bytes per owned byte, at most: half as much again for ghost layers and for neighbours that show nothing.
const MOST: f64 = 1.5;
/// The same of bricks of 16 whose slabs read two layers: those alone are (20 / 16)^3 = 1.95 times what is owned.
const MOST_OF_SMALL_SLABS: f64 = 2.0;
const BUDGET: u64 = 1 << 30;

/// With regions where a segmentation range is given.
fn prepared(folder: &Path, input: &Path, brick_size: u32, range: Option<f64>) -> Store {
    let target = folder.join(format!("store-{brick_size}"));
    let mut source = format::open(input, &RawHints::default()).unwrap();
    let regions = range.map(|range| RegionOptions { segmentation: Segmentation::Windows { range }, min_region: 0 });
    let options = PrepareOptions { brick_size, regions, ..PrepareOptions::default() };
    prepare(source.as_mut(), &target, &options, &mut |_| {}).unwrap();
    Store::open(&target).unwrap()
}

/// The scene that the command line makes of a store where nothing but `--accel` and `--integration` is asked: `none`
/// for a store without regions, and for one with regions its default, `all`.
fn default_scene(store: &Store, integration: Integration) -> Scene {
    let manifest = store.manifest();
    let acceleration = match manifest.regions {
        None => Acceleration::default(),
        Some(_) => Acceleration { skip_empty: true, leap: Leap::Regions, ..Acceleration::default() },
    };
    let function = TransferFunction::default_for(manifest.otsu, manifest.quantile_999);
    let look = Look::new(function, manifest.geometry.min_spacing());
    let look = Look { style: Style { integration, ..Style::default() }, ..look };
    let camera = Camera::orbit(&manifest.geometry, Orbit::default()).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(16, 16).unwrap() };
    Scene::new(look, view, Quality { acceleration, ..Quality::default() }).unwrap()
}

/// A ball of noise in air, in bricks whose surroundings mostly show nothing.
fn ball(folder: &Path) -> PathBuf {
    let path = folder.join("ball.nrrd");
    let edge = 128_i32;
    let mut data =
        format!("NRRD0004\ntype: uint8\ndimension: 3\nsizes: {edge} {edge} {edge}\nencoding: raw\n\n").into_bytes();
    for z in 0..edge {
        for y in 0..edge {
            data.extend((0..edge).map(|x| {
                let from_centre = [x, y, z].iter().map(|v| (v - edge / 2).pow(2)).sum::<i32>();
                let inside = from_centre < (edge * 9 / 20).pow(2);
                if inside { 150 + ((x * 7 + y * 13 + z * 29) % 50) as u8 } else { 10 + ((x * 5 + y * 3 + z) % 9) as u8 }
            }));
        }
    }
    std::fs::write(&path, data).unwrap();
    path
}

/// Nodes that share nothing, as processes do not; they end with the set of their tasks.
async fn separate_nodes(store: &Store, count: usize) -> (Vec<String>, JoinSet<()>) {
    let (mut addresses, mut running) = (Vec::new(), JoinSet::new());
    for _ in 0..count {
        let config = NodeConfig::new(DataRoot::Single(store.path()), BUDGET);
        let node = Arc::new(Node::new(config, Arc::new(CpuRaycaster::new())).unwrap());
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        addresses.push(listener.local_addr().unwrap().to_string());
        running.spawn(async move { serve(node, listener, std::future::pending()).await.unwrap() });
    }
    (addresses, running)
}

/// What all nodes together load of the store's default scene.
async fn loaded(dial: Dial, addresses: &[String], store: &Store, integration: Integration) -> LoadStats {
    let mut session = Session::open_through(dial, addresses, StoreChoice::Hash(store.hash())).await.unwrap();
    let load = session.load(&default_scene(store, integration)).await.unwrap();
    assert!(load.fits && load.owned_bytes > 0 && load.decoded_bytes > 0, "{load:?}");
    load
}

fn decoded_per_owned(load: &LoadStats) -> f64 {
    load.decoded_bytes as f64 / load.owned_bytes as f64
}

/// A casting with pores, most of which is regions.
fn phantom(folder: &Path) -> PathBuf {
    let path = folder.join("phantom.nrrd");
    write_phantom(&path, &PhantomOptions { dims: [128; 3], ..PhantomOptions::default() }, &mut |_, _| {}).unwrap();
    path
}

struct Case {
    name: &'static str,
    input: PathBuf,
    /// Bricks of 16 are tried where there are few enough of them to be quick.
    small: bool,
    /// Segmentation range at which it has leap voxels.
    range: f64,
}

/// The ball's air is no zero, so that all of it is decoded; the walnut ends in the middle of an inner chunk.
fn cases(folder: &Path) -> Vec<Case> {
    let made = [("ball", ball(folder), true, 0.4), ("phantom", phantom(folder), true, 0.03)];
    let made = made.into_iter().map(|(name, input, small, range)| Case { name, input, small, range });
    let real = [("engine", false), ("walnut_u16", true), ("bonsai", false)].into_iter().filter_map(|(name, small)| {
        let input = shared_data_too(&format!("{name}.nrrd"))?;
        Some(Case { name, input, small, range: 0.03 })
    });
    made.chain(real).collect()
}

/// Samples, which read one ghost layer, and slabs, which read two.
const INTEGRATIONS: [Integration; 2] = [Integration::Sampled, Integration::Preintegrated(TableSize::N256)];

/// The bound on bricks of that size.
fn most(brick_size: u32, integration: Integration) -> f64 {
    match integration {
        Integration::Preintegrated(_) if brick_size == 16 => MOST_OF_SMALL_SLABS,
        _ => MOST,
    }
}

/// Each node owns few bricks and shares nothing: what it decodes for their neighbours' sake shows in full. The share is
/// the same for all numbers of nodes, as no brick's cost depends on who owns its neighbours.
#[test]
fn separate_nodes_decode_at_most_half_as_much_again_as_they_own() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    tokio::runtime::Runtime::new().unwrap().block_on(async {
        for Case { name, input, small, range } in cases(folder.path()) {
            for brick_size in if small { vec![16, 32, 64] } else { vec![32, 64] } {
                let mut owned = [0; INTEGRATIONS.len()];
                for range in [None, Some(range)] {
                    let target = tempfile::tempdir_in(folder.path()).unwrap();
                    let store = prepared(target.path(), &input, brick_size, range);
                    for (integration, owned) in INTEGRATIONS.into_iter().zip(&mut owned) {
                        let what = format!("{name}, bricks of {brick_size}, regions {range:?}, {integration:?}");
                        let mut ratios = Vec::new();
                        for count in 1..=8 {
                            let (nodes, _running) = separate_nodes(&store, count).await;
                            let load = loaded(Dial::default(), &nodes, &store, integration).await;
                            assert!(
                                range.is_none() || load.owned_bytes > *owned,
                                "labels and distances were not read: {load:?}"
                            );
                            ratios.push(decoded_per_owned(&load));
                            *owned = (*owned).max(if range.is_none() { load.owned_bytes } else { 0 });
                        }
                        eprintln!("{what}, 1 to 8 separate nodes: {ratios:.3?}");
                        assert!(ratios.iter().all(|r| *r <= most(brick_size, integration)), "{what}: {ratios:?}");
                    }
                }
            }
        }
    });
}

/// Nodes of one process share what they decode: their number does not count.
#[test]
fn nodes_of_one_process_decode_together_what_one_decodes() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    tokio::runtime::Runtime::new().unwrap().block_on(async {
        let opened = Backend::open(BackendChoice::Cpu).unwrap();
        for (nth, Case { name, input, range, .. }) in cases(folder.path()).into_iter().enumerate() {
            let target = tempfile::tempdir_in(folder.path()).unwrap();
            let store = prepared(target.path(), &input, 32, [None, Some(range)][nth % 2]);
            for integration in INTEGRATIONS {
                let mut alone = None;
                for count in [1, 2, 3, 8] {
                    let what = format!("{name}, {integration:?}: {count} nodes of one process");
                    let nodes = EmbeddedNodes::start(&opened, count, &store.path(), BUDGET).await.unwrap();
                    let load = loaded(nodes.dial(), &nodes.addresses(), &store, integration).await;
                    let ratio = decoded_per_owned(&load);
                    eprintln!("{what}, bricks of 32: {ratio:.2}");
                    assert!(ratio <= most(32, integration), "{what}: {ratio}");
                    assert_eq!(*alone.get_or_insert(ratio), ratio, "{what}");
                }
            }
        }
    });
}

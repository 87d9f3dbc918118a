//! What nodes decode beyond what they own: ghost layers must not multiply the work.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

use std::path::{Path, PathBuf};
use std::sync::Arc;

use brickcast::cli::BackendArg;
use brickcast::embedded::{EmbeddedNodes, Kernel};
use brickcast::session::{Session, StoreChoice};
use brickcast_node::cpu::CpuRaycaster;
use brickcast_node::{DataRoot, Node, NodeConfig, serve};
use brickcast_tests::process::shared_data;
use brickcast_volume::PictureSize;
use brickcast_volume::camera::{Camera, Orbit};
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::phantom::{PhantomOptions, write_phantom};
use brickcast_volume::scene::{Acceleration, Filter, Leap, RegionView, Scene};
use brickcast_volume::store::{PrepareOptions, RegionOptions, Segmentation, Store, prepare};
use brickcast_volume::transfer_function::TransferFunction;
use tokio::net::TcpListener;

/// Decoded bytes per owned byte, at most: half as much again for ghost layers and for neighbours that show nothing.
const MOST: f64 = 1.5;
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

/// The scene that the command line makes of a store where nothing but `--accel` is asked: `none` for a store without
/// regions, and for one with regions its default, `all`.
fn default_scene(store: &Store) -> Scene {
    let manifest = store.manifest();
    let acceleration = match manifest.regions {
        None => Acceleration::default(),
        Some(_) => Acceleration { skip_empty: true, leap: Leap::Regions, ..Acceleration::default() },
    };
    Scene {
        camera: Camera::orbit(&manifest.geometry, Orbit::default()).unwrap(),
        size: PictureSize::new(16, 16).unwrap(),
        step: 0.5,
        transfer_function: TransferFunction::default_for(manifest.otsu, manifest.quantile_999),
        opacity_unit: manifest.geometry.min_spacing(),
        early_termination: 0.999,
        filter: Filter::Hardware,
        exact: false,
        acceleration,
        region_view: RegionView::All,
        region_transfer_function: None,
    }
}

/// A ball of noise in air, in bricks whose surroundings mostly show nothing.
fn ball(folder: &Path) -> PathBuf {
    let path = folder.join("ball.nrrd");
    let edge = 256_i32;
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

/// Nodes that share nothing, as processes do not.
async fn separate_nodes(store: &Store, count: usize) -> Vec<String> {
    let mut addresses = Vec::new();
    for _ in 0..count {
        let config = NodeConfig::new(DataRoot::Single(store.path()), BUDGET);
        let node = Arc::new(Node::new(config, Arc::new(CpuRaycaster::new())).unwrap());
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        addresses.push(listener.local_addr().unwrap().to_string());
        tokio::spawn(serve(node, listener, std::future::pending()));
    }
    addresses
}

async fn decoded_per_owned(addresses: &[String], store: &Store) -> f64 {
    let manifest = store.manifest();
    let mut session = Session::open(addresses, StoreChoice::Hash(store.hash())).await.unwrap();
    let load = session.load(&default_scene(store)).await.unwrap();
    assert!(load.fits && load.owned_bytes > 0 && load.decoded_bytes > 0, "{load:?}");
    if manifest.regions.is_some() {
        let of_voxels = manifest.geometry.voxel_count() * manifest.stored_type.bytes() as u64;
        assert!(load.owned_bytes > of_voxels, "labels and distances were not read: {load:?}");
    }
    load.decoded_bytes as f64 / load.owned_bytes as f64
}

/// A casting with pores, most of which is regions.
fn phantom(folder: &Path) -> PathBuf {
    let path = folder.join("phantom.nrrd");
    write_phantom(&path, &PhantomOptions::default(), &mut |_, _| {}).unwrap();
    path
}

struct Case {
    name: &'static str,
    input: PathBuf,
    /// Separate nodes that share its bricks of 64, at most: beyond that each owns so few of them that its ghost layers weigh
    /// more (the walnut is eight bricks in all; the ball, whose air is no zero, decodes everything; four nodes share 64 bricks
    /// of the phantom and decode 1.54 times what they own, with regions and without).
    most: usize,
    segmentation_range: Option<f64>,
}

fn cases(folder: &Path) -> Vec<Case> {
    let ball = Case { name: "ball", input: ball(folder), most: 4, segmentation_range: None };
    let leaps = Case { name: "phantom", input: phantom(folder), most: 3, segmentation_range: Some(0.03) };
    let real = [("engine", 8), ("walnut_u16", 2)].into_iter().filter_map(|(name, most)| {
        let input = shared_data(&format!("{name}.nrrd"))?;
        Some(Case { name, input, most, segmentation_range: None })
    });
    [ball, leaps].into_iter().chain(real).collect()
}

#[test]
fn separate_nodes_decode_at_most_half_as_much_again_as_they_own() {
    let folder = tempfile::tempdir().unwrap();
    tokio::runtime::Runtime::new().unwrap().block_on(async {
        for Case { name, input, most, segmentation_range } in cases(folder.path()) {
            let target = folder.path().join(name);
            std::fs::create_dir(&target).unwrap();
            let store = prepared(&target, &input, 64, segmentation_range);
            for count in 1..=most {
                let ratio = decoded_per_owned(&separate_nodes(&store, count).await, &store).await;
                eprintln!("{name}: {count} separate nodes, bricks of 64: {ratio:.2}");
                assert!(ratio <= MOST, "{name}: {count} separate nodes: {ratio}");
            }
        }
    });
}

/// Nodes of one process share what they decode: their number does not count.
#[test]
fn nodes_of_one_process_decode_together_what_one_decodes() {
    let folder = tempfile::tempdir().unwrap();
    tokio::runtime::Runtime::new().unwrap().block_on(async {
        let kernel = Kernel::open(BackendArg::Cpu).unwrap();
        for Case { name, input, segmentation_range, .. } in cases(folder.path()) {
            let target = folder.path().join(name);
            std::fs::create_dir(&target).unwrap();
            let store = prepared(&target, &input, 32, segmentation_range);
            let mut alone = None;
            for count in [1, 2, 3, 8] {
                let nodes = EmbeddedNodes::start(&kernel, count, &store.path(), BUDGET).await.unwrap();
                let ratio = decoded_per_owned(&nodes.addresses(), &store).await;
                eprintln!("{name}: {count} nodes of one process, bricks of 32: {ratio:.2}");
                assert!(ratio <= MOST, "{name}: {count} nodes of one process: {ratio}");
                assert_eq!(*alone.get_or_insert(ratio), ratio, "{name}: {count} nodes of one process");
            }
        }
    });
}

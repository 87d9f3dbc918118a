//! What a node allocates within its memory budget, counted byte by byte; what the system gives it for that is looked at
//! in `tests/tests/cluster/budget.rs`.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

use std::alloc::System;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast_node::clients::Caller;
use brickcast_node::cpu::CpuRaycaster;
use brickcast_node::{DataRoot, Node, NodeConfig};
use brickcast_proto::{LayerOrder, Part, RenderOrder, TileRect};
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::phantom::{PhantomOptions, write_phantom};
use brickcast_volume::scene::{Acceleration, Leap, Look, Quality, Scene, Transport, ViewSpec};
use brickcast_volume::store::{Levels, PrepareOptions, RegionOptions, Segmentation, Store, prepare};
use brickcast_volume::transfer_function::TransferFunction;
use brickcast_volume::{Camera, Epoch, FrameId, MergeTree, Orbit, PictureSize, SessionId, TreeNode};
use cap::Cap;

/// Counts the bytes that are allocated at once, in this test's process.
#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

/// Names the folder in which the test, called once more, makes a store.
const FOLDER: &str = "BRICKCAST_TEST_MAKES_A_STORE_IN";
const MIB: usize = 1 << 20;
/// Beside a budget, in frames of 128 x 128: tables of the transfer function, ends of open shards, pictures.
const BESIDE: usize = 8 * MIB;

/// 256^3 voxels of 16 bits with regions, in bricks of 32: 40 MiB of bricks, and 114 MiB that are decoded for them.
fn make(folder: &Path) {
    let input = folder.join("part.nrrd");
    let options = PhantomOptions { pores: 6, ..PhantomOptions::default() };
    write_phantom(&input, &options, &mut |_, _| {}).unwrap();
    let segmentation = Segmentation::Windows { range: 0.05 };
    let regions = Some(RegionOptions { segmentation, min_region: 0 });
    let options = PrepareOptions { brick_size: 32, levels: Levels::AtMost(0), regions, ..PrepareOptions::default() };
    let mut source = format::open(&input, &RawHints::default()).unwrap();
    prepare(source.as_mut(), &folder.join("part"), &options, &mut |_| {}).unwrap();
}

/// The whole volume, in one layer.
fn order(store: &Store) -> RenderOrder {
    let manifest = store.manifest();
    let function = TransferFunction::default_for(manifest.otsu, manifest.quantile_999);
    let look = Look::new(function, manifest.geometry.min_spacing());
    let camera = Camera::orbit(&manifest.geometry, Orbit::default()).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(128, 128).unwrap() };
    let acceleration = Acceleration { skip_empty: true, leap: Leap::Regions, ..Acceleration::default() };
    let quality = Quality { acceleration, early_termination: 1.0, ..Quality::default() };
    let scene = Scene::new(look, view, quality).unwrap();
    let chunks = MergeTree::of(manifest.grid).chunk_ids().collect();
    let layers = vec![LayerOrder { node: TreeNode(1), chunks, tiles: TileRect::of_picture(scene.view.size) }];
    let (session, frame, epoch, transport) = (SessionId(1), FrameId(1), Epoch(1), Transport::F32);
    RenderOrder { session, frame, epoch, store: store.hash(), scene, transport, layers, parts: Vec::new() }
}

/// One test: peaks only rise, so the order counts.
#[test]
fn a_node_allocates_no_more_than_its_budget_and_a_little() {
    // Preparing takes memory of its own, in a process of its own.
    if let Some(folder) = std::env::var_os(FOLDER) {
        return make(Path::new(&folder));
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let myself = Command::new(std::env::current_exe().unwrap()).env(FOLDER, folder).output().unwrap();
    assert!(myself.status.success(), "{}", String::from_utf8_lossy(&myself.stdout));
    let order = order(&Store::open(&folder.join("part")).unwrap());
    let runtime = tokio::runtime::Runtime::new().unwrap();
    for budget in [2, 8, 24, 48] {
        let before = ALLOCATOR.allocated();
        let config = NodeConfig::new(DataRoot::Folder(folder.to_path_buf()), (budget * MIB) as u64);
        let node = Arc::new(Node::new(config, Arc::new(CpuRaycaster::new())).unwrap());
        let (mut tiles, mut bricks) = (0, 0);
        for _ in 0..2 {
            runtime.block_on(async {
                let mut parts = node.clone().render(Caller::default(), order.clone()).await.unwrap();
                while let Some(part) = parts.recv().await {
                    match part.unwrap().part {
                        Part::Tile(_) => tiles += 1,
                        Part::Receipt(receipt) => bricks = receipt.bricks,
                        _ => {}
                    }
                }
            });
        }
        assert!(tiles > 0 && bricks > 200, "{tiles} tiles of {bricks} bricks");
        let took = ALLOCATOR.max_allocated() - before;
        println!("{budget} MiB: {} KiB", took / 1024);
        assert!(took <= budget * MIB + BESIDE, "{} MiB within {budget} MiB", took / MIB);
        assert!(took > budget * MIB / 2, "{} MiB within {budget} MiB: nothing was seen", took / MIB);
        // What its threads still hold would count as there before the next one.
        drop(node);
        let dropped = Instant::now();
        while ALLOCATOR.allocated() > before + BESIDE / 2 {
            assert!(dropped.elapsed() < Duration::from_secs(60), "the node of {budget} MiB stays");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

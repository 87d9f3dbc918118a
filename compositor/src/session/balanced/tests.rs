//! What the balancer decides, as orders to nodes.

use std::time::Duration;

use brickcast_volume::format::{self, RawHints};
use brickcast_volume::scene::{Filter, Look, Quality, ViewSpec};
use brickcast_volume::store::{PrepareOptions, Store, prepare};
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use brickcast_volume::{Camera, Epoch, FrameId, Orbit, PictureSize};

use super::*;
use crate::balance::{LoadBy, LookId};
use crate::cluster::{Members, NodeList, StoreChoice};
use crate::embedded::{Backend, BackendChoice, EmbeddedNodes};
use crate::frame::ledger::{Ledger, Ticket};
use crate::plan::{InView, StoreFacts};
use crate::session::look::ShownLook;

const NODES: usize = 3;
/// Frames to look at of those that share chunks, and within how many they come: copies are loaded meanwhile.
const SHARING: usize = 10;
const MOST_FRAMES: usize = 2000;

/// 2 x 2 x 2 chunks of one brick, all of them shown.
fn store(folder: &std::path::Path) -> Store {
    let (file, path) = (folder.join("part.nrrd"), folder.join("part"));
    let mut data = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 32 32 32\nencoding: raw\n\n".to_vec();
    data.extend((0..32_u32.pow(3)).map(|i| 60 + (i % 97) as u8));
    std::fs::write(&file, data).unwrap();
    let mut source = format::open(&file, &RawHints::default()).unwrap();
    let options = PrepareOptions { brick_size: 16, ..PrepareOptions::default() };
    prepare(source.as_mut(), &path, &options, &mut |_| {}).unwrap();
    Store::open(&path).unwrap()
}

fn scene(store: &Store) -> Scene {
    let manifest = store.manifest();
    let (lo, hi) = manifest.range;
    let function = TransferFunction::window(lo - (hi - lo), hi, 0.05, Colormap::Viridis).unwrap();
    let camera = Camera::orbit(&manifest.geometry, Orbit { azimuth: 30.0, ..Orbit::default() }).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(1000, 800).unwrap() };
    let plain = Quality { step: 1.0, early_termination: 1.0, exact: true, ..Quality::default() };
    let quality = Quality { filter: Filter::Exact, ..plain };
    Scene::new(Look::new(function, manifest.geometry.min_spacing()), view, quality).unwrap()
}

/// A strip that is left out would be dealt to whoever is there once the frame has begun, and show only in the time that
/// it takes.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_shared_out_is_ordered_whole_from_the_first_moment() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    let scene = scene(&store);
    let opened = Backend::open(BackendChoice::Cpu).unwrap();
    let nodes = EmbeddedNodes::start(&opened, NODES, &store.path(), 1 << 28).await.unwrap();
    let (list, choice) = (NodeList::parse(&nodes.addresses()).unwrap(), StoreChoice::Hash(store.hash()));
    let (members, _) = Members::open(list, &nodes.dial(), &choice).await.unwrap();
    let facts = StoreFacts::of(&store);
    let look = Arc::new(ShownLook::new(LookId(1), &facts, &scene));
    let shown = look.shown.clone();
    let view = scene.view_of(&facts.manifest.geometry).unwrap();
    let in_view = InView::new(&shown, &view);
    let first = Assignment::contiguous(&shown, NODES);
    let settings = Settings { load_by: LoadBy::Samples, ..Settings::default() };
    let mut balanced = Balanced::new(1, settings, &look);
    // One chunk has nearly all of the cost: it cannot but be shared.
    let positions = in_view.sample_positions(&shown, &view);
    let cost = |(chunk, strips): (ChunkId, &Vec<f64>)| {
        let density = if chunk == ChunkId::new(5) { 4.0 } else { 0.1 };
        (chunk, density * strips.iter().sum::<f64>())
    };
    let chunks: Vec<(ChunkId, f64)> = positions.iter().map(cost).collect();
    let costs = [NodeCost { position: 0, work_ms: 1.0, chunks }];

    let mut sharing = 0;
    for frame in 0..MOST_FRAMES {
        balanced.land();
        let demand = Demand { look: look.id, strips: positions.clone() };
        let divided = balanced.divide(&look, demand, members.roster(), &first);
        let table = &divided.table;
        let mut ledger = Ledger::new(FrameId(frame as u64), Epoch(1), in_view.chunks());
        for node in 0..NODES {
            for layers in in_view.orders_of(table, node) {
                // Refused where a tile is owed already.
                ledger.order(Ticket(node), &layers).unwrap();
            }
        }
        assert!(ledger.unordered().is_empty(), "frame {frame}: {:?} of {table:?}", ledger.unordered());
        sharing += usize::from(in_view.chunks().keys().any(|chunk| table.sharers_of(*chunk).len() > 1));
        if sharing == SHARING {
            return;
        }
        balanced.learn(divided, SessionId(1), &scene, &costs, true);
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    panic!("no chunk is shared");
}

//! Frames through [`render_frame`] with a raycaster whose picture is known, and with the CPU kernel.

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

use brickcast_proto::{ChunkCost, Part, Receipt, RenderOrder, Throttle, TileRect, decode_tile};
use brickcast_volume::scene::SceneParts;
use brickcast_volume::store::{ChunkCache, Store};
use brickcast_volume::{BrickId, ChunkId, MergeTree, Orbit, PixelKind, Premul, SessionId, StoreHash, TreeNode, over};

use self::memory::{BRICK, room_for};
use super::*;
use crate::brick::residency::Residency;
use crate::cpu::CpuRaycaster;
use crate::kernel::{Pulse, Raycaster, Recipe};
use crate::stores::OpenStore;
use crate::testing::{FakeRaycaster, make_store, ramp, scene, whole_order};

struct Bench {
    _folder: tempfile::TempDir,
    store: OpenStore,
    cache: ChunkCache,
    tables: TableCache,
    pace: Pace,
    pulse: Pulse,
}

/// Nobody else wants the turn.
struct Alone;

impl Turns for Alone {
    fn are_wanted(&self) -> bool {
        false
    }

    fn give_way(&self) -> Result<(), NodeError> {
        Ok(())
    }
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ramp");
        make_store(&path, ramp);
        let store = OpenStore { name: "ramp".to_owned(), store: Arc::new(Store::open(&path).unwrap()), coarser: None };
        let (cache, tables, pace) = (ChunkCache::new(1 << 24), TableCache::default(), Pace::new(Throttle::NONE, true));
        Self { _folder: folder, store, cache, tables, pace, pulse: Pulse::default() }
    }

    fn tree(&self) -> MergeTree {
        MergeTree::of(self.store.store.manifest().grid)
    }

    fn order(&self, width: u32, height: u32, exact: bool) -> RenderOrder {
        let orbit = Orbit { azimuth: 30.0, elevation: 20.0, zoom: 1.3, ..Orbit::default() };
        let mut order = whole_order(&self.tree(), self.store.store.hash(), scene(width, height, orbit));
        order.scene = order.scene.with(|s| s.quality.exact = exact).unwrap();
        order
    }

    fn workshop<'a>(&'a self, raycaster: &'a dyn Raycaster, residency: &'a Residency) -> Workshop<'a> {
        let Self { cache, tables, pace, pulse, .. } = self;
        Workshop { raycaster, residency, cache, tables, pace, pulse, session: SessionId(1) }
    }

    fn render(&self, order: &RenderOrder, raycaster: &dyn Raycaster, budget: u64) -> Result<Frame, NodeError> {
        let residency = Residency::new(budget);
        let workshop = self.workshop(raycaster, &residency);
        let mut frame = Frame::default();
        let mut meter = FrameMeter::new(std::time::Instant::now(), order.layers.len());
        render_frame(order, &Sources::of(&self.store), workshop, &mut meter, (&|| false, &Alone), &mut |part| {
            frame.add(order, part);
            Ok(())
        })?;
        frame.receipt = meter.receipt();
        Ok(frame)
    }
}

#[derive(Default)]
struct Frame {
    /// Answers per ordered (layer, tile).
    answers: HashMap<(TreeNode, [u32; 2]), u32>,
    pictures: HashMap<TreeNode, Vec<Premul>>,
    receipt: Receipt,
}

impl Frame {
    fn add(&mut self, order: &RenderOrder, part: Part) {
        let size = order.scene.view.size;
        match part {
            Part::Tile(tile) => {
                *self.answers.entry((tile.node, tile.tile)).or_default() += 1;
                let rect = TileRect::tile_pixels(tile.tile, size);
                let pixels = decode_tile(&tile.pixels, rect.size(), PixelKind::Over).unwrap();
                let picture = self.pictures.entry(tile.node).or_insert_with(|| vec![Premul::CLEAR; size.pixel_count()]);
                for (i, pixel) in pixels.typed::<Premul>().unwrap().iter().enumerate() {
                    let (x, y) = (i % rect.size().x as usize, i / rect.size().x as usize);
                    picture[(rect.lo.y as usize + y) * size.width() as usize + rect.lo.x as usize + x] = *pixel;
                }
            }
            Part::Empty { node, tiles } => {
                let layer = order.layers.iter().find(|l| l.node == node).unwrap();
                for linear in tiles {
                    *self.answers.entry((node, layer.tiles.tile_at(linear).unwrap())).or_default() += 1;
                }
            }
            Part::Progress { .. } | Part::Receipt(_) => panic!("these are the node's"),
        }
    }

    /// Layers folded as a compositor does.
    fn merged(&self, bench: &Bench, order: &RenderOrder) -> Vec<Premul> {
        let scene = &order.scene;
        let geometry = bench.store.store.manifest().geometry;
        let from = scene.view_of(&geometry).unwrap().viewpoint();
        bench
            .tree()
            .fold(TreeNode(1), from, &mut |n| self.pictures.get(&n).cloned(), &mut |f, b| {
                f.into_iter().zip(b).map(|(f, b)| over(f, b)).collect()
            })
            .unwrap_or_else(|| vec![Premul::CLEAR; scene.view.size.pixel_count()])
    }
}

/// The largest difference of any channel.
fn difference(a: &[Premul], b: &[Premul]) -> f32 {
    let channels = |p: &[Premul]| -> Vec<f32> { p.iter().flat_map(|p| p.to_array()).collect() };
    channels(a).iter().zip(channels(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Layers of an assignment of chunks to `nodes`, the layers of one node in an order of their own.
fn split(bench: &Bench, order: &RenderOrder, nodes: u32) -> Vec<RenderOrder> {
    let tree = bench.tree();
    let owner = |chunk| (tree.chunk_id(chunk).linear().wrapping_mul(2_654_435_761) >> 13) % nodes;
    (0..nodes)
        .map(|node| {
            let layers = tree.layers(&|_| true, &|c| owner(c) == node);
            let layers = layers.into_iter().map(|(n, chunks)| brickcast_proto::LayerOrder {
                node: n,
                chunks: chunks.into_iter().map(|c| tree.chunk_id(c)).collect(),
                tiles: order.layers[0].tiles,
            });
            RenderOrder { layers: layers.collect(), ..order.clone() }
        })
        .collect()
}

#[test]
fn every_layer_ordered_answers_exactly_once_empty_included() {
    let bench = Bench::new();
    let raycaster = FakeRaycaster::new();
    let (mut with_pixels, mut without) = (0, 0);
    for (width, height) in [(1, 1), (17, 5), (211, 97), (130, 200)] {
        for exact in [false, true] {
            let whole = bench.order(width, height, exact);
            for (i, mut order) in [vec![whole.clone()], split(&bench, &whole, 3)].concat().into_iter().enumerate() {
                // Tile rectangles of every shape, beside the volume too.
                for (l, layer) in order.layers.iter_mut().enumerate() {
                    let all = TileRect::of_picture(order.scene.view.size);
                    let corner = |a: usize| (l as u32 * 7 + i as u32) % all.hi[a];
                    layer.tiles.lo = [corner(0), corner(1)];
                }
                let frame = bench.render(&order, &raycaster, 1 << 20).unwrap();
                let owed: HashMap<_, u32> =
                    order.layers.iter().flat_map(|l| l.tiles.tiles().map(|t| ((l.node, t), 1))).collect();
                assert_eq!(frame.answers, owed, "{width}x{height} exact {exact} order {i}");
                let drawn = frame.pictures.len();
                with_pixels += drawn;
                without += order.layers.len() - drawn;
            }
        }
    }
    assert!(with_pixels > 0 && without > 0, "{with_pixels} and {without}: both kinds must have been seen");
}

#[test]
fn nothing_to_show_answers_every_tile_as_empty() {
    let bench = Bench::new();
    let mut order = bench.order(211, 97, true);
    let opacities = vec![brickcast_volume::transfer_function::OpacityPoint { x: 0.0, opacity: 0.0 }];
    let colors = order.scene.look.transfer_function.colors().to_vec();
    let nothing = brickcast_volume::transfer_function::TransferFunction::new(colors, opacities).unwrap();
    order.scene = order.scene.with(|s| s.look.transfer_function = nothing).unwrap();
    let raycaster = FakeRaycaster::new();
    let frame = bench.render(&order, &raycaster, 1 << 20).unwrap();
    assert!(frame.pictures.is_empty());
    assert_eq!(frame.answers.len(), order.layers[0].tiles.count() as usize);
    assert_eq!(raycaster.uploads.load(std::sync::atomic::Ordering::SeqCst), 0, "empty bricks are not even loaded");
}

/// The CPU kernel, exact mode: the same bits whoever renders what, and however small the budget.
#[test]
fn exact_pictures_have_the_same_bits_for_every_assignment_and_budget() {
    let bench = Bench::new();
    let raycaster = CpuRaycaster::new();
    let order = bench.order(97, 61, true);
    let want = bench.render(&order, &raycaster, 1 << 30).unwrap().merged(&bench, &order);
    assert!(want.iter().any(|p| p.a > 0.3));
    let a_few = room_for(4, raycaster.brick_bytes(1000, Recipe::default()));
    for (nodes, budget) in [(1, a_few), (2, 1 << 30), (5, 1 << 30)] {
        let mut frame = Frame::default();
        for part in split(&bench, &order, nodes) {
            frame.pictures.extend(bench.render(&part, &raycaster, budget).unwrap().pictures);
        }
        assert_eq!(difference(&frame.merged(&bench, &order), &want), 0.0, "{nodes} nodes, {budget} bytes");
    }
    let mut fast = order;
    fast.scene = fast.scene.with(|s| s.quality.exact = false).unwrap();
    let default = bench.render(&fast, &raycaster, 1 << 30).unwrap().merged(&bench, &fast);
    assert!(difference(&default, &want) <= 1.0 / 255.0);
}

/// What each chunk cost is told with its own index, whoever renders it: the costs of all parts of an assignment are
/// those of the whole.
#[test]
fn costs_are_told_by_chunk_and_are_the_same_for_every_assignment() {
    let bench = Bench::new();
    let raycaster = CpuRaycaster::new();
    let mut order = bench.order(97, 61, true);
    // Or hidden bricks would be started in the whole that are not in the parts.
    let whole = |s: &mut SceneParts| (s.quality.early_termination, s.quality.acceleration.skip_empty) = (1.0, true);
    order.scene = order.scene.with(whole).unwrap();
    let costs = |order: &RenderOrder| {
        let receipt = bench.render(order, &raycaster, 1 << 30).unwrap().receipt;
        let sum = |of: fn(&ChunkCost) -> u64| receipt.costs.iter().map(of).sum::<u64>();
        assert_eq!((receipt.samples, receipt.skips), (sum(|c| c.samples), sum(|c| c.skips)));
        assert!(receipt.costs.windows(2).all(|c| c[0].chunk < c[1].chunk));
        receipt.costs
    };
    let whole = costs(&order);
    assert!(whole.iter().map(|c| c.skips).sum::<u64>() > 0 && whole.iter().filter(|c| c.samples > 0).count() > 50);
    let tree = bench.tree();
    let mut parts = Vec::new();
    for part in split(&bench, &order, 3) {
        let ordered: Vec<ChunkId> = part.layers.iter().flat_map(|l| l.chunks.clone()).collect();
        let costs = costs(&part);
        assert!(costs.iter().all(|c| ordered.contains(&c.chunk) && tree.chunk_at(c.chunk).is_some()));
        parts.extend(costs);
    }
    parts.sort_unstable_by_key(|c| c.chunk);
    assert_eq!(parts, whole);
}

#[test]
fn orders_that_do_not_fit_the_store_are_refused() {
    let bench = Bench::new();
    let good = bench.order(64, 64, false);
    let refused = |change: fn(&mut RenderOrder)| {
        let mut order = good.clone();
        change(&mut order);
        let error = bench.render(&order, &FakeRaycaster::new(), 1 << 30).err().unwrap();
        assert_eq!(error.fault(), brickcast_proto::Fault::Invalid, "{error}");
        error.to_string()
    };
    assert!(refused(|o| o.layers[0].node = TreeNode(u64::MAX)).contains("merge tree"));
    assert!(refused(|o| o.layers[0].chunks.push(ChunkId::new(100_000))).contains("100000"));
    assert!(refused(|o| o.layers[0].node = TreeNode(2)).contains("does not lie under"));
    assert!(refused(|o| o.scene = o.scene.with(|s| s.look.opacity_unit = 1e-300).unwrap()).contains("opacity units"));
}

#[test]
fn a_cancelled_frame_stops_at_its_next_batch() {
    let bench = Bench::new();
    let (raycaster, residency) = (FakeRaycaster::new(), Residency::new(room_for(5, BRICK)));
    let workshop = bench.workshop(&raycaster, &residency);
    let order = bench.order(120, 80, true);
    let mut meter = FrameMeter::new(std::time::Instant::now(), 1);
    let calls = || raycaster.calls.load(std::sync::atomic::Ordering::SeqCst);
    let result =
        render_frame(&order, &Sources::of(&bench.store), workshop, &mut meter, (&|| calls() >= 2, &Alone), &mut |_| {
            Ok(())
        });
    assert!(matches!(result, Err(NodeError::Cancelled)));
    assert_eq!(calls(), 2);
}

/// Counts how often it is asked for the turn, and that no brick is held meanwhile.
struct Wanted<'a> {
    residency: &'a Residency,
    store: StoreHash,
    given: Cell<u32>,
}

impl Turns for Wanted<'_> {
    fn are_wanted(&self) -> bool {
        true
    }

    fn give_way(&self) -> Result<(), NodeError> {
        self.given.set(self.given.get() + 1);
        let before = self.residency.occupancy().bricks;
        self.residency.release(SessionId(1), self.store, &(0..175).map(BrickId::finest).collect::<Vec<_>>());
        assert!(before > 0 && self.residency.occupancy().bricks == 0, "a lease is held");
        Ok(())
    }
}

#[test]
fn a_long_frame_lets_others_have_their_turn_and_is_the_same_picture() {
    let bench = Bench::new();
    for exact in [false, true] {
        let mut order = bench.order(211, 197, exact);
        let raycaster = FakeRaycaster::new();
        let short = bench.render(&order, &raycaster, 1 << 30).unwrap();
        let calls = |raycaster: &FakeRaycaster| raycaster.calls.load(std::sync::atomic::Ordering::SeqCst);
        assert_eq!(calls(&raycaster), 1, "so little is one slice");
        // The fake does not look at the step: only what is expected of the frame is long.
        order.scene = order.scene.with(|s| s.quality.step = 0.01).unwrap();
        let (raycaster, residency) = (FakeRaycaster::new(), Residency::new(1 << 30));
        let turns = Wanted { residency: &residency, store: order.store, given: Cell::new(0) };
        let mut frame = Frame::default();
        let mut meter = FrameMeter::new(std::time::Instant::now(), order.layers.len());
        let workshop = bench.workshop(&raycaster, &residency);
        render_frame(&order, &Sources::of(&bench.store), workshop, &mut meter, (&|| false, &turns), &mut |part| {
            frame.add(&order, part);
            Ok(())
        })
        .unwrap();
        assert!(calls(&raycaster) > 2, "{}", calls(&raycaster));
        assert_eq!(turns.given.get() as usize, calls(&raycaster) - 1, "between slices, and not after the last");
        assert!(frame.merged(&bench, &order) == short.merged(&bench, &order), "{exact}");
        assert!(frame.answers.values().all(|&n| n == 1) && frame.answers.len() == short.answers.len());
    }
}

/// The kernel itself, in slices of a few pixels: every pixel as in one piece.
#[test]
fn slices_of_any_size_have_the_bits_of_the_whole() {
    let bench = Bench::new();
    let raycaster = CpuRaycaster::new();
    let mut order = bench.order(97, 61, false);
    order.scene = order.scene.with(|s| s.quality.step = 0.02).unwrap();
    let residency = Residency::new(1 << 30);
    let workshop = bench.workshop(&raycaster, &residency);
    let sources = Sources::of(&bench.store);
    let plan = plan::FramePlan::new(&order, &sources, workshop).unwrap();
    assert_eq!(plan.units.len(), 1);
    let pulse = Pulse::default();
    let whole = |samples: f64| {
        let mut batches =
            Batches::new(&plan, &sources, workshop, Watch::new(&pulse, &|| false), &Alone).with_slices_of(samples);
        let mut meter = FrameMeter::new(std::time::Instant::now(), 1);
        let layer = batches.take(&mut meter).unwrap().unwrap();
        assert!(batches.take(&mut meter).unwrap().is_none());
        let bits: Vec<[u32; 4]> = layer.pixels.raw().iter().map(|p| p.map(f32::to_bits)).collect();
        (layer.rect, bits, meter.receipt().samples)
    };
    let want = whole(1e18);
    assert!(pulse.count() > 100 && want.2 > 100_000);
    for samples in [1.0, 1e4, 1e6] {
        assert!(whole(samples) == want, "{samples}");
    }
}

mod memory;

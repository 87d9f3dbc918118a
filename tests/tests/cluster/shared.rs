//! Several sessions on one cluster at once: each has the picture that it has alone, what one finds out counts for all,
//! a sink hears of a frame's tiles, and a frame that nobody waits for any more ends on the nodes.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast::balance::{LoadBy, Settings, max_over_mean};
use brickcast::cluster::Dial;
use brickcast::embedded::{Backend, BackendChoice, EmbeddedNodes};
use brickcast::frame::{FinishedTile, FrameSink};
use brickcast::picture::Picture;
use brickcast::session::{Cluster, Frame, Session, StoreChoice};
use brickcast_proto::TileRect;
use brickcast_tests::turn;
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::scene::{
    Acceleration, Filter, Look, PixelSamples, Quality, Scene, SceneParts, Transport, ViewSpec,
};
use brickcast_volume::store::{PrepareOptions, Store, prepare};
use brickcast_volume::style::{Mode, Style};
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use brickcast_volume::{Camera, Orbit, PictureSize, Premul};
use tokio::runtime::Runtime;
use tokio::sync::Notify;

const LIMIT: Duration = Duration::from_secs(120);
const BUDGET: u64 = 1 << 28;

/// 128 x 64 x 64 voxels in bricks of 16, all of them shown: one half is full of material, in the other a speck in each
/// brick.
fn store(folder: &Path) -> Store {
    let (file, path) = (folder.join("part.nrrd"), folder.join("part"));
    let mut data = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 128 64 64\nencoding: raw\n\n".to_vec();
    for z in 0..64_usize {
        for y in 0..64_usize {
            for x in 0..128_usize {
                let noise = ((x * 7919 + y * 104_729 + z * 1_299_709) % 97) as u8;
                let is_speck = [x, y, z].iter().all(|v| (7..9).contains(&(v % 16)));
                data.push(match (x < 64, is_speck) {
                    (true, _) => 100 + noise,
                    (false, true) => 250,
                    (false, false) => 0,
                });
            }
        }
    }
    std::fs::write(&file, data).unwrap();
    let mut source = format::open(&file, &RawHints::default()).unwrap();
    let options = PrepareOptions { brick_size: 16, ..PrepareOptions::default() };
    prepare(source.as_mut(), &path, &options, &mut |_| {}).unwrap();
    Store::open(&path).unwrap()
}

/// In exact mode: the bits are the same whoever renders what. `from`: where the transfer function's window begins.
fn scene(store: &Store, from: f64, azimuth: f64) -> Scene {
    let manifest = store.manifest();
    let orbit = Orbit { azimuth, elevation: 15.0, ..Orbit::default() };
    let function = TransferFunction::window(from, 255.0, 0.05, Colormap::Viridis).unwrap();
    let camera = Camera::orbit(&manifest.geometry, orbit).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(300, 200).unwrap() };
    let acceleration = Acceleration { skip_empty: true, ..Acceleration::default() };
    let whole = Quality { early_termination: 1.0, exact: true, ..Quality::default() };
    let quality = Quality { step: 0.5, filter: Filter::Exact, acceleration, ..whole };
    Scene::new(Look::new(function, manifest.geometry.min_spacing()), view, quality).unwrap()
}

/// A frame that would take a minute and more.
fn endless(store: &Store) -> Scene {
    let size = PictureSize::new(3000, 2000).unwrap();
    let acceleration = Acceleration::default();
    let long = |s: &mut SceneParts| {
        s.view.size = size;
        (s.quality.step, s.quality.acceleration) = (0.02, acceleration);
    };
    scene(store, 50.0, 30.0).with(long).unwrap()
}

fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

async fn render(session: &mut Session, scene: &Scene) -> Frame {
    let frame = session.render(scene, Transport::F32, LIMIT).await.unwrap();
    assert!(frame.complete && frame.picture.pixels().iter().any(|p| p.a > 0.1), "{:?}", frame.problems);
    frame
}

struct Stage {
    _folder: tempfile::TempDir,
    store: Store,
    nodes: EmbeddedNodes,
}

impl Stage {
    async fn new(count: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path());
        let opened = Backend::open(BackendChoice::Cpu).unwrap();
        let nodes = EmbeddedNodes::start(&opened, count, &store.path(), BUDGET).await.unwrap();
        Self { _folder: folder, store, nodes }
    }

    async fn cluster(&self) -> Arc<Cluster> {
        let choice = StoreChoice::Hash(self.store.hash());
        Cluster::open(self.nodes.dial(), &self.nodes.addresses(), choice).await.unwrap()
    }

    /// What a session that has a cluster to itself gets.
    async fn alone(&self, scene: &Scene) -> Vec<[u32; 4]> {
        bits(&render(&mut self.cluster().await.session(), scene).await.picture)
    }
}

#[test]
#[tokio::main(flavor = "multi_thread")]
async fn sessions_with_other_looks_and_cameras_at_once_get_the_bits_that_each_gets_alone() {
    let _turn = turn(module_path!());
    const FRAMES: usize = 6;
    let stage = Stage::new(2).await;
    let scenes = [50.0, 120.0]
        .map(|from| (0..FRAMES).map(|i| scene(&stage.store, from, from + 25.0 * i as f64)).collect::<Vec<Scene>>());
    let mut want = Vec::new();
    for one in scenes.iter().flatten() {
        want.push(stage.alone(one).await);
    }
    assert!((1..want.len()).all(|i| want[i] != want[i - 1]), "other scenes, other pictures");
    let cluster = stage.cluster().await;
    cluster.balance(Settings { load_by: LoadBy::Samples, ..Settings::default() });
    let users = scenes.into_iter().map(|scenes| {
        let mut session = cluster.session();
        tokio::spawn(async move {
            session.load(&scenes[0]).await.unwrap();
            let mut frames = Vec::new();
            for scene in &scenes {
                let started = Instant::now();
                let frame = render(&mut session, scene).await;
                frames.push((bits(&frame.picture), started..Instant::now(), frame.stats.balance.is_some()));
            }
            frames
        })
    });
    let mut got = Vec::new();
    for user in users.collect::<Vec<_>>() {
        got.push(user.await.unwrap());
    }
    let meet = |(_, a, _): &(_, std::ops::Range<Instant>, _)| {
        got[1].iter().any(|(_, b, _)| a.start < b.end && b.start < a.end)
    };
    assert!(got[0].iter().any(meet), "no two frames were under way at once, so nothing is shown");
    for (i, ((got, _, is_balanced), want)) in got.iter().flatten().zip(&want).enumerate() {
        assert!(got == want, "frame {i} has other bits than alone");
        assert!(is_balanced);
    }
}

fn unevenness(frame: &Frame) -> f64 {
    max_over_mean(&frame.stats.nodes.iter().map(|n| n.cost).collect::<Vec<_>>())
}

/// The half that is full of material is one node's at first; whoever renders, it becomes both's.
#[test]
#[tokio::main(flavor = "multi_thread")]
async fn what_frames_of_one_session_cost_moves_chunks_for_the_other() {
    let _turn = turn(module_path!());
    const FRAMES: u64 = 25;
    let stage = Stage::new(2).await;
    let cluster = stage.cluster().await;
    cluster.balance(Settings { load_by: LoadBy::Samples, ..Settings::default() });
    let (mut one, mut other) = (cluster.session(), cluster.session());
    let (mine, theirs) = (scene(&stage.store, 50.0, 30.0), scene(&stage.store, 60.0, 35.0));
    one.load(&mine).await.unwrap();
    other.load(&theirs).await.unwrap();
    let before = render(&mut other, &theirs).await;
    assert!(unevenness(&before) > 1.4, "{}", unevenness(&before));
    for i in 0..FRAMES {
        let mut scene = mine.clone();
        let camera = self::scene(&stage.store, 50.0, 30.0 + i as f64).view.camera;
        scene = scene.seen_by(camera);
        render(&mut one, &scene).await;
    }
    let after = render(&mut other, &theirs).await;
    let balance = after.stats.balance.as_ref().unwrap();
    eprintln!("{:.2}, then {:.2}; {:?}", unevenness(&before), unevenness(&after), balance.report);
    assert_eq!(balance.report.frame, FRAMES + 2, "one balancer has seen all frames");
    assert!(unevenness(&after) < 1.15, "{}", unevenness(&after));
    assert!(bits(&after.picture) == bits(&before.picture));
    // What one user's session learnt is the cluster's: it stays when he goes.
    drop(one);
    assert_eq!(render(&mut other, &theirs).await.stats.balance.unwrap().report.frame, FRAMES + 3);
}

/// What a sink heard, in its order.
#[derive(Default)]
struct Heard {
    tiles: Vec<FinishedTile>,
    progress: Vec<(u32, u32)>,
    shows: Arc<Notify>,
    began: Option<Instant>,
    /// How long after that a tile showed something.
    first: Option<Duration>,
}

impl FrameSink for Heard {
    fn tile(&mut self, tile: FinishedTile) {
        if tile.pixels.is_some() {
            self.shows.notify_one();
            self.first = self.first.or(self.began.map(|began| began.elapsed()));
        }
        self.tiles.push(tile);
    }

    fn progress(&mut self, finished: u32, of: u32) {
        self.progress.push((finished, of));
    }
}

#[test]
#[tokio::main(flavor = "multi_thread")]
async fn a_sink_hears_every_tile_once_and_together_they_are_the_picture() {
    let _turn = turn(module_path!());
    let stage = Stage::new(3).await;
    let mut session = stage.cluster().await.session();
    let exact = scene(&stage.store, 50.0, 30.0);
    let maximum = Style { mode: Mode::Maximum, ..Style::default() };
    let scenes = [
        (exact.clone(), Transport::F32),
        (exact.with(|s| (s.quality.exact, s.quality.filter) = (false, Filter::Hardware)).unwrap(), Transport::F16),
        (exact.with(|s| s.quality.samples = PixelSamples::Four).unwrap(), Transport::F32),
        (exact.with(|s| s.quality.samples = PixelSamples::Nine).unwrap(), Transport::F32),
        (exact.with(|s| s.look.style = maximum).unwrap(), Transport::F32),
    ];
    for (scene, transport) in scenes {
        let mut heard = Heard { began: Some(Instant::now()), ..Heard::default() };
        let frame = session.render_into(&scene, transport, LIMIT, &mut heard).await.unwrap();
        let (first, whole) = (heard.first.unwrap(), heard.began.unwrap().elapsed());
        eprintln!("the first tile that shows something came after {first:?}, the picture after {whole:?}");
        assert!(frame.complete && frame.stats.faults.reissued == 0, "{:?}", frame.problems);
        let all = TileRect::of_picture(scene.view.size);
        let mut tiles: Vec<[u32; 2]> = heard.tiles.iter().map(|t| t.tile).collect();
        tiles.sort_unstable_by_key(|[x, y]| [*y, *x]);
        assert_eq!(tiles, all.tiles().collect::<Vec<_>>(), "each once");
        assert_eq!(heard.progress, (1..=all.count()).map(|i| (i, all.count())).collect::<Vec<_>>());
        // Over something else, so that clear tiles are seen to be drawn.
        let grey = vec![Premul::from_array([0.5; 4]); scene.view.size.pixel_count()];
        let mut picture = Picture::new(scene.view.size, grey).unwrap();
        heard.tiles.iter().for_each(|tile| tile.draw(&mut picture));
        assert!(bits(&picture) == bits(&frame.picture), "{:?}, {transport:?}", scene.look.style.mode);
        assert!(heard.tiles.iter().any(|t| t.pixels.is_some()) && heard.tiles.iter().any(|t| t.pixels.is_none()));
    }
}

/// Nodes on a runtime of their own, which can end in the middle of anything; and a cluster on them and on those of the
/// stage.
async fn with_mortal_node(stage: &Stage) -> (Runtime, EmbeddedNodes, Arc<Cluster>) {
    let runtime = Runtime::new().unwrap();
    let (opened, path) = (Backend::open(BackendChoice::Cpu).unwrap(), stage.store.path());
    let start = async move { EmbeddedNodes::start(&opened, 1, &path, BUDGET).await.unwrap() };
    let mortal = runtime.spawn(start).await.unwrap();
    let (ours, theirs, their_address) = (stage.nodes.dial(), mortal.dial(), mortal.addresses().remove(0));
    let dial = Dial::through(move |target| match target.address == their_address {
        true => theirs.connect(target),
        false => ours.connect(target),
    });
    let addresses = [stage.nodes.addresses(), mortal.addresses()].concat();
    let cluster = Cluster::open(dial, &addresses, StoreChoice::Hash(stage.store.hash())).await.unwrap();
    (runtime, mortal, cluster)
}

#[test]
#[tokio::main(flavor = "multi_thread")]
async fn a_node_that_dies_in_one_sessions_frame_is_gone_for_the_other() {
    let _turn = turn(module_path!());
    let stage = Stage::new(1).await;
    let (runtime, mortal, cluster) = with_mortal_node(&stage).await;
    let (mut one, mut other) = (cluster.session(), cluster.session());
    let theirs = scene(&stage.store, 120.0, 200.0);
    let want = stage.alone(&theirs).await;
    let before = render(&mut other, &theirs).await;
    assert_eq!(before.stats.nodes.len(), 2);
    let size = PictureSize::new(1200, 900).unwrap();
    let large = scene(&stage.store, 50.0, 30.0).with(|s| (s.view.size, s.quality.step) = (size, 0.1)).unwrap();
    let want_large = stage.alone(&large).await;
    let mut heard = Heard::default();
    let shows = heard.shows.clone();
    // With its first tile, when it owes all others.
    let dies = async {
        shows.notified().await;
        runtime.shutdown_background();
    };
    let (frame, ()) = tokio::join!(one.render_into(&large, Transport::F32, LIMIT, &mut heard), dies);
    let frame = frame.unwrap();
    let faults = &frame.stats.faults;
    assert!(frame.complete && faults.lost.len() == 1 && faults.reissued > 0, "{faults:?}");
    assert_eq!(faults.lost[0].address, mortal.addresses()[0]);
    // Tiles came again where they were void; what was said last is the picture.
    let mut picture = Picture::new(large.view.size, vec![Premul::CLEAR; large.view.size.pixel_count()]).unwrap();
    heard.tiles.iter().for_each(|tile| tile.draw(&mut picture));
    assert!(bits(&picture) == bits(&frame.picture) && bits(&picture) == want_large);
    assert_eq!(cluster.members().len(), 1);
    let after = render(&mut other, &theirs).await;
    let known = &after.stats.faults;
    assert!(known.lost.is_empty() && known.reissued == 0 && known.epoch > faults.epoch, "{known:?} after {faults:?}");
    assert_eq!(after.stats.nodes.len(), 1);
    assert!(bits(&before.picture) == want && bits(&after.picture) == want);
}

/// Law 3 of the protocol, of several sessions: the table is another for the frames that begin after the change, and for
/// no other.
#[test]
#[tokio::main(flavor = "multi_thread")]
async fn a_frame_ends_with_the_epoch_that_it_began_with() {
    let _turn = turn(module_path!());
    let stage = Stage::new(2).await;
    let cluster = stage.cluster().await;
    let (mut one, mut other) = (cluster.session(), cluster.session());
    let (small, large) = (scene(&stage.store, 120.0, 200.0), scene(&stage.store, 50.0, 30.0));
    let large = large.with(|s| s.view.size = PictureSize::new(900, 600).unwrap()).unwrap();
    let (want_small, want_large) = (stage.alone(&small).await, stage.alone(&large).await);
    let first = render(&mut one, &small).await.stats.faults.epoch;
    let mut heard = Heard::default();
    let shows = heard.shows.clone();
    let changes = async {
        shows.notified().await;
        let began = Instant::now();
        cluster.session().assign(brickcast::plan::Assignment::explicit(Vec::new().into(), 0));
        (render(&mut other, &small).await, began)
    };
    let (frame, (later, began)) = tokio::join!(
        async { (one.render_into(&large, Transport::F32, LIMIT, &mut heard).await.unwrap(), Instant::now()) },
        changes
    );
    let (frame, ended) = frame;
    assert!(began < ended, "it was under way when the table changed");
    assert_eq!((frame.stats.faults.epoch, later.stats.faults.epoch), (first, first + 1));
    assert!(frame.complete && frame.stats.faults.reissued == 0 && frame.stats.faults.lost.is_empty());
    assert!(bits(&frame.picture) == want_large && bits(&later.picture) == want_small);
    assert_eq!(render(&mut one, &small).await.stats.faults.epoch, first + 1);
}

#[test]
#[tokio::main(flavor = "multi_thread")]
async fn a_dropped_frame_ends_on_the_nodes_and_the_next_one_is_right() {
    let _turn = turn(module_path!());
    let stage = Stage::new(2).await;
    let cluster = stage.cluster().await;
    let mut session = cluster.session();
    let (small, endless) = (scene(&stage.store, 50.0, 30.0), endless(&stage.store));
    let want = stage.alone(&small).await;
    session.load(&endless).await.unwrap();
    let mut idle_after = Vec::new();
    for _ in 0..3 {
        let frame = session.render(&endless, Transport::F32, LIMIT);
        assert!(tokio::time::timeout(Duration::from_millis(700), frame).await.is_err(), "it should still be under way");
        let dropped = Instant::now();
        // Takes the turn that the frame had, on each node.
        session.load(&small).await.unwrap();
        idle_after.push(dropped.elapsed());
        let next = render(&mut session, &small).await;
        assert!(bits(&next.picture) == want && next.stats.faults.lost.is_empty());
    }
    eprintln!("nodes were idle {idle_after:?} after a frame was dropped");
    // The quickest tells of the nodes, the others of the machine, too.
    assert!(idle_after.iter().min().unwrap() < &Duration::from_secs(1), "{idle_after:?}");
    assert!(idle_after.iter().max().unwrap() < &Duration::from_secs(10), "{idle_after:?}");
}

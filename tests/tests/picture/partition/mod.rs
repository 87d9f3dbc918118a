//! The same picture from any number of nodes: partitions in process, over real loopback gRPC.

mod memory;

use std::path::{Path, PathBuf};
use std::time::Duration;

use brickcast::embedded::{Backend, BackendChoice, EmbeddedNodes};
use brickcast::plan::{Assignment, Share};
use brickcast::session::{Frame, Session, StoreChoice};
use brickcast_harness::leave_out;
use brickcast_volume::camera::{Camera, Orbit, Projection};
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::scene::{Acceleration, Filter, Leap, Look, Quality, Scene, SceneParts, Transport, ViewSpec};
use brickcast_volume::store::{PrepareOptions, Store, prepare};
use brickcast_volume::style::{Clip, ClipPlane, Integration, Isosurface, Mode, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{ChunkId, MergeTree, PictureSize};
use glam::DVec3;

const DIMS: [usize; 3] = [130, 117, 101];

/// Something everywhere, different along every axis, with a hard edge inside: no node has nothing to show.
fn volume_file(folder: &Path) -> PathBuf {
    let path = folder.join("field.nrrd");
    let mut data = format!(
        "NRRD0004\ntype: uint16\ndimension: 3\nsizes: {} {} {}\nspacings: 1 1.25 0.8\nencoding: raw\nendian: \
         little\n\n",
        DIMS[0], DIMS[1], DIMS[2]
    )
    .into_bytes();
    for z in 0..DIMS[2] {
        for y in 0..DIMS[1] {
            for x in 0..DIMS[0] {
                let smooth = (x as f64 * 0.07).sin() + (y as f64 * 0.05).cos() + (z as f64 * 0.09).sin();
                let edge = if x > 40 && y > 30 && z > 20 && x < 50 { 9000.0 } else { 0.0 };
                let value = 20_000.0 + smooth * 6000.0 + edge + (x + 2 * y + 3 * z) as f64;
                data.extend((value as u16).to_le_bytes());
            }
        }
    }
    std::fs::write(&path, data).unwrap();
    path
}

fn store(folder: &Path, input: &Path, brick_size: u32) -> Store {
    let target = folder.join(format!("field-{brick_size}"));
    let mut source = format::open(input, &RawHints::default()).unwrap();
    let options = PrepareOptions { brick_size, ..PrepareOptions::default() };
    prepare(source.as_mut(), &target, &options, &mut |_| {}).unwrap();
    Store::open(&target).unwrap()
}

fn scene(store: &Store, camera: Camera, size: (u32, u32), exact: bool) -> Scene {
    let (lo, hi) = store.manifest().range;
    let at = |t: f64| lo + (hi - lo) * t;
    let function = TransferFunction::new(
        vec![
            ColorPoint { x: at(0.0), rgb: [0.9, 0.2, 0.1] },
            ColorPoint { x: at(0.5), rgb: [0.2, 0.9, 0.3] },
            ColorPoint { x: at(1.0), rgb: [0.1, 0.3, 1.0] },
        ],
        vec![OpacityPoint { x: at(0.0), opacity: 0.004 }, OpacityPoint { x: at(1.0), opacity: 0.03 }],
    );
    let look = Look::new(function.unwrap(), store.manifest().geometry.min_spacing());
    let view = ViewSpec { camera, size: PictureSize::new(size.0, size.1).unwrap() };
    Scene::new(look, view, Quality { exact, ..Quality::default() }).unwrap()
}

/// Outside, eye on a brick face with a ray plane inside it, eye inside, parallel along an axis, close to a corner.
fn cameras(store: &Store) -> Vec<(&'static str, Camera)> {
    let g = store.manifest().geometry;
    let perspective = Projection::Perspective { view_angle: 40.0 };
    let face = g.world_from_voxel(DVec3::new(64.0, 64.0, 64.0));
    let above_face = g.world_from_voxel(DVec3::new(64.0, 40.0, 300.0));
    let at_face = g.world_from_voxel(DVec3::new(64.0, 40.0, 50.0));
    let camera = |p, f, projection| Camera::new(p, f, DVec3::Y, projection).unwrap();
    vec![
        ("oblique", Camera::orbit(&g, Orbit { azimuth: 37.0, elevation: 21.0, ..Orbit::default() }).unwrap()),
        ("eye_on_a_brick_corner", camera(face, g.center_world() + DVec3::new(3.0, -20.0, -9.0), perspective)),
        ("rays_inside_a_face", camera(above_face, at_face, perspective)),
        (
            "eye_inside",
            camera(g.center_world() + DVec3::new(7.3, 2.1, 5.5), g.world_from_voxel(DVec3::ZERO), perspective),
        ),
        ("parallel_along_an_axis", camera(above_face, at_face, Projection::Parallel { parallel_scale: 70.0 })),
    ]
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap()
}

fn kernels() -> Vec<Backend> {
    let mut kernels = vec![Backend::open(BackendChoice::Cpu).unwrap()];
    match Backend::open(BackendChoice::Gpu) {
        Ok(gpu) => kernels.push(gpu),
        Err(error) => leave_out(format_args!("no GPU kernel: {error}")),
    }
    kernels
}

async fn render(session: &mut Session, scene: &Scene, transport: Transport) -> Frame {
    let frame = session.render(scene, transport, Duration::from_secs(60)).await.unwrap();
    assert!(frame.complete, "{:?}", frame.problems);
    frame
}

fn bits(frame: &Frame) -> Vec<[u32; 4]> {
    frame.picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

fn worst(a: &Frame, b: &Frame) -> f32 {
    let pairs = a.picture.pixels().iter().zip(b.picture.pixels());
    pairs.flat_map(|(p, q)| (0..4).map(move |c| (p.to_array()[c] - q.to_array()[c]).abs())).fold(0.0, f32::max)
}

#[test]
fn the_same_bits_from_any_number_of_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let input = volume_file(folder.path());
    runtime().block_on(async {
        for kernel in kernels() {
            for brick_size in [16, 32, 64] {
                let path = folder.path().join(format!("field-{brick_size}"));
                let store =
                    if path.is_dir() { Store::open(&path).unwrap() } else { store(folder.path(), &input, brick_size) };
                let cameras = cameras(&store);
                let mut expected: Vec<Vec<[u32; 4]>> = Vec::new();
                let mut expected_shared = None;
                for count in [1, 2, 3, 8] {
                    let nodes = EmbeddedNodes::start(&kernel, count, &store.path(), 1 << 30).await.unwrap();
                    let mut session =
                        Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash()))
                            .await
                            .unwrap();
                    for (i, (name, camera)) in cameras.iter().enumerate() {
                        let scene = scene(&store, *camera, (67, 53), true);
                        let frame = render(&mut session, &scene, Transport::F32).await;
                        assert!(frame.picture.pixels().iter().any(|p| p.a > 0.3), "{name}: nothing to see");
                        if *name == "oblique" {
                            for node in &frame.stats.nodes {
                                assert!(
                                    node.layers > 0 && node.samples > 0,
                                    "{count} nodes: {node:?} contributed nothing"
                                );
                            }
                        }
                        match expected.get(i) {
                            None => expected.push(bits(&frame)),
                            Some(one) => assert!(*one == bits(&frame), "{name}: {count} nodes, bricks of {brick_size}"),
                        }
                    }
                    // Not only compact shares: chunks dealt out like cards.
                    let chunks: Vec<ChunkId> = MergeTree::of(store.manifest().grid).chunk_ids().collect();
                    let scattered = chunks.iter().map(|c| c.index() * 7 % 5 % count).collect();
                    session.assign(Assignment::explicit(scattered, count));
                    let frame =
                        render(&mut session, &scene(&store, cameras[0].1, (67, 53), true), Transport::F32).await;
                    assert!(expected[0] == bits(&frame), "scattered: {count} nodes, bricks of {brick_size}");
                    // Nor only whole ones: the strips of tiles of every second chunk dealt out to all nodes.
                    let strips = |n: usize| [n as u32, if n + 1 == count { u32::MAX } else { n as u32 + 1 }];
                    let shares: Vec<Share> = (0..count).map(|n| (n, strips(n))).collect();
                    let shared = chunks.iter().step_by(2).map(|c| (*c, shares.clone())).collect();
                    session.assign(Assignment::explicit(vec![0; chunks.len()].into(), count).sharing(shared));
                    let scene = scene(&store, cameras[0].1, (167, 143), true);
                    let frame = render(&mut session, &scene, Transport::F32).await;
                    let busy = frame.stats.nodes.iter().filter(|n| n.layers > 0).count();
                    // Chunks have two strips of this picture, or three.
                    assert!(busy >= count.min(2), "{busy} of {count} nodes have a strip");
                    let one = expected_shared.get_or_insert_with(|| bits(&frame));
                    assert!(*one == bits(&frame), "shared: {count} nodes, bricks of {brick_size}");
                }
            }
        }
    });
}

/// A mirrored, rotated volume is the same from any number of nodes, too: each node takes the directions from its store.
#[test]
fn a_mirrored_and_rotated_volume_has_the_same_bits_from_any_number_of_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let input = volume_file(folder.path());
    let mut data = std::fs::read(&input).unwrap();
    let old = b"spacings: 1 1.25 0.8\n";
    let at = data.windows(old.len()).position(|w| w == old).unwrap();
    let new = "space: RAS\nspace directions: (0.6,0.8,0) (1,-0.75,0) (0,0,0.8)\nspace origin: (3,-5,70)\n";
    data.splice(at..at + old.len(), new.bytes());
    std::fs::write(&input, data).unwrap();
    let store = store(folder.path(), &input, 32);
    assert!(store.manifest().geometry.is_mirrored());
    runtime().block_on(async {
        for kernel in kernels() {
            let mut expected: Vec<Vec<[u32; 4]>> = Vec::new();
            for count in [1, 2, 3, 8] {
                let nodes = EmbeddedNodes::start(&kernel, count, &store.path(), 1 << 30).await.unwrap();
                let choice = StoreChoice::Hash(store.hash());
                let mut session = Session::open_through(nodes.dial(), &nodes.addresses(), choice).await.unwrap();
                let mut seen = 0;
                for (camera_name, camera) in cameras(&store) {
                    for (name, style) in styles(&store).into_iter().take(2).chain([("plain", Style::default())]) {
                        let coarse = |s: &mut SceneParts| (s.look.style, s.quality.step) = (style, 1.0);
                        let scene = scene(&store, camera, (67, 53), true).with(coarse).unwrap();
                        let frame = render(&mut session, &scene, Transport::F32).await;
                        assert!(frame.picture.pixels().iter().any(|p| p.a > 0.01), "{camera_name}, {name}: nothing");
                        match expected.get(seen) {
                            None => expected.push(bits(&frame)),
                            Some(one) => assert!(*one == bits(&frame), "{camera_name}, {name}: {count} nodes"),
                        }
                        seen += 1;
                    }
                }
            }
        }
    });
}

/// The style whose values are read by `--filter nearest`.
const LABELS: &str = "labels";

/// Slabs, light, isosurfaces, clips and projections, whoever renders what.
fn styles(store: &Store) -> Vec<(&'static str, Style)> {
    let (lo, hi) = store.manifest().range;
    let surface = |share: f64, opacity| Isosurface { value: lo + (hi - lo) * share, color: [0.9, 0.5, 0.2], opacity };
    let center = store.manifest().geometry.center_world();
    let normal = DVec3::new(0.2, -0.5, -0.9);
    let everything = Style {
        integration: Integration::Preintegrated(TableSize::N256),
        shading: Some(Phong { light: Some(DVec3::new(1.0, 2.0, 3.0)), ..Phong::default() }),
        surfaces: vec![surface(0.45, 0.3), surface(0.6, 0.4)],
        mode: Mode::Composite,
        clip: Clip { bounds: None, planes: vec![ClipPlane { normal, offset: normal.dot(center) - 17.3 }] },
    };
    let clip = everything.clip.clone();
    vec![
        ("slabs", Style { integration: Integration::Preintegrated(TableSize::N1024), ..Style::default() }),
        ("lit cut", Style { surfaces: Vec::new(), ..everything.clone() }),
        ("everything", everything),
        (LABELS, Style { clip: clip.clone(), ..Style::default() }),
        ("maximum", Style { mode: Mode::Maximum, clip: clip.clone(), ..Style::default() }),
        ("average", Style { mode: Mode::Average, clip, ..Style::default() }),
    ]
}

#[test]
fn styles_have_the_same_bits_from_any_number_of_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let input = volume_file(folder.path());
    let store = store(folder.path(), &input, 32);
    let skips = Acceleration { skip_empty: true, ..Acceleration::default() };
    runtime().block_on(async {
        for kernel in kernels() {
            let mut expected: Vec<Vec<[u32; 4]>> = Vec::new();
            for count in [1, 2, 3, 8] {
                let nodes = EmbeddedNodes::start(&kernel, count, &store.path(), 1 << 30).await.unwrap();
                let choice = StoreChoice::Hash(store.hash());
                let mut session = Session::open_through(nodes.dial(), &nodes.addresses(), choice).await.unwrap();
                let mut seen = 0;
                for (camera_name, camera) in cameras(&store).into_iter().take(4) {
                    for (name, style) in styles(&store) {
                        let plain = scene(&store, camera, (67, 53), true);
                        let filter = if name == LABELS { Filter::Nearest } else { plain.quality.filter };
                        let styled = |s: &mut SceneParts| {
                            (s.look.style, s.quality.filter) = (style, filter);
                            (s.quality.acceleration, s.quality.step) = (skips, 1.0);
                        };
                        let scene = plain.with(styled).unwrap();
                        let frame = render(&mut session, &scene, Transport::F32).await;
                        assert!(frame.picture.pixels().iter().any(|p| p.a > 0.01), "{camera_name}, {name}: nothing");
                        match expected.get(seen) {
                            None => expected.push(bits(&frame)),
                            Some(one) => assert!(*one == bits(&frame), "{camera_name}, {name}: {count} nodes"),
                        }
                        seen += 1;
                    }
                }
            }
        }
    });
}

/// Every sample has one owner, on either kernel: rays along z in steps of a tenth of a voxel meet every brick face with
/// a sample that f32 places a hair before or behind it. A kernel that adds up t instead of multiplying counts such
/// samples twice or never, for whole pictures of rays, and by another number in other bricks.
#[test]
fn samples_on_faces_are_counted_once_in_any_bricks() {
    let folder = tempfile::tempdir().unwrap();
    let input = volume_file(folder.path());
    runtime().block_on(async {
        for kernel in kernels() {
            for eye_z in [300.0, 300.3, 211.7] {
                let mut first = None;
                for brick_size in [16, 32, 64] {
                    let path = folder.path().join(format!("field-{brick_size}"));
                    let store = if path.is_dir() {
                        Store::open(&path).unwrap()
                    } else {
                        store(folder.path(), &input, brick_size)
                    };
                    let at = |z| store.manifest().geometry.world_from_voxel(DVec3::new(64.3, 57.1, z));
                    let parallel = Projection::Parallel { parallel_scale: 60.0 };
                    let camera = Camera::new(at(eye_z), at(50.0), DVec3::Y, parallel).unwrap();
                    let fine = |s: &mut SceneParts| (s.quality.step, s.quality.early_termination) = (0.1, 1.0);
                    let scene = scene(&store, camera, (41, 37), true).with(fine).unwrap();
                    let nodes = EmbeddedNodes::start(&kernel, 2, &store.path(), 1 << 30).await.unwrap();
                    let mut session =
                        Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash()))
                            .await
                            .unwrap();
                    let samples = render(&mut session, &scene, Transport::F32).await.stats.samples;
                    let what = format!("{:?}: eye at {eye_z}, bricks of {brick_size}", kernel.describe());
                    assert!(samples > 500_000, "{what}: {samples}");
                    assert_eq!(*first.get_or_insert(samples), samples, "{what}");
                }
            }
        }
    });
}

#[test]
fn brick_size_transport_and_mode_change_less_than_one_step_of_eight_bits() {
    let folder = tempfile::tempdir().unwrap();
    let input = volume_file(folder.path());
    runtime().block_on(async {
        for kernel in kernels() {
            let mut reference: Option<Frame> = None;
            for brick_size in [16, 32, 64] {
                let path = folder.path().join(format!("field-{brick_size}"));
                let store =
                    if path.is_dir() { Store::open(&path).unwrap() } else { store(folder.path(), &input, brick_size) };
                for count in [1, 3] {
                    let nodes = EmbeddedNodes::start(&kernel, count, &store.path(), 1 << 30).await.unwrap();
                    let mut session =
                        Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash()))
                            .await
                            .unwrap();
                    for (exact, transport) in [(true, Transport::F32), (false, Transport::F32), (false, Transport::F16)]
                    {
                        let scene = scene(&store, cameras(&store)[0].1, (97, 89), exact);
                        let frame = render(&mut session, &scene, transport).await;
                        let one = reference.get_or_insert_with(|| Frame { ..copy(&frame) });
                        let difference = worst(one, &frame);
                        assert!(
                            difference <= 1.0 / 255.0,
                            "bricks of {brick_size}, {count} nodes, exact {exact}, {transport:?}: {difference}"
                        );
                    }
                }
            }
        }
    });
}

fn copy(frame: &Frame) -> Frame {
    Frame {
        picture: frame.picture.clone(),
        complete: frame.complete,
        problems: Vec::new(),
        lacking: Vec::new(),
        missing_tiles: Vec::new(),
        hidden: None,
        stats: frame.stats.clone(),
    }
}

#[test]
fn odd_image_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let input = volume_file(folder.path());
    let store = store(folder.path(), &input, 32);
    runtime().block_on(async {
        for kernel in kernels() {
            for size in [(1, 1), (17, 5), (127, 61), (64, 64), (65, 129)] {
                let mut first = None;
                for count in [1, 3] {
                    let nodes = EmbeddedNodes::start(&kernel, count, &store.path(), 1 << 30).await.unwrap();
                    let mut session =
                        Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash()))
                            .await
                            .unwrap();
                    let scene = scene(&store, cameras(&store)[0].1, size, true);
                    let frame = render(&mut session, &scene, Transport::F32).await;
                    assert_eq!(frame.picture.pixels().len(), (size.0 * size.1) as usize);
                    let got = bits(&frame);
                    assert!(*first.get_or_insert_with(|| got.clone()) == got, "{size:?} on {count} nodes");
                }
            }
        }
    });
}

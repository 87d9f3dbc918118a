//! Levels of detail: a level's picture is that of its array, several levels join to one picture whoever renders what of
//! it, and no step loses or doubles opacity.

use std::path::Path;
use std::time::Duration;

use crate::rig::{bits, runtime, worst};
use brickcast::embedded::{Backend, BackendChoice, EmbeddedNodes};
use brickcast::plan::Assignment;
use brickcast::session::levels::LevelSessions;
use brickcast::session::{Frame, Session, StoreChoice};
use brickcast_volume::format::{FormatError, SourceHeader, VolumeSource, VoxelType};
use brickcast_volume::lod::Rule;
use brickcast_volume::scene::{Acceleration, Filter, Look, Quality, Scene, SceneParts, Transport, ViewSpec};
use brickcast_volume::store::{PrepareOptions, RegionOptions, Segmentation, Store, prepare};
use brickcast_volume::style::{Clip, ClipPlane, Integration, Isosurface, Mode, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{Camera, Geometry, Orbit, PictureSize, Projection};
use glam::{DVec3, UVec3};

const DIMS: [u32; 3] = [149, 117, 101];

/// Voxels of 16 bits.
struct Voxels {
    header: SourceHeader,
    voxels: Vec<u16>,
    next: u32,
}

impl std::fmt::Debug for Voxels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.header.fmt(f)
    }
}

impl Voxels {
    fn new(geometry: Geometry, voxels: Vec<u16>) -> Self {
        Self { header: SourceHeader::new("test", geometry, VoxelType::U16), voxels, next: 0 }
    }
}

impl VolumeSource for Voxels {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.next = 0;
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let dims = self.header.geometry.dims();
        let end = (self.next + count).min(dims.z);
        let plane = (dims.x * dims.y) as usize;
        planes.clear();
        planes.extend(
            self.voxels[self.next as usize * plane..end as usize * plane].iter().flat_map(|voxel| voxel.to_le_bytes()),
        );
        self.next = end;
        Ok(())
    }
}

fn finest() -> Geometry {
    Geometry::new(DIMS, [1.0, 1.25, 0.75], [3.0, -5.0, 0.5]).unwrap()
}

/// Detail everywhere: nothing that a coarser level would not change.
fn field() -> Vec<u16> {
    let [nx, ny, nz] = DIMS;
    let voxel = |x: u32, y: u32, z: u32| {
        let smooth = (f64::from(x) * 0.11).sin() + (f64::from(y) * 0.09).cos() + (f64::from(z) * 0.13).sin();
        let edge = if x > 40 && y > 30 && z > 20 && x < 52 { 9000.0 } else { 0.0 };
        let grain = f64::from((x * 7919 + y * 104_729 + z * 1_299_709) % 97) * 20.0;
        (20_000.0 + smooth * 5000.0 + edge + grain) as u16
    };
    let row = |y, z| (0..nx).map(move |x| voxel(x, y, z));
    (0..nz).flat_map(|z| (0..ny).flat_map(move |y| row(y, z))).collect()
}

pub(crate) fn made(
    folder: &Path,
    name: &str,
    (geometry, voxels): (Geometry, Vec<u16>),
    options: &PrepareOptions,
) -> Store {
    let target = folder.join(name);
    prepare(&mut Voxels::new(geometry, voxels), &target, options, &mut |_| {}).unwrap();
    Store::open(&target).unwrap()
}

pub(crate) fn store(folder: &Path, brick_size: u32) -> Store {
    let options = PrepareOptions { brick_size, ..PrepareOptions::default() };
    made(folder, &format!("field-{brick_size}"), (finest(), field()), &options)
}

pub(crate) fn scene(store: &Store, style: Style) -> Scene {
    let (lo, hi) = store.manifest().range;
    let at = |t: f64| lo + (hi - lo) * t;
    let colors = [(0.0, [0.9, 0.2, 0.1]), (0.5, [0.2, 0.9, 0.3]), (1.0, [0.1, 0.3, 1.0])];
    let colors = colors.map(|(t, rgb)| ColorPoint { x: at(t), rgb }).to_vec();
    let opacities = [(0.0, 0.001), (0.4, 0.004), (1.0, 0.05)];
    let opacities = opacities.map(|(t, opacity)| OpacityPoint { x: at(t), opacity }).to_vec();
    let function = TransferFunction::new(colors, opacities).unwrap();
    let look = Look { style, ..Look::new(function, store.manifest().geometry.min_spacing()) };
    let orbit = Orbit { azimuth: 37.0, elevation: 21.0, zoom: 1.6, ..Orbit::default() };
    let camera = Camera::orbit(&store.manifest().geometry, orbit).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(97, 73).unwrap() };
    let acceleration = Acceleration { skip_empty: true, ..Acceleration::default() };
    Scene::new(look, view, Quality { exact: true, acceleration, ..Quality::default() }).unwrap()
}

pub(crate) fn styles(store: &Store) -> Vec<(&'static str, Style)> {
    let (lo, hi) = store.manifest().range;
    let surface = |share: f64, opacity| Isosurface { value: lo + (hi - lo) * share, color: [0.9, 0.5, 0.2], opacity };
    let center = store.manifest().geometry.center_world();
    let normal = DVec3::new(0.2, -0.5, -0.9);
    let clip = Clip { bounds: None, planes: vec![ClipPlane { normal, offset: normal.dot(center) - 17.3 }] };
    let slabs = Style { integration: Integration::Preintegrated(TableSize::N256), ..Style::default() };
    let surfaces = vec![surface(0.45, 0.3), surface(0.7, 0.4)];
    // Else it follows from the noise, which a level takes from the volume, and a volume of its array from itself.
    let phong = Phong { light_from: Some(300.0), ..Phong::default() };
    vec![
        ("samples", Style::default()),
        ("slabs", slabs.clone()),
        ("lit surfaces", Style { shading: Some(phong), surfaces, clip: clip.clone(), ..slabs }),
        ("maximum", Style { mode: Mode::Maximum, clip: clip.clone(), ..Style::default() }),
        ("mean", Style { mode: Mode::Average, clip, ..Style::default() }),
    ]
}

/// Nodes inside this process; they stop with it.
pub(crate) async fn nodes(store: &Store, count: usize) -> (Session, EmbeddedNodes) {
    nodes_by(&Backend::open(BackendChoice::Cpu).unwrap(), store, count).await
}

pub(crate) async fn nodes_by(kernel: &Backend, store: &Store, count: usize) -> (Session, EmbeddedNodes) {
    let nodes = EmbeddedNodes::start(kernel, count, &store.path(), 1 << 30).await.unwrap();
    let choice = StoreChoice::Hash(store.hash());
    (Session::open_through(nodes.dial(), &nodes.addresses(), choice).await.unwrap(), nodes)
}

const LIMIT: Duration = Duration::from_secs(120);

pub(crate) async fn alone(session: &mut Session, scene: &Scene) -> Frame {
    complete(session.render(scene, Transport::F32, LIMIT).await.unwrap())
}

pub(crate) async fn mixed(levels: &mut LevelSessions, scene: &Scene, rule: Rule) -> Frame {
    let selection = levels.select(scene, rule).unwrap();
    complete(levels.render(scene, &selection, Transport::F32, LIMIT).await.unwrap())
}

fn complete(frame: Frame) -> Frame {
    assert!(frame.complete && frame.problems.is_empty(), "{:?}", frame.problems);
    frame
}

/// The array of a level as the definition has it: means of the finest voxels that there are, rounded half up.
fn array(level: u8) -> (Geometry, Vec<u16>) {
    let (dims, edge) = (UVec3::from(DIMS), 1_u32 << level);
    let voxels = field();
    let coarse = dims.map(|n| n.div_ceil(edge));
    let mean = |at: UVec3| {
        let (lo, hi) = (at * edge, (at * edge + edge).min(dims));
        let (mut sum, mut count) = (0_u64, 0_u64);
        for z in lo.z..hi.z {
            for y in lo.y..hi.y {
                for x in lo.x..hi.x {
                    sum += u64::from(voxels[((z * dims.y + y) * dims.x + x) as usize]);
                    count += 1;
                }
            }
        }
        ((2 * sum + count) / (2 * count)) as u16
    };
    let row = |y, z| (0..coarse.x).map(move |x| mean(UVec3::new(x, y, z))).collect::<Vec<_>>();
    let all = (0..coarse.z).flat_map(|z| (0..coarse.y).map(move |y| (y, z))).flat_map(|(y, z)| row(y, z)).collect();
    let (fine, scale) = (finest(), f64::from(edge));
    let origin = fine.origin() + fine.spacing() * ((scale - 1.0) / 2.0);
    let geometry = Geometry::new(coarse.to_array(), (fine.spacing() * scale).to_array(), origin.to_array());
    (geometry.unwrap(), all)
}

#[test]
fn a_level_is_drawn_as_a_volume_of_its_array() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 16);
    runtime().block_on(async {
        let (root, _nodes) = nodes(&store, 2).await;
        for level in 1..=3 {
            let options =
                PrepareOptions { brick_size: 16, range: Some(store.manifest().range), ..PrepareOptions::default() };
            let by_hand = made(folder.path(), &format!("by-hand-{level}"), array(level), &options);
            let mut of_level = root.at_level(level).await.unwrap();
            let (mut of_array, _others) = nodes(&by_hand, 1).await;
            for (name, style) in styles(&store) {
                let scene = scene(&store, style);
                let (got, want) = (alone(&mut of_level, &scene).await, alone(&mut of_array, &scene).await);
                assert!(want.picture.pixels().iter().any(|p| p.a > 0.02), "{name}: nothing to see");
                assert!(
                    bits(&got.picture) == bits(&want.picture),
                    "{name}, level {level}: {}",
                    worst(&got.picture, &want.picture)
                );
                assert!(got.stats.samples > 0 && got.stats.lod.is_none());
            }
        }
        let error = root.at_level(9).await.unwrap_err().to_string();
        let coarsest = store.level_count() - 1;
        assert!(error.contains("no level 9") && error.contains(&format!("0 to {coarsest}")), "{error}");
    });
}

#[test]
fn where_no_error_is_allowed_the_picture_is_that_of_full_resolution() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 16);
    runtime().block_on(async {
        let (mut session, _nodes) = nodes(&store, 2).await;
        let mut levels = LevelSessions::open(Session::on(session.cluster().clone())).await.unwrap();
        for (name, style) in styles(&store) {
            for exact in [true, false] {
                let scene = scene(&store, style.clone()).with(|s| s.quality.exact = exact).unwrap();
                let full = alone(&mut session, &scene).await;
                for rule in [Rule::Error { pixels: 1e-9 }, Rule::Cone] {
                    let frame = mixed(&mut levels, &scene, rule).await;
                    assert!(bits(&frame.picture) == bits(&full.picture), "{name}, exact {exact}, {rule:?}");
                    let lod = frame.stats.lod.unwrap();
                    assert_eq!(lod.coarse_in_view(), 0, "{lod:?}");
                    assert_eq!(
                        (frame.stats.samples, frame.stats.positions),
                        (full.stats.samples, full.stats.positions)
                    );
                }
            }
        }
    });
}

/// Of any number of nodes, compact shares and scattered chunks, sampled and labelled: the same bits, of several levels.
#[test]
fn several_levels_have_the_same_bits_from_any_number_of_nodes() {
    let folder = tempfile::tempdir().unwrap();
    runtime().block_on(async {
        for brick_size in [8, 16, 32] {
            let store = store(folder.path(), brick_size);
            let focus = store.manifest().geometry.world_from_voxel(DVec3::new(20.0, 90.0, 30.0));
            let mut expected: Vec<Vec<[u32; 4]>> = Vec::new();
            for count in [1, 2, 3, 8] {
                let (session, _nodes) = nodes(&store, count).await;
                let mut levels = LevelSessions::open(session).await.unwrap();
                let mut seen = 0;
                for scattered in [false, true] {
                    if scattered {
                        levels.assign(|chunks| {
                            let owner = (0..chunks).map(|chunk| chunk * 7 % 5 % count).collect();
                            Assignment::explicit(owner, count)
                        });
                        seen = 0;
                    }
                    for (name, style) in styles(&store) {
                        for rule in [Rule::Error { pixels: 1.8 }, Rule::Focus(focus), Rule::FieldOfView] {
                            let scene = scene(&store, style.clone());
                            let frame = mixed(&mut levels, &scene, rule).await;
                            let lod = frame.stats.lod.clone().unwrap();
                            let used = lod.drawn.iter().filter(|&&chunks| chunks > 0).count();
                            let what = format!("{name}, {rule:?}, bricks of {brick_size}, {count} nodes: {lod:?}");
                            assert!(used >= 2 || rule == Rule::FieldOfView, "{what}");
                            assert!(frame.picture.pixels().iter().any(|p| p.a > 0.02), "{what}: nothing to see");
                            match expected.get(seen) {
                                None => expected.push(bits(&frame.picture)),
                                Some(one) => assert!(*one == bits(&frame.picture), "{what}, scattered: {scattered}"),
                            }
                            seen += 1;
                        }
                    }
                }
            }
        }
    });
}

/// Regions that rays leap through, and several rays a pixel, are a level's own business.
#[test]
fn leaps_and_samples_of_a_pixel_go_with_several_levels() {
    let folder = tempfile::tempdir().unwrap();
    let regions = RegionOptions { segmentation: Segmentation::Windows { range: 0.05 }, min_region: 0 };
    let options = PrepareOptions { brick_size: 16, regions: Some(regions), ..PrepareOptions::default() };
    let [nx, ny, nz] = DIMS;
    let ball = |x: u32, y: u32, z: u32| {
        let d = (DVec3::new(x.into(), y.into(), z.into()) - DVec3::new(70.0, 60.0, 50.0)).length();
        (((40.0 - d) * 0.4 + 0.5).clamp(0.0, 1.0) * 40_000.0) as u16 + 2000
    };
    let row = |y, z| (0..nx).map(move |x| ball(x, y, z));
    let voxels = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| row(y, z))).collect();
    let store = made(folder.path(), "ball", (finest(), voxels), &options);
    runtime().block_on(async {
        let mut expected = None;
        for count in [1, 3] {
            let (session, _nodes) = nodes(&store, count).await;
            let mut levels = LevelSessions::open(session).await.unwrap();
            let leaps = |s: &mut SceneParts| {
                s.quality.acceleration.leap = brickcast_volume::scene::Leap::Regions;
                s.quality.samples = brickcast_volume::scene::PixelSamples::Four;
            };
            let scene = scene(&store, Style::default()).with(leaps).unwrap();
            let frame = mixed(&mut levels, &scene, Rule::Error { pixels: 2.0 }).await;
            assert!(frame.stats.leapt_positions > 0 && frame.stats.nodes.len() == count, "{:?}", frame.stats);
            let one = expected.get_or_insert_with(|| bits(&frame.picture));
            assert!(*one == bits(&frame.picture), "{count} nodes");
        }
    });
}

/// A slab of one value, seen along its depth: the opacity of 64 voxels, on any level and on a mixture. Samples are
/// placed so that each level takes whole steps.
#[test]
fn a_homogeneous_slab_is_as_opaque_on_every_level() {
    const OPACITY: f64 = 0.02;
    let folder = tempfile::tempdir().unwrap();
    let geometry = Geometry::new([64; 3], [1.0; 3], [0.5; 3]).unwrap();
    let options = PrepareOptions { brick_size: 8, range: Some((0.0, 255.0)), ..PrepareOptions::default() };
    let store = made(folder.path(), "slab", (geometry, vec![100; 64 * 64 * 64]), &options);
    let colors = vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }];
    let opacities = [(0.0, 0.0), (50.0, 0.0), (60.0, OPACITY), (140.0, OPACITY), (150.0, 0.0)];
    let opacities = opacities.map(|(x, opacity)| OpacityPoint { x, opacity }).to_vec();
    let look = Look::new(TransferFunction::new(colors, opacities).unwrap(), 1.0);
    let projection = Projection::Parallel { parallel_scale: 20.0 };
    let (eye, center) = (DVec3::new(32.0, 32.0, -512.0), DVec3::splat(32.0));
    let view = ViewSpec {
        camera: Camera::new(eye, center, DVec3::Y, projection).unwrap(),
        size: PictureSize::new(40, 40).unwrap(),
    };
    let closed = 1.0 - (1.0 - OPACITY).powi(64);
    runtime().block_on(async {
        let (root, _nodes) = nodes(&store, 1).await;
        for integration in [Integration::Sampled, Integration::Preintegrated(TableSize::N256)] {
            let style = Style { integration, ..Style::default() };
            let look = Look { style, ..look.clone() };
            let quality = Quality { early_termination: 1.0, filter: Filter::Exact, exact: true, ..Quality::default() };
            let scene = Scene::new(look, view, quality).unwrap();
            let check = |frame: &Frame, what: &str| {
                for pixel in frame.picture.pixels() {
                    assert!((f64::from(pixel.a) - closed).abs() < 1.0 / 255.0, "{what}: {} is not {closed}", pixel.a);
                }
            };
            for level in 0..=2 {
                check(&alone(&mut root.at_level(level).await.unwrap(), &scene).await, &format!("level {level}"));
                // What would be wrong is seen: a step of 2^l with the opacity of one.
                let uncorrected = 1.0 - (1.0 - OPACITY).powi(64 >> level);
                assert!(level == 0 || (closed - uncorrected).abs() > 20.0 / 255.0);
            }
            let mut levels = LevelSessions::open(Session::on(root.cluster().clone())).await.unwrap();
            for corner in [DVec3::splat(4.0), DVec3::new(32.0, 32.0, 60.0)] {
                let frame = mixed(&mut levels, &scene, Rule::Focus(corner)).await;
                let lod = frame.stats.lod.as_ref().unwrap();
                assert!(lod.in_view.iter().filter(|&&chunks| chunks > 0).count() >= 2, "{lod:?}");
                check(&frame, &format!("{lod:?}"));
            }
        }
    });
}

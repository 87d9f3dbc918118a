//! Leaping end to end: prepared regions, nodes over gRPC, and the pictures that come out.

use crate::rig::{self, Rig, contrast, kernels, orbit, phantom, prepared, runtime, scene, worst};
use brickcast::plan::Assignment;
use brickcast_volume::MergeTree;
use brickcast_volume::camera::{Camera, Orbit};
use brickcast_volume::regions::code::{code_of_density, density_of_code};
use brickcast_volume::scene::{Acceleration, Filter, Leap, MacrocellEdge, Scene, SceneParts};
use brickcast_volume::store::{ChunkCache, Store};
use brickcast_volume::transfer_function::{Colormap, TransferFunction};

const ALL: Acceleration =
    Acceleration { skip_empty: true, leap: Leap::Regions, macrocell: MacrocellEdge::Four, leap_tolerance: None };

/// Five views: along an axis, oblique, from below, close, and grazing.
fn views() -> Vec<Orbit> {
    [(0.0, 0.0, 1.0), (37.0, 21.0, 1.0), (140.0, -35.0, 1.1), (250.0, 10.0, 2.0), (300.0, 75.0, 1.0)]
        .into_iter()
        .map(|(azimuth, elevation, zoom)| Orbit { azimuth, elevation, zoom, ..Orbit::default() })
        .collect()
}

/// The volume V' that a store's regions make, as a file of its own: codes as voxels.
fn flattened(store: &Store, path: &std::path::Path) {
    let (manifest, table) = (store.manifest(), store.region_table().unwrap());
    let (dims, cache) = (manifest.geometry.dims(), ChunkCache::new(64 << 20));
    let mut voxels = vec![0_u16; dims.element_product() as usize];
    for brick in manifest.grid.bricks() {
        let owned = manifest.grid.owned_box(brick);
        let codes = store.read_brick(brick, 0, &cache).unwrap().codes;
        let regions = store.read_brick_regions(brick, 0, &cache).unwrap();
        let size = owned.dims();
        for (i, (code, label)) in codes.iter().zip(&regions.labels).enumerate() {
            let i = i as u32;
            let p = owned.lo + glam::UVec3::new(i % size.x, i / size.x % size.y, i / size.x / size.y);
            let density = table.get(*label).map_or_else(|| density_of_code(*code), |region| region.mean());
            voxels[((p.z * dims.y + p.y) * dims.x + p.x) as usize] = code_of_density(density);
        }
    }
    let s = manifest.geometry.spacing();
    let header = format!(
        "NRRD0004\ntype: uint16\ndimension: 3\nsizes: {} {} {}\nspacings: {} {} {}\nencoding: raw\nendian: little\n\n",
        dims.x, dims.y, dims.z, s.x, s.y, s.z
    );
    let bytes: Vec<u8> = header.into_bytes().into_iter().chain(voxels.iter().flat_map(|v| v.to_le_bytes())).collect();
    std::fs::write(path, bytes).unwrap();
}

/// The definition itself: what leaping draws is what the plain loop draws of V', whatever the bricks.
#[test]
fn the_accelerated_picture_is_the_plain_raycast_of_the_flattened_volume() {
    let folder = tempfile::tempdir().unwrap();
    let input = phantom(folder.path(), "part", [88, 72, 80], 12, 0.2);
    let flat_input = folder.path().join("flat.nrrd");
    flattened(&prepared(&input, folder.path(), 32, Some(0.05)), &flat_input);
    let flat = prepared(&flat_input, folder.path(), 64, None);
    // Both in codes: the same function over the same share of the range.
    let function = |lo: f64, hi: f64| {
        let at = |t: f64| lo + (hi - lo) * t;
        TransferFunction::window(at(0.2), at(1.0), 0.05, Colormap::Viridis).unwrap()
    };
    runtime().block_on(async {
        for kernel in kernels() {
            let mut plain_rig = Rig::start(&kernel, &flat, 1).await;
            for brick_size in [16, 32, 64] {
                let store = prepared(&input, folder.path(), brick_size, Some(0.05));
                let mut rig = Rig::start(&kernel, &store, 2).await;
                for view in views() {
                    let (lo, hi) = store.manifest().range;
                    let wanted = scene(&flat, orbit(&flat, view), function(0.0, 65535.0));
                    let got = scene(&store, orbit(&store, view), function(lo, hi));
                    let exact = |scene: Scene, store: &Store, acceleration| {
                        let unit = scene.delta(&store.manifest().geometry);
                        let change = |s: &mut SceneParts| {
                            (s.look.opacity_unit, s.quality.filter) = (unit, Filter::Exact);
                            s.quality.acceleration = acceleration;
                        };
                        scene.with(change).unwrap()
                    };
                    let wanted = exact(wanted, &flat, Acceleration::default());
                    let got = exact(got, &store, ALL);
                    let plain = plain_rig.render(&wanted).await;
                    let leapt = rig.render(&got).await;
                    assert!(leapt.stats.leapt_positions > 0, "nothing was leapt");
                    let difference = worst(&plain.picture, &leapt.picture);
                    assert!(difference <= 1.0 / 255.0, "bricks of {brick_size}, {view:?}: {difference}");
                }
            }
        }
    });
}

/// Exact mode keeps its promise with leaps: bits do not depend on who renders what, and bricks cost less than 1/255.
#[test]
fn leaping_depends_on_no_partition() {
    let folder = tempfile::tempdir().unwrap();
    let input = phantom(folder.path(), "part", [97, 83, 90], 20, 0.2);
    runtime().block_on(async {
        for kernel in kernels() {
            let mut reference = None;
            for brick_size in [16, 32, 64] {
                let store = prepared(&input, folder.path(), brick_size, Some(0.03));
                let view = Orbit { azimuth: 33.0, elevation: 24.0, ..Orbit::default() };
                let (lo, hi) = store.manifest().range;
                let function = TransferFunction::window(lo + 0.3 * (hi - lo), hi, 0.03, Colormap::Turbo).unwrap();
                let leaping = |s: &mut SceneParts| (s.quality.exact, s.quality.acceleration) = (true, ALL);
                let exact = scene(&store, orbit(&store, view), function).with(leaping).unwrap();
                let mut bits = None;
                for count in [1, 2, 4] {
                    let mut rig = Rig::start(&kernel, &store, count).await;
                    let frame = rig.render(&exact).await;
                    let got = rig::bits(&frame.picture);
                    assert!(*bits.get_or_insert_with(|| got.clone()) == got, "{count} nodes, bricks of {brick_size}");
                    let chunks = MergeTree::of(store.manifest().grid).chunk_ids();
                    let scattered = chunks.map(|c| c.index() * 7 % 5 % count).collect();
                    rig.session.assign(Assignment::explicit(scattered, count));
                    let frame = rig.render(&exact).await;
                    assert!(bits.as_ref() == Some(&rig::bits(&frame.picture)), "scattered over {count} nodes");
                    let one = reference.get_or_insert_with(|| frame.picture.clone());
                    assert!(worst(one, &frame.picture) <= 1.0 / 255.0, "bricks of {brick_size}");
                }
            }
        }
    });
}

/// Every pore that the plain raycast shows, the accelerated one shows: the same part with and without its pores, in
/// both ways.
#[test]
fn no_defect_is_lost() {
    const PORES: u32 = 1000;
    let folder = tempfile::tempdir().unwrap();
    let dims = [176, 176, 176];
    let with = phantom(folder.path(), "pores", dims, PORES, 0.2);
    let without = phantom(folder.path(), "sound", dims, 0, 0.2);
    runtime().block_on(async {
        let kernel = kernels().pop().unwrap();
        for (brick_size, count) in [(16, 4), (32, 1), (32, 3), (64, 2)] {
            let (bad, good) = (
                prepared(&with, folder.path(), brick_size, Some(0.03)),
                prepared(&without, folder.path(), brick_size, Some(0.03)),
            );
            let (mut bad_rig, mut good_rig) =
                (Rig::start(&kernel, &bad, count).await, Rig::start(&kernel, &good, count).await);
            for view in views() {
                let (lo, hi) = bad.manifest().range;
                // Material half transparent over the whole part, so that single voxels of air show.
                let function =
                    TransferFunction::window(lo + 0.3 * (hi - lo), lo + 0.7 * (hi - lo), 0.01, Colormap::Grayscale);
                let mut plain = scene(&bad, orbit(&bad, view), function.unwrap());
                plain = plain.with(|s| s.view.size = brickcast_volume::PictureSize::new(176, 176).unwrap()).unwrap();
                let fast = plain.with(|s| s.quality.acceleration = ALL).unwrap();
                let (p1, p0) = (bad_rig.render(&plain).await, good_rig.render(&plain).await);
                let (f1, f0) = (bad_rig.render(&fast).await, good_rig.render(&fast).await);
                assert!(f1.stats.leapt_positions * 4 > f1.stats.positions, "hardly anything was leapt: {:?}", f1.stats);
                let (shown, lost) = contrast(&p1.picture, &p0.picture, &f1.picture, &f0.picture);
                assert!(shown > 400, "the plain picture hardly shows pores: {shown} pixels");
                assert_eq!(lost, 0, "bricks of {brick_size}, {count} nodes, {view:?}: of {shown} pixels");
            }
        }
    });
}

/// The regions are the material and the air; what is left shows pores and surfaces: the defect view.
#[test]
fn views_and_region_transfer_functions_split_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let input = phantom(folder.path(), "part", [80, 80, 80], 10, 0.1);
    let store = prepared(&input, folder.path(), 32, Some(0.05));
    runtime().block_on(async {
        use brickcast_volume::scene::RegionView::{All, Regions, Residual};
        for kernel in kernels() {
            let mut rig = Rig::start(&kernel, &store, 2).await;
            let (lo, hi) = store.manifest().range;
            let function =
                |opacity| TransferFunction::window(lo + 0.3 * (hi - lo), hi, opacity, Colormap::Viridis).unwrap();
            let camera: Camera = orbit(&store, Orbit { azimuth: 20.0, elevation: 30.0, ..Orbit::default() });
            for acceleration in [Acceleration::default(), ALL] {
                let mut one = scene(&store, camera, function(0.05));
                one = one.with(|s| s.quality.acceleration = acceleration).unwrap();
                let mut pictures = Vec::new();
                for view in [All, Regions, Residual] {
                    one = one.with(|s| s.look.region_view = view).unwrap();
                    pictures.push(rig.render(&one).await.picture);
                }
                let alpha = |p: &brickcast::picture::Picture| p.pixels().iter().map(|p| f64::from(p.a)).sum::<f64>();
                let [all, regions, residual] = [0, 1, 2].map(|i| alpha(&pictures[i]));
                assert!(
                    regions > 0.0 && residual > 0.0 && all > regions && all > residual,
                    "{all} {regions} {residual}"
                );
                // A region function that is clear is the residual view; one that is the main function is the whole
                // view.
                let split = |opacity| {
                    let two = |s: &mut SceneParts| {
                        (s.look.region_view, s.look.region_transfer_function) = (All, Some(function(opacity)));
                    };
                    one.with(two).unwrap()
                };
                let clear = rig.render(&split(0.0)).await.picture;
                assert!(worst(&clear, &pictures[2]) <= 1.0 / 255.0, "{acceleration:?}");
                let same = rig.render(&split(0.05)).await.picture;
                assert!(worst(&same, &pictures[0]) <= 1.0 / 255.0, "{acceleration:?}");
            }
        }
    });
}

/// What no macrocell holds is not missed: skipping and the macrocell rival against the plain loop.
#[test]
fn skipping_changes_no_picture_and_macrocells_keep_their_bound() {
    let folder = tempfile::tempdir().unwrap();
    let input = phantom(folder.path(), "part", [90, 70, 80], 12, 0.1);
    let store = prepared(&input, folder.path(), 32, None);
    runtime().block_on(async {
        for kernel in kernels() {
            let mut rig = Rig::start(&kernel, &store, 2).await;
            let (lo, hi) = store.manifest().range;
            let function = TransferFunction::window(lo + 0.5 * (hi - lo), hi, 0.1, Colormap::Viridis).unwrap();
            for view in views() {
                let plain = scene(&store, orbit(&store, view), function.clone());
                let reference = rig.render(&plain).await;
                for edge in [MacrocellEdge::Four, MacrocellEdge::Eight] {
                    let skips = Acceleration { skip_empty: true, macrocell: edge, ..Acceleration::default() };
                    let skipping = plain.with(|s| s.quality.acceleration = skips).unwrap();
                    let frame = rig.render(&skipping).await;
                    assert!(worst(&reference.picture, &frame.picture) <= 1.0 / 255.0, "{view:?}");
                    assert!(frame.stats.samples < reference.stats.samples * 3 / 4, "{:?}", frame.stats);
                    let leap = Leap::Macrocells(0.02);
                    let rival = skipping.with(|s| s.quality.acceleration.leap = leap).unwrap();
                    let frame = rig.render(&rival).await;
                    // 2 % of the range on a ramp of opacity 0.1 over half of it, 0.5 voxels a step, some 200 samples.
                    assert!(worst(&reference.picture, &frame.picture) <= 0.1, "{view:?}");
                    // With their apron, cells of 8 do not fit into the walls of so small a part.
                    assert!(edge == MacrocellEdge::Eight || frame.stats.leapt_positions > 0, "{view:?}");
                }
            }
        }
    });
}

//! Voxels without data, end to end: prepared from files, rendered by nodes, whatever shortens rays and whoever renders.

use std::path::{Path, PathBuf};

use crate::rig::{self, Rig, bits, kernels, runtime, worst};
use brickcast_tests::process::{brickcast, brickcast_ok, cached_stores};
use brickcast_volume::camera::{Camera, Orbit};
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::scene::{Acceleration, Filter, Leap, MacrocellEdge, RegionView, Scene, SceneParts};
use brickcast_volume::store::{PrepareOptions, RegionOptions, Segmentation, Store, prepare};
use brickcast_volume::style::{Integration, Isosurface, Mode, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};

const DIMS: [u32; 3] = [60, 52, 44];

fn is_hole([x, y, z]: [u32; 3]) -> bool {
    let ball = |c: [f64; 3], r: f64| {
        let d = [x, y, z].map(f64::from);
        (0..3).map(|a| (d[a] - c[a]).powi(2)).sum::<f64>() < r * r
    };
    ball([30.0, 26.0, 22.0], 7.0)
        || (x >= 46 && y < 22)
        || x == 16 && z % 7 == 3
        || (x * 3 + y * 7 + z * 13).is_multiple_of(211)
}

/// A large ball of one value, with a little noise, in air of another: much to leap through; NaN in the holes.
fn field(folder: &Path) -> PathBuf {
    let path = folder.join("field.nrrd");
    let [nx, ny, nz] = DIMS;
    let mut data = format!(
        "NRRD0004\ntype: float\ndimension: 3\nsizes: {nx} {ny} {nz}\nspacings: 1 1.25 0.8\nencoding: raw\nendian: \
         little\n\n"
    )
    .into_bytes();
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let d = [(x, 30), (y, 26), (z, 22)].map(|(a, b)| (f64::from(a) - f64::from(b)).powi(2));
                let ball = ((21.0 - d.iter().sum::<f64>().sqrt()) * 0.5 + 0.5).clamp(0.0, 1.0);
                let noise = f64::from((x * 7919 + y * 104_729 + z * 1_299_709) % 97) / 97.0;
                // Air is the lowest value of all: its region's mean must not become the code of no data.
                let value = -1.0 + 1.8 * ball + 0.02 * noise * ball;
                let value = if is_hole([x, y, z]) { f32::NAN } else { value as f32 };
                data.extend(value.to_le_bytes());
            }
        }
    }
    std::fs::write(&path, data).unwrap();
    path
}

fn store(folder: &Path, brick_size: u32) -> Store {
    let input = folder.join("field.nrrd");
    let input = if input.is_file() { input } else { field(folder) };
    let target = folder.join(format!("field-{brick_size}"));
    if !target.is_dir() {
        let regions = RegionOptions { segmentation: Segmentation::Windows { range: 0.03 }, min_region: 0 };
        let options = PrepareOptions { brick_size, regions: Some(regions), ..PrepareOptions::default() };
        let mut source = format::open(&input, &RawHints::default()).unwrap();
        prepare(source.as_mut(), &target, &options, &mut |_| {}).unwrap();
    }
    Store::open(&target).unwrap()
}

/// Both ends of the values show: what is no data must not be taken for one of them.
fn scene(store: &Store, style: Style) -> Scene {
    let orbit = Orbit { azimuth: 33.0, elevation: 24.0, ..Orbit::default() };
    let colors = vec![ColorPoint { x: -1.0, rgb: [0.1, 0.2, 1.0] }, ColorPoint { x: 1.0, rgb: [1.0, 0.3, 0.1] }];
    let opacities = [(-1.0, 0.03), (-0.5, 0.0), (0.3, 0.0), (0.82, 0.06)];
    let opacities = opacities.map(|(x, opacity)| OpacityPoint { x, opacity }).to_vec();
    let function = TransferFunction::new(colors, opacities).unwrap();
    let camera = Camera::orbit(&store.manifest().geometry, orbit).unwrap();
    let scene = rig::scene(store, camera, function);
    scene.with(|s| (s.look.style, s.quality.filter) = (style, Filter::Exact)).unwrap()
}

fn styles() -> Vec<(&'static str, Style)> {
    let surface = |value, opacity| Isosurface { value, color: [0.8; 3], opacity };
    let slabs = Style { integration: Integration::Preintegrated(TableSize::N256), ..Style::default() };
    let mode = |mode| Style { mode, ..Style::default() };
    let surfaces = vec![surface(-0.5, 0.4), surface(0.2, 0.7)];
    vec![
        ("samples", Style::default()),
        ("slabs", slabs.clone()),
        ("lit surfaces in slabs", Style { surfaces, shading: Some(Phong::default()), ..slabs }),
        ("maximum", mode(Mode::Maximum)),
        ("minimum", mode(Mode::Minimum)),
        ("average", mode(Mode::Average)),
    ]
}

fn with(skip_empty: bool, leap: Leap) -> Acceleration {
    Acceleration { skip_empty, leap, macrocell: MacrocellEdge::Four, leap_tolerance: None }
}

/// Nothing that shortens rays may show what is not there, or lose what is beside it.
#[test]
fn what_shortens_rays_changes_nothing_beside_holes() {
    let folder = tempfile::tempdir().unwrap();
    runtime().block_on(async {
        for kernel in kernels() {
            let mut any = [const { None }; 6];
            for brick_size in [8, 32] {
                let store = store(folder.path(), brick_size);
                let mut rig = Rig::start(&kernel, &store, 1).await;
                for (i, (name, style)) in styles().into_iter().enumerate() {
                    let what = format!("{name}, bricks of {brick_size}");
                    let mut scene = scene(&store, style);
                    scene = scene.with(|s| s.quality.acceleration = with(false, Leap::Off)).unwrap();
                    let plain = rig.render(&scene).await.picture;
                    assert!(plain.pixels().iter().any(|p| p.a > 0.02), "{what}: nothing to see");
                    let first = any[i].get_or_insert_with(|| plain.clone());
                    assert!(worst(first, &plain) <= 1.0 / 255.0, "{what}: {}", worst(first, &plain));
                    scene = scene.with(|s| s.quality.acceleration = with(true, Leap::Off)).unwrap();
                    let skipped = rig.render(&scene).await.picture;
                    assert!(worst(&plain, &skipped) <= 1.0 / 255.0, "{what}, skipping: {}", worst(&plain, &skipped));
                    scene = scene.with(|s| s.quality.acceleration = with(true, Leap::Regions)).unwrap();
                    let leapt = rig.render(&scene).await;
                    let d = worst(&plain, &leapt.picture);
                    // Bricks in which data is missing show V' voxel by voxel. Of the range, 3 % may go astray, in
                    // opacities of at most 0.06 a step; what is lit has other gradients in V'.
                    let is_lit = scene.look.style.shading.is_some();
                    assert!(is_lit || d <= 6.0 / 255.0, "{what}, leaping: {d}");
                    scene = scene.with(|s| s.quality.acceleration = with(true, Leap::Macrocells(0.03))).unwrap();
                    let d = worst(&plain, &rig.render(&scene).await.picture);
                    assert!(d <= 6.0 / 255.0, "{what}, leaping through macrocells: {d}");
                }
            }
        }
    });
}

/// Where all data is opaque, a ray that meets none is clear to the bit, in every view of regions and through either
/// filter.
#[test]
fn no_view_of_regions_shows_a_hole() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 8);
    runtime().block_on(async {
        for kernel in kernels() {
            let mut rig = Rig::start(&kernel, &store, 1).await;
            let views = [RegionView::All, RegionView::Regions, RegionView::Residual];
            let mut shown = Vec::new();
            for (filter, view) in
                [Filter::Exact, Filter::Nearest].into_iter().flat_map(|filter| views.map(|view| (filter, view)))
            {
                let mut scene = scene(&store, Style::default());
                let g = store.manifest().geometry;
                // Along y, through the corner that has no data.
                let (eye, at) = ([52.0, -300.0, 22.0].into(), [52.0, 10.0, 22.0].into());
                let lens = brickcast_volume::Projection::Perspective { view_angle: 0.2 };
                let up = glam::DVec3::Z;
                scene = scene.seen_by(Camera::new(g.world_from_voxel(eye), g.world_from_voxel(at), up, lens).unwrap());
                let white = vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }];
                let function = TransferFunction::new(white, vec![OpacityPoint { x: 0.0, opacity: 0.1 }]).unwrap();
                let corner = |s: &mut SceneParts| {
                    (s.look.transfer_function, s.look.region_view, s.quality.filter) = (function, view, filter);
                    s.quality.acceleration = with(true, Leap::Regions);
                };
                scene = scene.with(corner).unwrap();
                // Half of the corner's depth: what is behind the holes.
                let (lo, hi) = (g.world_from_voxel([0.0; 3].into()), g.world_from_voxel([60.0, 21.0, 44.0].into()));
                scene = scene.with(|s| s.look.style.clip.bounds = Some((lo, hi))).unwrap();
                let picture = rig.render(&scene).await.picture;
                assert!(picture.pixels().iter().all(|p| p.to_array() == [0.0; 4]), "{view:?} {filter:?}");
                scene = scene.with(|s| s.look.style.clip.bounds = None).unwrap();
                let picture = rig.render(&scene).await.picture;
                shown.push(picture.pixels().iter().map(|p| p.a).fold(0.0, f32::max));
            }
            for shown in shown.chunks(views.len()) {
                assert!(shown[0] > 0.5 && shown[1..].iter().any(|a| *a > 0.1), "{shown:?}");
            }
        }
    });
}

/// In exact mode bits do not depend on who renders what.
#[test]
fn holes_have_the_same_bits_from_any_number_of_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 8);
    runtime().block_on(async {
        for kernel in kernels() {
            let mut rigs = Vec::new();
            for count in [1, 2, 3, 8] {
                rigs.push((count, Rig::start(&kernel, &store, count).await));
            }
            for (name, style) in styles() {
                let exact = |s: &mut SceneParts| {
                    (s.quality.exact, s.quality.acceleration) = (true, with(true, Leap::Regions));
                };
                let scene = scene(&store, style).with(exact).unwrap();
                let mut one = None;
                for (count, rig) in &mut rigs {
                    let got = bits(&rig.render(&scene).await.picture);
                    assert!(*one.get_or_insert_with(|| got.clone()) == got, "{name}: {count} nodes");
                }
            }
        }
    });
}

/// A volume without any data is said to be one; a fill value from the command line or the header is none.
#[test]
fn empty_volumes_are_refused_in_words_and_fill_values_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let nan: Vec<u8> = (0..8 * 8 * 8).flat_map(|_| f32::NAN.to_le_bytes()).collect();
    std::fs::write(at.join("nan_8x8x8_float32.raw"), nan).unwrap();
    for args in [
        &["info", "nan_8x8x8_float32.raw"][..],
        &["render", "nan_8x8x8_float32.raw", "-o", "a.png", "--size", "16x16", "--backend", "cpu"],
        &["prepare", "nan_8x8x8_float32.raw", "s"],
    ] {
        let output = brickcast(at, args);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && !error.contains("panicked"), "{args:?}: {error}");
        assert!(error.contains("none of the 512 voxels holds data (512 are NaN"), "{args:?}: {error}");
    }
    let mut voxels =
        b"NRRD0004\ntype: int16\ndimension: 3\nsizes: 6 6 6\nencoding: raw\nendian: little\n_FillValue:=-999\n\n"
            .to_vec();
    voxels.extend((0..216_i16).flat_map(|i| (if i % 9 == 0 { -999_i16 } else { i }).to_le_bytes()));
    std::fs::write(at.join("filled.nrrd"), voxels).unwrap();
    let info = |more: &[&str]| -> serde_json::Value {
        let said = brickcast_ok(at, &[&["info", "filled.nrrd", "--json"], more].concat());
        serde_json::from_str(&said).unwrap()
    };
    let declared = info(&[]);
    assert_eq!(declared["no_data"], serde_json::json!({ "voxels": 24, "nan": 0, "fill": [-999.0] }));
    assert_eq!((&declared["min"], &declared["range"][0]), (&serde_json::json!(1.0), &serde_json::json!(1.0)));
    let both = info(&["--no-data", "1"]);
    assert_eq!(both["no_data"]["voxels"], serde_json::json!(25));
    assert!(brickcast_ok(at, &["info", "filled.nrrd"]).contains("24 voxels hold no data (fill value -999)"));
    // Part of the cache's key: two values, two stores.
    for fill in ["1", "2"] {
        let args = ["render", "filled.nrrd", "-o", "a.png", "--size", "16x16", "--backend", "cpu", "--no-data", fill];
        brickcast_ok(at, &args);
    }
    assert_eq!(cached_stores(&at.join("cache")).len(), 2);
}

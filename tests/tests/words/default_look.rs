//! What is drawn where nothing is asked for: function, light and camera by the store alone, told in words.

use std::path::Path;

use brickcast::output::png;
use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok};
use serde_json::Value;

const DIMS: [u32; 3] = [40, 32, 48];
const SPACING: [f64; 3] = [0.5, 0.5, 1.0];
/// Two bodies: a light block (value 120, with noise) and a dense one (value 230) in it, in air of 10.
const LIGHT: [[u32; 2]; 3] = [[20, 36], [8, 20], [16, 40]];
const DENSE: [[u32; 2]; 3] = [[24, 32], [12, 16], [20, 36]];

fn two_materials(folder: &Path) {
    let [nx, ny, nz] = DIMS;
    let mut bytes = format!(
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: {nx} {ny} {nz}\nspacings: {} {} {}\nencoding: raw\n\n",
        SPACING[0], SPACING[1], SPACING[2]
    )
    .into_bytes();
    for i in 0..nx * ny * nz {
        let p = [i % nx, i / nx % ny, i / (nx * ny)];
        let inside = |body: &[[u32; 2]; 3]| p.iter().zip(body).all(|(p, [lo, hi])| (lo..hi).contains(&p));
        let noise = (i.wrapping_mul(2_654_435_761) >> 29) as u8;
        bytes.push(
            if inside(&DENSE) {
                230
            } else if inside(&LIGHT) {
                116
            } else {
                6
            } + noise,
        );
    }
    std::fs::write(folder.join("two.nrrd"), bytes).unwrap();
}

struct Drawn {
    said: String,
    manifest: Value,
    pixels: Vec<[u8; 4]>,
    size: [usize; 2],
}

fn draw(folder: &Path, args: &[&str]) -> Drawn {
    let mut words = vec!["render", "-o", "p.png"];
    let unless = |flag: &str, other: [&'static str; 2]| if args.contains(&flag) { vec![] } else { other.to_vec() };
    words.extend(unless("--size", ["--size", "96x64"]));
    words.extend(unless("--nodes", ["--backend", "cpu"]));
    if args.first().is_none_or(|first| first.starts_with("--")) {
        words.push("two.nrrd");
    }
    let output = brickcast(folder, &[&words[..], args].concat());
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success(), "{args:?}: {said}");
    let manifest = serde_json::from_slice(&std::fs::read(folder.join("p.png.json")).unwrap()).unwrap();
    let png = png::read(&folder.join("p.png")).unwrap();
    Drawn { said, manifest, pixels: png.frames[0].clone(), size: [96, 64] }
}

impl Drawn {
    fn is_lit(&self) -> bool {
        !self.manifest["style"]["shading"].is_null()
    }

    fn camera(&self) -> &Value {
        &self.manifest["camera"]
    }

    fn shown(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        let width = self.size[0];
        self.pixels.iter().enumerate().filter(|(_, p)| p[3] > 2).map(move |(i, _)| [i % width, i / width])
    }
}

fn point(camera: &Value, key: &str) -> [f64; 3] {
    [0, 1, 2].map(|i| camera[key][i].as_f64().unwrap())
}

#[test]
fn the_camera_is_fitted_to_the_cells_that_show() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    two_materials(at);
    let drawn = draw(at, &[]);
    // The definition: cells of 4 voxels whose samples, one voxel beyond them, reach into the light block.
    let ends = LIGHT.map(|[lo, hi]| [(lo - 1) / 4 * 4, (hi + 1).next_multiple_of(4)]);
    let ends: Vec<[f64; 2]> = ends.iter().zip(DIMS).map(|([lo, hi], n)| [*lo, (*hi).min(n)].map(f64::from)).collect();
    let center: Vec<f64> = (0..3).map(|a| SPACING[a] * (0.5 * (ends[a][0] + ends[a][1]) - 0.5)).collect();
    let radius = 0.5 * (0..3).map(|a| (SPACING[a] * (ends[a][1] - ends[a][0])).powi(2)).sum::<f64>().sqrt();
    let distance = radius / (0.95 * 15.0_f64.to_radians().tan()).atan().sin();
    let (azimuth, elevation) = (30.0_f64.to_radians(), 20.0_f64.to_radians());
    let direction = [azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos()];
    let camera = drawn.camera();
    for a in 0..3 {
        assert!((point(camera, "focalPoint")[a] - center[a]).abs() < 1e-9, "{camera}, want {center:?}");
        assert!((point(camera, "position")[a] - center[a] - distance * direction[a]).abs() < 1e-9, "{camera}");
    }
    assert_eq!(camera["viewAngle"], 30.0);
    // It is all in the picture, and not small in it.
    let extent = |axis: usize| {
        let at: Vec<usize> = drawn.shown().map(|p| p[axis]).collect();
        (*at.iter().min().unwrap(), *at.iter().max().unwrap())
    };
    let [(left, right), (top, bottom)] = [extent(0), extent(1)];
    assert!(top >= 1 && bottom < 63 && left >= 17 && right < 79, "{left} to {right}, {top} to {bottom}");
    assert!(right - left > 28, "columns {left} to {right} of the 64 in the middle");
    // A narrow picture is as wide as the ball; clips and the number of nodes change nothing.
    let tall = draw(at, &["--size", "32x96"]);
    let far = |d: &Drawn| (0..3).map(|a| (point(d.camera(), "position")[a] - center[a]).powi(2)).sum::<f64>().sqrt();
    let want = radius / (0.95 * 15.0_f64.to_radians().tan() / 3.0).atan().sin();
    assert!((far(&tall) - want).abs() < 1e-9);
    assert_eq!(draw(at, &["--clip", "0,12,0,5,0,99", "--local", "3"]).camera(), camera);
    // Any flag of the camera is the old rule.
    for flag in [["--azimuth", "30"], ["--zoom", "1"], ["--view-angle", "30"]] {
        let asked = draw(at, &flag);
        assert_eq!(point(asked.camera(), "focalPoint"), [9.75, 7.75, 23.5], "{flag:?}");
        assert!(!asked.said.contains("camera:"), "{}", asked.said);
    }
}

#[test]
fn nodes_that_have_the_store_alone_give_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    two_materials(at);
    std::fs::create_dir(at.join("data")).unwrap();
    brickcast_ok(at, &["-q", "prepare", "two.nrrd", "data/two"]);
    let here = draw(at, &["data/two"]);
    let node = NodeProcess::start(&at.join("data"), &["--backend", "cpu"]);
    let there = draw(at, &["two", "--nodes", &node.address]);
    assert!(here.said.contains("2 materials"), "{}", here.said);
    assert_eq!((here.camera(), &here.pixels), (there.camera(), &there.pixels));
    // A store of version 6 is fitted by its bricks: here the whole volume.
    let manifest = at.join("data/two/brickcast.json");
    let mut json: Value = serde_json::from_slice(&std::fs::read(&manifest).unwrap()).unwrap();
    json["version"] = 6.into();
    for name in ["cells.bin", "means.bin"] {
        json["files"].as_object_mut().unwrap().remove(name).unwrap();
        std::fs::remove_file(at.join("data/two").join(name)).unwrap();
    }
    std::fs::write(&manifest, serde_json::to_vec_pretty(&json).unwrap()).unwrap();
    let old = draw(at, &["data/two"]);
    assert_eq!(point(old.camera(), "focalPoint"), [9.75, 7.75, 23.5]);
    brickcast_ok(at, &["verify", "data/two"]);
}

#[test]
fn with_no_flag_materials_are_told_apart_and_lit() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    two_materials(at);
    let drawn = draw(at, &[]);
    assert!(drawn.is_lit());
    for part in ["2 materials", "Otsu", "clear below", "#73ade0 opacity 0.05", "#ed9e40 opacity 0.6", "--look NAME"] {
        assert!(drawn.said.contains(part), "{part}: {}", drawn.said);
    }
    for flag in [
        "--window LO,HI",
        "lit; change it with",
        "--shading none",
        "--opacity-unit",
        "--azimuth DEG",
        "--light-from LENGTH",
    ] {
        assert!(drawn.said.contains(flag), "{flag}: {}", drawn.said);
    }
    // Blue is what is light, orange what is dense: cut open, both show.
    let is_blue = |p: &&[u8; 4]| p[3] > 20 && p[2] > p[0] + 20;
    let is_orange = |p: &&[u8; 4]| p[3] > 20 && p[0] > p[2] + 20;
    let cut = draw(at, &["--clip-plane", "0,0,-1,-28"]);
    assert_eq!(drawn.pixels.iter().filter(is_orange).count(), 0, "it lies too deep");
    let (blue, orange) = (cut.pixels.iter().filter(is_blue).count(), cut.pixels.iter().filter(is_orange).count());
    assert!(blue > 50 && orange > 10, "{blue} and {orange} pixels");
    assert_eq!(draw(at, &["--look", "part"]).pixels, drawn.pixels);
    for (flags, lit) in [
        (&["--shading", "none"][..], false),
        (&["--window", "50,200"], false),
        (&["--opacity", "0.5"], false),
        (&["--colormap", "viridis"], false),
        (&["--mode", "composite"], false),
        (&["--isosurface", "100"], true),
        (&["--audit", "--segmentation-range", "0.1"], false),
        (&["--look", "part", "--shading", "none"], false),
        (&["--filter", "nearest"], false),
        (&["--opacity-unit", "2"], true),
        (&["--step", "1"], true),
    ] {
        assert_eq!(draw(at, flags).is_lit(), lit, "{flags:?}");
    }
    assert!(draw(at, &["--opacity-unit", "2"]).said.contains("for each 2 of depth"));
}

#[test]
fn looks_and_projections_have_functions_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    two_materials(at);
    let mut seen = Vec::new();
    for flags in [
        ["--look", "part"],
        ["--look", "scan"],
        ["--look", "mip"],
        ["--look", "xray"],
        ["--mode", "minip"],
        ["--mode", "average"],
    ] {
        let drawn = draw(at, &flags);
        assert!(drawn.shown().count() > 100, "{flags:?}");
        let levels: std::collections::BTreeSet<[u8; 4]> = drawn.pixels.iter().copied().collect();
        assert!(levels.len() > 5, "{flags:?}: {} colours", levels.len());
        assert!(drawn.said.contains("change it with") && !drawn.said.contains("nothing"), "{flags:?}: {}", drawn.said);
        seen.push(drawn.pixels);
    }
    assert_eq!(seen[3], seen[5], "an X-ray is the mean of each ray");
    seen.remove(5);
    for i in 0..seen.len() {
        assert!(!seen[i + 1..].contains(&seen[i]), "{i}");
    }
    for bad in [["--look", "mip", "--mode", "mip"], ["--look", "part", "--window", "1,2"]] {
        assert_eq!(brickcast(at, &[&["render", "two.nrrd", "-o", "p.png"][..], &bad].concat()).status.code(), Some(2));
    }
}

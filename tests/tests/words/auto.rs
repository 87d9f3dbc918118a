//! What is decided where nothing is said: whether rays leap, and whether they take samples or slabs. By store, look and
//! step alone, told, and the picture of the flags that it stands for.

use std::path::Path;

use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok};
use serde_json::Value;

const EDGE: u32 = 48;

/// A thick block of one value (30 of 255, with noise of 1) in air that changes from voxel to voxel.
fn block(folder: &Path) {
    let mut bytes =
        format!("NRRD0004\ntype: uint8\ndimension: 3\nsizes: {EDGE} {EDGE} {EDGE}\nencoding: raw\n\n").into_bytes();
    for i in 0..EDGE.pow(3) {
        let p = [i % EDGE, i / EDGE % EDGE, i / EDGE / EDGE];
        let scatter = i.wrapping_mul(2_654_435_761) >> 24;
        let is_block = p.iter().all(|p| (8..40).contains(p));
        bytes.push(if is_block { 30 + (scatter & 1) as u8 } else { 100 + (scatter % 156) as u8 });
    }
    std::fs::write(folder.join("block.nrrd"), bytes).unwrap();
}

struct Drawn {
    said: String,
    manifest: Value,
    pixels: Vec<u8>,
}

impl Drawn {
    fn leap(&self) -> &Value {
        &self.manifest["acceleration"]["leap"]
    }

    fn integration(&self) -> &Value {
        &self.manifest["style"]["integration"]
    }
}

fn draw(folder: &Path, args: &[&str]) -> Drawn {
    let common = ["render", "-o", "p.png", "--size", "64x64", "--azimuth", "30", "--elevation", "20"];
    let here = if args.contains(&"--nodes") { &[][..] } else { &["--backend", "cpu"] };
    let output = brickcast(folder, &[&common[..], here, args].concat());
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success(), "{args:?}: {said}");
    let manifest = serde_json::from_slice(&std::fs::read(folder.join("p.png.json")).unwrap()).unwrap();
    Drawn { said, manifest, pixels: std::fs::read(folder.join("p.png")).unwrap() }
}

/// A wide ramp over all values.
const HAZE: [&str; 4] = ["--window", "-200,90", "--opacity", "0.05"];

#[test]
fn rays_leap_where_much_of_what_shows_lies_deep() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    block(at);
    std::fs::create_dir(at.join("data")).unwrap();
    let band = r#"[{"Name": "band", "RGBPoints": [0, 1, 0.5, 0, 255, 1, 1, 0],
        "Points": [0, OPACITY, 0.5, 0, 60, OPACITY, 0.5, 0, 61, 0, 0.5, 0, 255, 0, 0.5, 0]}]"#;
    for (name, opacity) in [("haze", "0.05"), ("wall", "0.9")] {
        std::fs::write(at.join(format!("{name}.json")), band.replace("OPACITY", opacity)).unwrap();
    }
    let [haze, wall] = [["--transfer-function", "haze.json"], ["--transfer-function", "wall.json"]];
    for (store, brick) in [("data/b16", "16"), ("data/b32", "32")] {
        brickcast_ok(at, &["-q", "prepare", "block.nrrd", store, "--brick", brick, "--segmentation-range", "0.03"]);
        let auto = draw(at, &[&[store][..], &haze].concat());
        assert!(auto.said.contains("rays leap through regions, in which"), "{}", auto.said);
        assert!(auto.said.contains("--accel ert,ess") && auto.leap() == "regions", "{}", auto.said);
        assert!(auto.pixels == draw(at, &[&[store, "--accel", "all"][..], &haze].concat()).pixels);
        let off = draw(at, &[&[store][..], &wall].concat());
        assert!(off.said.contains("no leaps through regions, in which only 0 %"), "{}", off.said);
        assert!(off.said.contains("--accel all") && off.leap() == "off", "{}", off.said);
        assert!(off.pixels == draw(at, &[&[store, "--accel", "ert,ess"][..], &wall].concat()).pixels);
    }
    let node = NodeProcess::start(&at.join("data"), &["--backend", "cpu"]);
    for function in [&haze, &wall] {
        let here = draw(at, &[&["data/b16"][..], function].concat());
        let there = draw(at, &[&["b16", "--nodes", &node.address][..], function].concat());
        assert_eq!((here.leap(), &here.pixels), (there.leap(), &there.pixels));
    }
    // Pictures of regions are of V'; projections show every sample; who asks for a bound wants leaps.
    assert_eq!(draw(at, &[&["data/b16", "--view", "residual"][..], &wall].concat()).leap(), "regions");
    let mip = draw(at, &["data/b16", "--mode", "mip"]);
    assert!(mip.leap() == "off" && mip.said.contains("a projection shows every sample"), "{}", mip.said);
    assert_eq!(draw(at, &[&["data/b16", "--leap-tolerance", "0.5"][..], &wall].concat()).leap(), "regions");
    // Older stores do not say how deep regions are.
    let path = at.join("data/b16/brickcast.json");
    let mut json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    json["version"] = 7.into();
    json.as_object_mut().unwrap().remove("levels").unwrap();
    json["files"].as_object_mut().unwrap().remove("means.bin").unwrap();
    json["regions"].as_object_mut().unwrap().remove("leap_histogram").unwrap();
    std::fs::write(&path, serde_json::to_vec_pretty(&json).unwrap()).unwrap();
    let old = draw(at, &[&["data/b16"][..], &haze].concat());
    assert!(old.leap() == "off" && old.said.contains("the store is older than what is known"), "{}", old.said);
    // Without regions there is nothing to tell.
    let none = draw(at, &[&["block.nrrd"][..], &haze].concat());
    assert!(none.leap() == "off" && !none.said.contains("acceleration"), "{}", none.said);
}

#[test]
fn slabs_are_taken_where_a_step_would_miss_something() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    block(at);
    let smooth = draw(at, &[&["block.nrrd"][..], &HAZE].concat());
    assert!(
        smooth.said.contains("integration: single samples") && smooth.integration() == "sampled",
        "{}",
        smooth.said
    );
    assert!(smooth.pixels == draw(at, &[&["block.nrrd", "--integration", "sampled"][..], &HAZE].concat()).pixels);
    let narrow = ["--window", "40,42", "--opacity", "0.5"];
    let slabs = draw(at, &[&["block.nrrd"][..], &narrow].concat());
    assert!(slabs.said.contains("integration: preintegrated, since samples 0.5 voxels apart"), "{}", slabs.said);
    assert_eq!(slabs.integration()["preintegrated"], 1024);
    assert!(
        slabs.pixels == draw(at, &[&["block.nrrd", "--integration", "preintegrated"][..], &narrow].concat()).pixels
    );
    // The smallest of tables is no reason for one.
    assert_eq!(draw(at, &[&["block.nrrd", "--table-size", "256"][..], &HAZE].concat()).integration(), "sampled");
    for needs in [&["--lighting", "center", "--shading", "phong"][..], &["--isosurface", "60"]] {
        let asked = draw(at, &[&["block.nrrd"][..], &HAZE, needs].concat());
        assert_eq!(asked.integration()["preintegrated"], 1024, "{needs:?}");
        assert!(!asked.said.contains("integration:"), "{}", asked.said);
    }
}

//! Volumes that change with time: series are made, told of and rendered, and no step's data is another's.

use std::fs;
use std::path::Path;

use brickcast_tests::process::{binaries, brickcast, brickcast_both, brickcast_ok};
use brickcast_tests::web::WebServer;
use serde_json::Value;

/// Steps of f32, whose values drift: each alone would be mapped in its own way.
const STEPS: usize = 4;
const RAW: [&str; 6] = ["--dims", "40,36,33", "--type", "float32", "--brick", "16"];
/// A scene by values alone, from one place.
const SCENE: [&str; 9] = ["--size", "70x50", "--backend", "cpu", "--window", "10,60", "--azimuth", "40", "--exact"];

/// A ball that grows, in a slope.
fn write_steps(at: &Path) -> Vec<String> {
    let voxel = |step: usize, p: [f32; 3]| {
        let r = ((p[0] - 20.0).powi(2) + (p[1] - 18.0).powi(2) + (p[2] - 16.0).powi(2)).sqrt();
        let ball = if r < 5.0 + 3.0 * step as f32 { 50.0 } else { 5.0 };
        ball + p[0] * 0.25 + step as f32 * 1.5
    };
    let name = |step: usize| {
        let name = format!("t{step}.raw");
        let mut bytes = Vec::new();
        for z in 0..33 {
            for y in 0..36 {
                (0..40).for_each(|x| bytes.extend(voxel(step, [x as f32, y as f32, z as f32]).to_le_bytes()));
            }
        }
        fs::write(at.join(&name), bytes).unwrap();
        name
    };
    (0..STEPS).map(name).collect()
}

fn series(at: &Path) -> String {
    let names = write_steps(at);
    let inputs: Vec<&str> = names.iter().map(String::as_str).collect();
    brickcast_both(
        at,
        &[&["prepare"][..], &inputs, &["load", "--times", "0,1.5,3,4.5", "--time-unit", "kN"], &RAW].concat(),
    )
    .1
}

fn manifest(at: &Path, name: &str) -> Value {
    serde_json::from_slice(&fs::read(at.join(name)).unwrap()).unwrap()
}

fn refused(at: &Path, args: &[&str], code: i32, words: &[&str]) {
    let output = brickcast(at, args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(code) && words.iter().all(|word| said.contains(word)), "{args:?}: {said}");
}

#[test]
fn a_step_in_a_series_has_the_bits_of_its_store_alone_on_any_number_of_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let said = series(at);
    assert!(said.contains("load: 4 steps of 40 x 36 x 33 voxels"), "{said}");
    for step in ["0", "2"] {
        let alone = format!("load/{step}");
        brickcast_ok(at, &[&["render", &alone, "-o", "alone.exr"][..], &SCENE].concat());
        let want = fs::read(at.join("alone.exr")).unwrap();
        for nodes in ["1", "2", "3"] {
            brickcast_ok(
                at,
                &[&["render", "load", "--time", step, "-o", "s.exr", "--local", nodes][..], &SCENE].concat(),
            );
            assert!(fs::read(at.join("s.exr")).unwrap() == want, "step {step} on {nodes} nodes");
        }
        let told = manifest(at, "s.exr.json");
        let store = manifest(at, "alone.exr.json")["store"].clone();
        assert_eq!((told["series_step"].to_string(), &told["store"]), (step.to_owned(), &store));
    }
    // Drawn again by the series or by the step's own store.
    brickcast_ok(at, &[&["render", "load", "--time", "1", "-o", "one.png"][..], &SCENE].concat());
    for path in [None, Some("load"), Some("load/1")] {
        let args =
            [&["render"][..], path.as_slice(), &["--scene", "one.png.json", "--check", "--backend", "cpu"]].concat();
        assert!(brickcast_ok(at, &args).contains("the same bits"));
    }
    refused(at, &["render", "load/2", "--scene", "one.png.json", "--check", "--backend", "cpu"], 1, &["its hash is"]);
    refused(at, &["render", "load", "--time", "1", "--scene", "one.png.json", "--check"], 2, &["which step"]);
}

#[test]
fn a_sequence_shows_each_step_whatever_is_fetched_ahead_and_is_drawn_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    series(at);
    let frames = |name: &str, more: &[&str]| {
        brickcast_ok(at, &[&["render", "load", "--time", "all", "-o", name][..], &SCENE, more].concat());
        (0..STEPS)
            .map(|i| fs::read(at.join(format!("{}_{i:04}.png", name.trim_end_matches(".png")))).unwrap())
            .collect::<Vec<_>>()
    };
    let want: Vec<Vec<u8>> = (0..STEPS)
        .map(|step| {
            let step = step.to_string();
            brickcast_ok(at, &[&["render", "load", "--time", &step, "-o", "one.png"][..], &SCENE].concat());
            fs::read(at.join("one.png")).unwrap()
        })
        .collect();
    assert!(want[0] != want[1]);
    assert!(frames("a.png", &[]) == want);
    assert!(frames("b.png", &["--no-fetch-ahead", "--local", "2"]) == want);
    // No room for a second step, or even for one.
    assert!(frames("c.png", &["--local", "2", "--memory-budget", "300KiB"]) == want);
    assert!(frames("d.png", &["--lod", "0"]) == want);
    // With a camera that moves, several frames a step, backwards.
    let turn = ["render", "load", "--time", "3..1", "--frames", "6", "--orbit", "90", "-o", "turn.apng"];
    brickcast_ok(at, &[&turn[..], &SCENE].concat());
    let told = manifest(at, "turn.apng.json");
    let step = |frame: &Value| frame["series_step"].as_u64().unwrap();
    let steps: Vec<u64> = told["frames"].as_array().unwrap().iter().map(step).collect();
    assert_eq!(steps, [3, 3, 2, 2, 1, 1]);
    assert!(told["frames"][0]["camera"] != told["frames"][1]["camera"]);
    let again =
        brickcast_ok(at, &["render", "--scene", "turn.apng.json", "--check", "--backend", "cpu", "--local", "2"]);
    assert!(again.contains("the same bits, all 6 frames"), "{again}");
    // Over a range the camera stands still unless it is asked to move.
    brickcast_ok(
        at,
        &[&["render", "load", "--time", "0..1", "--frames", "3", "-o", "still.apng"][..], &SCENE].concat(),
    );
    let told = manifest(at, "still.apng.json");
    assert_eq!(told["frames"][0]["camera"], told["frames"][2]["camera"]);
}

#[test]
fn a_missing_step_is_a_frame_that_says_so_and_the_sequence_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    series(at);
    fn draw(name: &str) -> Vec<&str> {
        [&["render", "load", "--time", "all", "-o", name][..], &SCENE].concat()
    }
    brickcast_ok(at, &draw("whole.png"));
    fs::rename(at.join("load/1"), at.join("elsewhere")).unwrap();
    // On every level, the smallest of which is in its halo.
    let shards = (0..3).map(|level| format!("load/2/{level}/c/0/0/0"));
    for file in shards.chain(["load/2/levels/2/halos.bin".to_owned()]).map(|file| at.join(file)) {
        let mut bytes = fs::read(&file).unwrap();
        bytes.iter_mut().for_each(|byte| *byte ^= 0x55);
        fs::write(&file, bytes).unwrap();
    }
    refused(at, &draw("a.png"), 3, &["frame 1: step 1 (1.5 kN)", "frame 2: step 2 (3 kN)"]);
    for step in [0, 3] {
        let [got, want] = ["a", "whole"].map(|name| fs::read(at.join(format!("{name}_{step:04}.png"))).unwrap());
        assert!(got == want, "step {step}");
    }
    let told = manifest(at, "a_0001.png.json");
    assert_eq!((&told["complete"], &told["series_step"]), (&Value::Bool(false), &Value::from(1)));
    assert!(told["problems"][0].as_str().unwrap().contains("step 1"));
    assert_eq!(manifest(at, "a_0003.png.json")["complete"], true);
    refused(at, &["verify", "load"], 1, &["broken", "1 missing"]);
    // The first step of a sequence may be the one.
    refused(at, &[&["render", "load", "--time", "1..0", "-o", "b.png"][..], &SCENE].concat(), 3, &["frame 0: step 1"]);
    refused(at, &[&["render", "load", "--time", "1", "-o", "c.png"][..], &SCENE].concat(), 1, &["step 1"]);
}

#[test]
fn what_is_told_of_a_series_and_what_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    series(at);
    let told: Value = serde_json::from_str(&brickcast_ok(at, &["info", "load", "--json"])).unwrap();
    assert_eq!((told["kind"].as_str(), told["series"]["steps"].as_array().map(Vec::len)), (Some("series"), Some(4)));
    assert_eq!((&told["series"]["steps"][3]["time"], &told["series"]["time_unit"]), (&4.5.into(), &"kN".into()));
    // Of all steps together, not of the first.
    assert_eq!(told["max"], 50.0 + 33.0 * 0.25 + 4.5);
    let text = brickcast_ok(at, &["info", "load"]);
    assert!(text.contains("4 steps") && text.contains("0, 1.5, 3, 4.5 kN"), "{text}");
    let of_step: Value = serde_json::from_str(&brickcast_ok(at, &["info", "load", "--time", "3", "--json"])).unwrap();
    assert_eq!((&of_step["kind"], &of_step["range"]), (&"store".into(), &told["range"]));
    assert!(brickcast_ok(at, &["verify", "load"]).contains("every byte is as the manifest says"));
    // The default look is one for all steps: that of the series.
    let (_, said) = brickcast_both(at, &["render", "load", "-o", "a.png", "--size", "40", "--backend", "cpu"]);
    assert!(said.contains("step 0 of 4 is shown; --time T takes another"), "{said}");
    brickcast_ok(at, &["render", "load", "--time", "3", "-o", "b.png", "--size", "40", "--backend", "cpu"]);
    let function = |name: &str| manifest(at, name)["look"].clone();
    assert_eq!(function("a.png.json"), function("b.png.json"));
    let render = |time| ["render", "load", "-o", "x.png", "--time", time];
    refused(at, &render("4"), 2, &["--time 4: steps are 0 to 3 in the series", "load"]);
    refused(at, &render("0..4"), 2, &["--time 0..4: steps are 0 to 3"]);
    refused(at, &render("x"), 2, &["`x`", "0..9"]);
    refused(at, &["render", "load/1", "-o", "x.png", "--time", "0..3"], 2, &["--time 0..3"]);
    refused(at, &["bench", "load"], 2, &["series of 4 steps", "load/0"]);
    fn prepare<'a>(more: &[&'a str]) -> Vec<&'a str> {
        [&["prepare", "t0.raw", "t1.raw", "x"][..], more, &RAW].concat()
    }
    refused(at, &prepare(&["--times", "1"]), 2, &["1 times for 2 steps"]);
    refused(at, &prepare(&["--times", "1,1"]), 1, &["step 1 is at 1, not after"]);
    refused(at, &prepare(&["--resume"]), 2, &["of one store"]);
    refused(at, &prepare(&["--time", "0..1"]), 2, &["leave one of the two out"]);
    refused(at, &[&["prepare", "t0.raw", "x", "--times", "1"][..], &RAW].concat(), 2, &["--times"]);
    refused(at, &[&["prepare", "t0.raw", "x", "--time", "all"][..], &RAW].concat(), 2, &["has no times"]);
    refused(at, &[&["prepare", "t0.raw", "t1.raw", "load"][..], &RAW].concat(), 1, &["exists already"]);
    brickcast_ok(at, &["phantom", "p.nrrd", "--dims", "40,36,32", "--pores", "2"]);
    refused(
        at,
        &["prepare", "t0.raw", "p.nrrd", "x", "--dims", "40,36,33", "--type", "float32"],
        1,
        &["step 1", "dims"],
    );
    assert!(
        !at.join("x").exists()
            && fs::read_dir(at).unwrap().all(|e| !e.unwrap().file_name().to_string_lossy().contains("tmp"))
    );
    // Named in the wrong order by a shell.
    fs::copy(at.join("t0.raw"), at.join("t10.raw")).unwrap();
    let (_, said) = brickcast_both(at, &[&["prepare", "t10.raw", "t2.raw", "y"][..], &RAW].concat());
    assert!(said.contains("t10.raw comes before t2.raw"), "{said}");
}

/// Zarr v2 without compression: t, c, z, y, x.
fn write_ome_zarr(at: &Path) {
    fs::create_dir_all(at.join("0")).unwrap();
    let axes = r#"[{"name": "t", "type": "time", "unit": "second"}, {"name": "c", "type": "channel"},
        {"name": "z", "type": "space"}, {"name": "y", "type": "space"}, {"name": "x", "type": "space"}]"#;
    let scale = r#"[{"type": "scale", "scale": [0.5, 1, 1, 1, 1]}]"#;
    let datasets = format!(r#"[{{"path": "0", "coordinateTransformations": {scale}}}]"#);
    let image = format!(r#"{{"multiscales": [{{"version": "0.4", "axes": {axes}, "datasets": {datasets}}}]}}"#);
    fs::write(at.join(".zattrs"), image).unwrap();
    fs::write(at.join(".zgroup"), r#"{"zarr_format": 2}"#).unwrap();
    let array = r#"{"zarr_format": 2, "shape": [3, 1, 16, 16, 16], "chunks": [1, 1, 16, 16, 16], "dtype": "<u2",
        "compressor": null, "fill_value": 0, "order": "C", "filters": null, "dimension_separator": "."}"#;
    fs::write(at.join("0/.zarray"), array).unwrap();
    for t in 0..3_u16 {
        let bytes: Vec<u8> = (0..4096_u16).flat_map(|i| (i + 1000 * t).to_le_bytes()).collect();
        fs::write(at.join(format!("0/{t}.0.0.0.0")), bytes).unwrap();
    }
}

#[test]
fn an_image_with_an_axis_of_time_becomes_a_series() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_ome_zarr(&at.join("cells.zarr"));
    brickcast_ok(at, &["prepare", "cells.zarr", "all", "--time", "all", "--brick", "8"]);
    let told: Value = serde_json::from_str(&brickcast_ok(at, &["info", "all", "--json"])).unwrap();
    let times: Vec<f64> =
        told["series"]["steps"].as_array().unwrap().iter().map(|s| s["time"].as_f64().unwrap()).collect();
    assert_eq!((times, &told["series"]["time_unit"]), (vec![0.0, 0.5, 1.0], &"second".into()));
    assert_eq!((&told["min"], &told["max"]), (&0.0.into(), &6095.0.into()));
    brickcast_ok(at, &["prepare", "cells.zarr", "some", "--time", "1..2", "--brick", "8"]);
    let told: Value = serde_json::from_str(&brickcast_ok(at, &["info", "some", "--time", "0", "--json"])).unwrap();
    assert_eq!((&told["min"], &told["range"][1]), (&1000.0.into(), &6095.0.into()));
    refused(at, &["prepare", "cells.zarr", "x", "--time", "1..3"], 2, &["--time 1..3: steps are 0 to 2"]);
}

#[test]
fn a_series_behind_a_network_is_shown_as_if_it_lay_here() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    series(at);
    let server = WebServer::start(at);
    let far = format!("{}/load", server.address);
    for (path, name) in [("load", "here.png"), (far.as_str(), "far.png")] {
        brickcast_ok(at, &[&["render", path, "--time", "all", "--local", "2", "-o", name][..], &SCENE].concat());
    }
    for step in 0..STEPS {
        let [here, far] = ["here", "far"].map(|name| fs::read(at.join(format!("{name}_{step:04}.png"))).unwrap());
        assert!(here == far, "step {step}");
    }
    assert!(brickcast_ok(at, &["verify", &far]).contains("every byte is as the manifest says"));
    let told: Value = serde_json::from_str(&brickcast_ok(at, &["info", &far, "--json"])).unwrap();
    assert_eq!(told["kind"], "series");
}

#[cfg(unix)]
#[test]
fn the_guides_lines_can_be_pasted() {
    let folder = tempfile::tempdir().unwrap();
    let guide = include_str!("../../../docs/guide/time.md");
    let lines = guide.split("```sh\n").nth(1).unwrap().split("```").next().unwrap();
    assert!(lines.lines().count() > 6, "{lines}");
    let path = format!("{}:{}", binaries().display(), std::env::var("PATH").unwrap());
    let mut bash = std::process::Command::new("bash");
    bash.args(["-ec", lines]).current_dir(folder.path()).env("PATH", path);
    bash.env("BRICKCAST_CACHE_DIR", folder.path().join("cache")).env("XDG_CONFIG_HOME", folder.path());
    let output = bash.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(folder.path().join("turn.apng").is_file());
}

//! Pixels of several rays, and what a word for the quality stands for.

use std::path::Path;

use brickcast::output::exr;
use brickcast_tests::process::{brickcast, brickcast_ok};
use brickcast_tests::turn;
use serde_json::{Value, json};

use crate::scene_file::site;

const LOOK: [&str; 8] = ["--window", "3000,52000", "--opacity", "0.3", "--colormap", "viridis", "--azimuth", "35"];

fn draw(at: &Path, picture: &str, size: &str, flags: &[&str]) {
    let fixed = ["render", "part", "-o", picture, "--size", size, "--backend", "cpu"];
    brickcast_ok(at, &[&fixed, &LOOK[..], flags].concat());
}

fn pixels(at: &Path, name: &str) -> Vec<[f32; 4]> {
    exr::read(&at.join(name)).unwrap().pixels().iter().map(|p| p.to_array()).collect()
}

fn bits(pixels: &[[f32; 4]]) -> Vec<[u32; 4]> {
    pixels.iter().map(|p| p.map(f32::to_bits)).collect()
}

fn manifest(at: &Path, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap()
}

/// Of a picture of `width` pixels whose rays these are, `side` by `side` a pixel.
fn means(rays: &[[f32; 4]], width: usize, side: usize) -> Vec<[f32; 4]> {
    let height = rays.len() / (width * side * side);
    let mut means = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0_f32; 4];
            for i in 0..side * side {
                let ray = rays[(y * side + i / side) * width * side + x * side + i % side];
                sum = std::array::from_fn(|c| sum[c] + ray[c]);
            }
            means.push(sum.map(|sum| sum / (side * side) as f32));
        }
    }
    means
}

#[test]
fn a_pixel_is_the_mean_of_its_rays_whoever_rendered_them() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    // Sides that are no multiples of a tile's, of which some lie across tiles of rays.
    for (name, size, side, flags) in [
        ("four", [70, 45], 2, &["--exact"][..]),
        ("nine", [70, 45], 3, &["--exact", "--shading", "phong"]),
        ("sixteen", [33, 20], 4, &["--exact", "--isosurface", "30000:1,0.2,0.1,0.5"]),
        ("mip", [70, 45], 2, &["--mode", "mip"]),
        ("average", [40, 30], 3, &["--exact", "--mode", "average"]),
    ] {
        let [width, height] = size;
        let large = format!("{}x{}", width * side, height * side);
        draw(at, "rays.exr", &large, &[flags, &["--local", "2"]].concat());
        let want = means(&pixels(at, "rays.exr"), width, side);
        let (small, samples) = (format!("{width}x{height}"), (side * side).to_string());
        for nodes in ["1", "3"] {
            draw(at, "a.exr", &small, &[flags, &["--samples", &samples, "--local", nodes]].concat());
            assert!(bits(&pixels(at, "a.exr")) == bits(&want), "{name} on {nodes}");
        }
        let told = manifest(at, "a.exr.json");
        assert_eq!((&told["size"], &told["samples"]), (&json!(size), &json!(side * side)), "{name}");
        let said =
            brickcast_ok(at, &["render", "--scene", "a.exr.json", "--check", "--backend", "cpu", "--local", "2"]);
        assert!(said.contains("the same bits"), "{name}: {said}");
    }
}

#[test]
fn one_sample_is_the_picture_as_it_was_and_older_manifests_are_read() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    draw(at, "a.png", "48x36", &[]);
    draw(at, "b.png", "48x36", &["--samples", "1"]);
    assert_eq!(std::fs::read(at.join("a.png")).unwrap(), std::fs::read(at.join("b.png")).unwrap());
    let mut told = manifest(at, "a.png.json");
    assert_eq!(told.as_object_mut().unwrap().remove("samples"), Some(json!(1)));
    std::fs::write(at.join("a.png.json"), told.to_string()).unwrap();
    let said = brickcast_ok(at, &["render", "--scene", "a.png.json", "--check", "--backend", "cpu"]);
    assert!(said.contains("the same"), "{said}");
}

#[test]
fn plans_audits_and_sequences_are_of_rays_too() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    let plan = |flags: &[&str]| {
        brickcast_ok(at, &[&["render", "part", "--dry-run", "--local", "2"][..], &LOOK, flags].concat())
    };
    assert_eq!(plan(&["--size", "130x70", "--samples", "4"]), plan(&["--size", "260x140"]));
    assert_ne!(plan(&["--size", "130x70"]), plan(&["--size", "260x140"]));
    let audit = ["render", "part", "-o", "a.png", "--size", "48x36", "--samples", "9", "--audit", "--stats", "s.json"];
    brickcast_ok(at, &[&audit[..], &LOOK, &["--backend", "cpu"]].concat());
    let found = &manifest(at, "s.json")["audit"];
    assert_eq!(found["pixels_outside"], json!(0), "{found}");
    for part in ["difference", "width"] {
        let figures = &found[part];
        let [largest, p99, mean] = ["largest", "p99", "mean"].map(|key| figures[key].as_f64().unwrap());
        assert!(largest >= p99 && p99 >= 0.0 && mean <= largest, "{found}");
    }
    assert_eq!(found.as_object().unwrap().len(), 3, "{found}");
    draw(at, "turn.apng", "20x16", &["--samples", "4", "--frames", "2"]);
    let frames = brickcast::output::png::read(&at.join("turn.apng")).unwrap();
    assert_eq!((frames.size.width(), frames.size.height(), frames.frames.len()), (20, 16, 2));
}

#[test]
fn too_many_rays_are_refused_with_their_number() {
    let folder = tempfile::tempdir().unwrap();
    for (size, samples, words) in [
        ("16384x16384", "16", "16384x16384 with 16 samples a pixel is 65536x65536 rays"),
        ("5000x5000", "4", "is 10000x10000 rays"),
        ("64x64", "5", "1, 4, 9, 16"),
    ] {
        let output = brickcast(folder.path(), &["render", "p", "-o", "a.png", "--size", size, "--samples", samples]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(words), "{said}");
    }
}

#[test]
fn a_word_for_the_quality_is_told_and_resolved_in_the_manifest() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    let drawn = |flags: &[&str]| {
        let fixed = ["render", "part", "-o", "a.png", "--size", "24x20", "--backend", "cpu", "-v"];
        let output = brickcast(at, &[&fixed[..], flags].concat());
        let said = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
        assert!(output.status.success(), "{said}");
        (manifest(at, "a.png.json"), said)
    };
    let (told, said) = drawn(&["--quality", "final"]);
    let of = |told: &Value| json!([told["step"], told["samples"], told["early_termination"], told["transport"]]);
    assert_eq!(of(&told), json!([0.25, 4, 1.0, "f32"]));
    assert!(said.contains("quality final: step 0.25, 4 samples a pixel"), "{said}");
    assert!(said.contains("--step 0.25 --samples 4 --early-termination 1 --transport f32"), "{said}");
    let (told, said) = drawn(&["--quality", "draft", "--step", "0.7", "--integration", "preintegrated"]);
    assert_eq!(told["step"], 0.7);
    assert_eq!(told["style"]["integration"], json!({ "preintegrated": 256 }));
    assert!(said.contains("quality draft: tables of 256 entries") && !said.contains("step 1"), "{said}");
    let (normal, said) = drawn(&["--quality", "normal"]);
    assert!(!said.contains("quality normal"), "{said}");
    assert_eq!(of(&normal), of(&drawn(&[]).0));
}

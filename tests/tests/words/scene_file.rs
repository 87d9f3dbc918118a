//! A picture is drawn again from its manifest: the same bits, by any number of nodes, and what is not the same is told.

use std::path::Path;

use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok};
use brickcast_tests::turn;
use serde_json::{Value, json};

const WINDOW: [&str; 6] = ["--window", "3000,52000", "--opacity", "0.3", "--colormap", "viridis"];

/// A folder with a store, `part`.
pub(crate) fn site() -> tempfile::TempDir {
    let site = tempfile::tempdir().unwrap();
    let phantom = ["phantom", "part.nrrd", "--dims", "40,36,32", "--pores", "4", "--seed", "3"];
    brickcast_ok(site.path(), &phantom);
    brickcast_ok(site.path(), &["prepare", "part.nrrd", "part", "--brick", "16", "--segmentation-range", "0.03"]);
    site
}

/// Draws `part` into `picture`.
fn draw(at: &Path, picture: &str, flags: &[&str]) {
    let fixed = ["render", "part", "-o", picture, "--size", "48x36", "--azimuth", "35", "--backend", "cpu"];
    brickcast_ok(at, &[&fixed, flags].concat());
}

/// What a command that fails says, and its exit code.
fn refused(at: &Path, args: &[&str]) -> (i32, String) {
    let output = brickcast(at, args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && !said.contains("panicked"), "{args:?}: {said}");
    (output.status.code().unwrap(), said)
}

/// Compares the picture beside a manifest with what is drawn now.
fn check<'a>(manifest: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", "--scene", manifest, "--check", "--backend", "cpu"], more].concat()
}

fn manifest(at: &Path, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap()
}

fn rewrite(at: &Path, name: &str, change: impl FnOnce(&mut Value)) {
    let mut value = manifest(at, name);
    change(&mut value);
    std::fs::write(at.join(name), value.to_string()).unwrap();
}

#[test]
fn every_style_is_drawn_again_with_the_same_bits_by_another_number_of_nodes() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    let surface = "--isosurface=20000:1,0.2,0.1,0.4";
    let styles: [(&str, &[&str]); 20] = [
        ("slabs", &[]),
        ("sampled", &["--integration", "sampled"]),
        ("table", &["--table-size", "256"]),
        ("interpolated", &["--shading", "phong"]),
        ("center", &["--shading", "phong", "--lighting", "center"]),
        ("centroid", &["--shading", "phong", "--lighting", "centroid", "--light", "1,2,0.5"]),
        ("lit", &["--integration", "sampled", "--shading", "phong", "--light-from", "0", "--specular", "0.4"]),
        ("surface", &[surface, "--isosurface", "45000"]),
        ("mip", &["--mode", "mip"]),
        ("minip", &["--mode", "minip"]),
        ("average", &["--mode", "average"]),
        ("clip", &["--clip", "0.5,3,0.5,3,0.5,3"]),
        ("planes", &["--shading", "phong", "--clip-plane", "1,0,0,1.5", "--clip-plane", "0,-1,0.3,-3"]),
        ("regions", &["--view", "regions"]),
        ("residual", &["--view", "residual", "--leap-tolerance", "0.01"]),
        ("none", &["--accel", "none"]),
        ("macro", &["--accel", "macro", "--macrocell", "8"]),
        ("nearest", &["--integration", "sampled", "--filter", "nearest"]),
        ("step", &["--step", "0.37", "--opacity-unit", "0.4", "--early-termination", "0.9"]),
        ("parallel", &["--parallel-scale", "1.7", "--filter", "exact"]),
    ];
    for (name, flags) in styles {
        let (picture, again) = (format!("{name}.exr"), format!("{name}-again.exr"));
        draw(at, &picture, &[&WINDOW, flags, &["--exact", "--local", "1"]].concat());
        let told = format!("{picture}.json");
        let said = brickcast_ok(at, &check(&told, &["--local", "3", "-o", &again]));
        assert!(said.contains("the same bits"), "{name}: {said}");
        let (first, second) = (manifest(at, &told), manifest(at, &format!("{again}.json")));
        for key in
            ["camera", "size", "step", "style", "transfer_function", "acceleration", "transport", "store", "path"]
        {
            assert_eq!(first[key], second[key], "{name}: {key}");
        }
    }
}

#[test]
fn pictures_of_every_format_are_compared_and_a_changed_one_is_told() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    draw(at, "a.png", &[&WINDOW[..], &["--background", "0.2,0.4,1"]].concat());
    draw(at, "b.png", &WINDOW);
    draw(at, "c.apng", &[&WINDOW[..], &["--frames", "3", "--orbit", "40", "--exact"]].concat());
    for (name, words) in [("a.png.json", "the same"), ("b.png.json", "the same"), ("c.apng.json", "all 3 frames")] {
        let said = brickcast_ok(at, &check(name, &["--local", "2"]));
        assert!(said.contains(words), "{name}: {said}");
    }
    brickcast_ok(at, &["render", "--scene", "c.apng.json", "-o", "d.apng", "--backend", "cpu", "-q"]);
    assert_eq!(manifest(at, "d.apng.json")["frames"].as_array().unwrap().len(), 3);
    assert_eq!(std::fs::read(at.join("c.apng")).unwrap(), std::fs::read(at.join("d.apng")).unwrap());

    // Another picture under the manifest's name; another scene in the manifest; another size.
    draw(at, "other.png", &[&WINDOW[..], &["--zoom", "2"]].concat());
    std::fs::copy(at.join("other.png"), at.join("b.png")).unwrap();
    let (code, said) = refused(at, &check("b.png.json", &[]));
    assert!(code == 1 && said.contains("pixels differ") && said.contains("in red"), "{said}");
    rewrite(at, "c.apng.json", |value| value["frames"][1]["step"] = json!(0.8));
    let (code, said) = refused(at, &check("c.apng.json", &[]));
    assert!(code == 1 && said.contains("frame 1") && said.contains("may not differ at all"), "{said}");
    rewrite(at, "a.png.json", |value| value["size"] = json!([20, 20]));
    let (code, said) = refused(at, &check("a.png.json", &[]));
    assert!(code == 1 && said.contains("48x36") && said.contains("20x20"), "{said}");
}

#[test]
fn the_store_is_found_by_path_by_the_manifest_and_by_nodes_and_must_be_the_one() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    draw(at, "a.exr", &[&WINDOW[..], &["--exact"]].concat());
    let node = NodeProcess::start(at, &["--backend", "cpu"]);
    let by_hash = ["render", "--scene", "a.exr.json", "--check", "--nodes", &node.address];
    assert!(brickcast_ok(at, &by_hash).contains("the same bits"));
    std::fs::rename(at.join("part"), at.join("moved")).unwrap();
    let (code, said) = refused(at, &check("a.exr.json", &[]));
    assert!(code == 1 && said.contains("part: no such file or store") && said.contains("give PATH"), "{said}");
    assert!(brickcast_ok(at, &check("a.exr.json", &["moved"])).contains("the same bits"));
    brickcast_ok(at, &["prepare", "part.nrrd", "another", "--brick", "32"]);
    let (code, said) = refused(at, &check("a.exr.json", &["another"]));
    let hash = manifest(at, "a.exr.json")["store"].as_str().unwrap().to_owned();
    assert!(code == 1 && said.contains(&hash) && said.matches("hash").count() == 2, "{said}");
    rewrite(at, "a.exr.json", |value| drop(value.as_object_mut().unwrap().remove("path")));
    let (code, said) = refused(at, &check("a.exr.json", &[]));
    assert!(code == 2 && said.contains("give PATH"), "{said}");
}

#[test]
fn what_contradicts_a_manifest_or_is_none_is_refused_by_name() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    draw(at, "a.png", &WINDOW);
    for flag in ["--step=1", "--azimuth=3", "--exact", "--mode=mip", "--accel=none", "--frames=2", "--window=1,2"] {
        let (code, said) = refused(at, &["render", "part", "--scene", "a.png.json", "-o", "b.png", flag]);
        let name = flag.split('=').next().unwrap();
        assert!(code == 2 && said.contains(name) && said.contains("--scene"), "{flag}: {said}");
    }
    let (code, said) = refused(at, &check("a.png.json", &["-o", "a.png"]));
    assert!(code == 2 && said.contains("--output"), "{said}");
    let (code, said) = refused(at, &["render", "--scene", "a.png.json", "-o", "b.png", "--stats", "a.png.json"]);
    assert!(code == 2 && said.contains("--stats"), "{said}");
    let good = manifest(at, "a.png.json");
    let spoiled = |name: &str, value: &Value| std::fs::write(at.join(name), value.to_string()).unwrap();
    let with = |key: &str, value: Value| {
        let mut spoiled = good.clone();
        spoiled[key] = value;
        spoiled
    };
    spoiled("step.json", &with("step", json!(99)));
    spoiled("word.json", &with("filter", json!("\u{1b}[31mcubic")));
    spoiled("huge.json", &with("size", json!([100_000_000, 3])));
    spoiled("foreign.json", &json!({ "RGBPoints": [0, 1, 1, 1] }));
    let text = good.to_string();
    std::fs::write(at.join("cut.json"), &text[..text.len() / 2]).unwrap();
    for (name, words) in [
        ("step.json", "step 99"),
        ("word.json", "filter = "),
        ("huge.json", "size = [100000000,3]"),
        ("foreign.json", "RGBPoints"),
        ("cut.json", "not JSON"),
        ("none.json", "none.json"),
    ] {
        let (code, said) = refused(at, &["render", "part", "--scene", name, "-o", "b.png"]);
        assert!(code == 1 && said.contains(words) && !said.contains('\u{1b}'), "{name}: {said}");
    }
    assert!(!at.join("b.png").exists());
}

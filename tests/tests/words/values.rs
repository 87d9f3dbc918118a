//! Words for values: axes, sides, cuts, colours, sizes.

use std::path::Path;

use brickcast_tests::process::{brickcast, brickcast_ok};
use serde_json::{Value, json};

/// A part that is longer along z than along y, and along y than along x, prepared; its otsu.
fn site() -> (tempfile::TempDir, f64) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "32,40,48", "--pores", "2"]);
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--brick", "16"]);
    let otsu = json_of(&brickcast_ok(at, &["info", "part", "--json"]))["otsu"].as_f64().unwrap();
    (folder, otsu)
}

fn json_of(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// What was said of a picture called `name`, and its manifest.
fn draw(at: &Path, name: &str, words: &[&str]) -> (String, Value) {
    let base = ["render", "part", "-o", name, "--backend", "cpu", "--exact"];
    let size: &[&str] = if words.contains(&"--size") { &[] } else { &["--size", "40"] };
    let output = brickcast(at, &[&base[..], size, words].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && output.stdout.is_empty(), "{words:?}: {said}");
    (said, json_of(&std::fs::read_to_string(at.join(format!("{name}.json"))).unwrap()))
}

fn refused(at: &Path, words: &[&str]) -> String {
    let output = brickcast(at, words);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{words:?}: {error}");
    assert!(!error.contains("panicked"), "{words:?}: {error}");
    error
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Words and the numbers that they stand for are the same picture, to the bit.
#[test]
fn a_word_draws_the_picture_of_its_number() {
    let (folder, otsu) = site();
    let at = folder.path();
    let info = json_of(&brickcast_ok(at, &["info", "part", "--json"]));
    let [z0, z1] = [4, 5].map(|i| info["bounds"][i].as_f64().unwrap());
    let otsu = otsu.to_string();
    let value = |color: &str| format!("{otsu}:{color}");
    let plane = format!("0,0,-1,{}", -(z0 + (z1 - z0) * 0.25));
    let (blue, glass) = (value("0,0,1"), value("0,0,1,0.25"));
    for (words, numbers) in [
        (vec!["--isosurface", "otsu:blue"], vec!["--isosurface", &blue]),
        (vec!["--isosurface", "otsu:#00f"], vec!["--isosurface", &blue]),
        (vec!["--isosurface", "otsu:blue,0.25"], vec!["--isosurface", &glass]),
        (vec!["--isosurface", "otsu:blue:0.25"], vec!["--isosurface", &glass]),
        (vec!["--cut", "z=25%"], vec!["--clip-plane", &plane]),
        (vec!["--cut", "z<25%"], vec!["--clip-plane", &plane]),
        (vec!["--background", "white"], vec!["--background", "1,1,1"]),
        (vec!["--background", "#ff8000"], vec!["--background", "1,0.5019607843137255,0"]),
        (vec!["--background", "none"], vec![]),
        (vec!["--colormap", "gray"], vec!["--colormap", "grayscale"]),
        (vec!["--colormap", "coolwarm"], vec!["--colormap", "cool-to-warm"]),
        (vec!["--size", "40"], vec!["--size", "40x40"]),
        (vec!["--from", "right"], vec!["--azimuth", "90"]),
        (vec!["--up", "y"], vec!["--azimuth", "0"]),
    ] {
        draw(at, "word.png", &words);
        draw(at, "number.png", &numbers);
        let [a, b] = ["word.png", "number.png"].map(|name| std::fs::read(at.join(name)).unwrap());
        assert!(a == b, "{words:?} and {numbers:?}");
    }
    // Neither half is the whole.
    let of = |name: &str, words: &[&str]| {
        draw(at, name, words);
        std::fs::read(at.join(name)).unwrap()
    };
    let [whole, below, above] = [&[][..], &["--cut", "x=50%"], &["--cut", "x>50%"]].map(|words| of("cut.png", words));
    assert!(whole != below && whole != above && below != above);
}

/// What the store had to tell is told, and the manifest has numbers.
#[test]
fn numbers_that_words_became_are_told_and_kept() {
    let (folder, otsu) = site();
    let at = folder.path();
    let (said, manifest) = draw(at, "a.png", &["--isosurface", "otsu", "--cut", "x>50%", "--cut", "z=10"]);
    assert!(said.contains(&format!("isosurface at {otsu} (Otsu's threshold)")), "{said}");
    assert!(said.contains("cut: what lies at x >= ") && said.contains("z <= 10 stays"), "{said}");
    let text = manifest.to_string();
    assert!(text.contains(&otsu.to_string()) && !text.contains('%'), "{text}");
    // From its manifest the same picture.
    brickcast_ok(at, &["render", "--scene", "a.png.json", "--check", "--backend", "cpu"]);
    for flag in ["--up=z", "--from=top", "--cut=z=1"] {
        let error = refused(at, &["render", "--scene", "a.png.json", "-o", "b.png", flag]);
        assert!(error.contains("cannot be used with"), "{error}");
    }
}

#[test]
fn the_chosen_axis_points_up_in_pictures_and_sequences() {
    let (folder, _) = site();
    let at = folder.path();
    let camera = |words: &[&str]| draw(at, "up.png", words).1["camera"].clone();
    let seen = |camera: &Value| {
        let (eye, focus) = (numbers(&camera["position"]), numbers(&camera["focalPoint"]));
        let length = eye.iter().zip(&focus).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let direction: Vec<i64> =
            eye.iter().zip(&focus).map(|(a, b)| (1000.0 * (a - b) / length).round() as i64).collect();
        (direction, numbers(&camera["viewUp"]))
    };
    for (words, direction, up) in [
        (&["--up", "z"][..], [0, -1000, 0], [0.0, 0.0, 1.0]),
        (&["--up", "z", "--from", "right"], [1000, 0, 0], [0.0, 0.0, 1.0]),
        (&["--up", "z", "--from", "iso"], [577, -577, 577], [0.0, 0.0, 1.0]),
        (&["--up", "z", "--from", "top"], [0, 0, 1000], [0.0, 1.0, 0.0]),
        (&["--up", "-z", "--azimuth", "90"], [-1000, 0, 0], [0.0, 0.0, -1.0]),
        (&["--up", "-y", "--elevation", "90"], [0, -1000, 0], [0.0, 0.0, -1.0]),
        (&["--up", "x"], [0, 0, 1000], [1.0, 0.0, 0.0]),
        (&["--from", "bottom"], [0, -1000, 0], [0.0, 0.0, 1.0]),
        (&["--position", "500,20,0", "--up", "z"], [999, 1, -44], [0.0, 0.0, 1.0]),
    ] {
        let (got, got_up) = seen(&camera(words));
        assert_eq!(got_up, up, "{words:?}");
        let near = got.iter().zip(direction).all(|(a, b)| (a - b).abs() <= 1 || words[0] == "--position");
        assert!(near, "{words:?}: {got:?}");
    }
    // A sequence goes around it: its height along z stays.
    let turn = ["--up", "z", "--elevation", "30", "--frames", "3"];
    brickcast_ok(at, &[&["render", "part", "-o", "t.apng", "--backend", "cpu", "--size", "16"][..], &turn].concat());
    let frames = json_of(&std::fs::read_to_string(at.join("t.apng.json")).unwrap())["frames"].clone();
    let height = |i: usize| numbers(&frames[i]["camera"]["position"])[2];
    assert!((height(0) - height(1)).abs() < 1e-9 && (height(0) - height(2)).abs() < 1e-9, "{frames}");
    assert_ne!(frames[0]["camera"]["position"], frames[1]["camera"]["position"]);
}

#[test]
fn words_that_are_none_or_contradict_are_refused_and_the_nearest_named() {
    let (folder, _) = site();
    let at = folder.path();
    for (words, why) in [
        (&["--up", "w"][..], "-z"),
        (&["--up", "z", "--view-up", "0,0,1"], "cannot be used with"),
        (&["--from", "abov"], "front"),
        (&["--from", "top", "--azimuth", "3"], "cannot be used with"),
        (&["--from", "top", "--position", "1,2,3"], "cannot be used with"),
        (&["--camera", "c.json", "--up", "z"], "cannot be used with"),
        (&["--camera", "c.json", "--from", "iso"], "cannot be used with"),
        (&["--cut", "z"], "quote < and >"),
        (&["--cut", "z=120%"], "between 0% and 100%"),
        (&["--isosurface", "otzu"], "neither a number nor otsu"),
        (&["--isosurface", "5:steelbleu"], "did you mean steelblue?"),
        (&["--background", "wite"], "did you mean white?"),
        (&["--background", "2,0,0"], "from 0 to 1"),
        (&["--background", "#ffffff80"], "not opaque"),
        (&["--colormap", "viridi"], "did you mean viridis?"),
        (&["--size", "8k"], "full-hd"),
    ] {
        let error = refused(at, &[&["render", "part", "-o", "x.png", "--backend", "cpu"][..], words].concat());
        assert!(error.contains(why), "{words:?}: {error}");
    }
    assert!(!at.join("x.png").exists());
}

/// `none` takes away what a manifest has, and says nothing of an .exr, which has none anyway.
#[test]
fn a_background_can_be_taken_away() {
    let (folder, _) = site();
    let at = folder.path();
    assert_eq!(draw(at, "a.png", &["--background", "neutral"]).1["background"].as_array().unwrap().len(), 3);
    draw(at, "b.png", &[]);
    brickcast_ok(at, &["render", "--scene", "a.png.json", "-o", "c.png", "--backend", "cpu", "--background", "none"]);
    let [a, b, c] = ["a.png", "b.png", "c.png"].map(|name| std::fs::read(at.join(name)).unwrap());
    assert!(b == c && a != b);
    draw(at, "d.exr", &["--background", "none"]);
}

#[test]
fn info_tells_the_box_and_what_to_try() {
    let (folder, otsu) = site();
    let at = folder.path();
    let text = brickcast_ok(at, &["info", "part.nrrd"]);
    let info = json_of(&brickcast_ok(at, &["info", "part.nrrd", "--json"]));
    let bounds = numbers(&info["bounds"]);
    let middle: Vec<f64> = bounds.chunks(2).map(|pair| (pair[0] + pair[1]) / 2.0).collect();
    let center = numbers(&info["center"]);
    assert!(center.iter().zip(&middle).all(|(a, b)| (a - b).abs() < 1e-9), "{center:?} {middle:?}");
    assert_eq!(info["suggested"]["isosurface"], json!(otsu));
    let [lo, hi] = [0, 1].map(|i| info["suggested"]["window"][i].as_f64().unwrap());
    assert_eq!((lo, hi), (otsu, info["quantiles"]["0.999"].as_f64().unwrap()));
    for words in [
        format!("{},{},{} to {},{},{}", bounds[0], bounds[2], bounds[4], bounds[1], bounds[3], bounds[5]),
        format!("centre {},{},{}", center[0], center[1], center[2]),
        format!("--window {lo},{hi}"),
        format!("--isosurface otsu (at {otsu})"),
        "--up z".to_owned(),
    ] {
        assert!(text.contains(&words), "`{words}`: {text}");
    }
    // What it suggests is the default.
    draw(at, "default.png", &["--opacity", "0.5"]);
    draw(at, "tried.png", &["--window", &format!("{lo},{hi}")]);
    assert!(std::fs::read(at.join("default.png")).unwrap() == std::fs::read(at.join("tried.png")).unwrap());
}

#[test]
fn a_volume_without_a_command_was_to_be_rendered() {
    let (folder, _) = site();
    let at = folder.path();
    for (words, want) in [
        (&["part.nrrd"][..], "brickcast render part.nrrd -o part.png"),
        (&["part"], "brickcast render part -o part.png"),
        (&["none/such.raw", "--from", "iso"], "brickcast render none/such.raw --from iso -o such.png"),
    ] {
        let error = refused(at, words);
        assert!(error.contains("did you mean") && error.contains(want), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
    assert!(refused(at, &["rendr", "part.nrrd"]).contains("subcommand"));
}

/// The pages as a user gets them; what is on them is tested beside them.
#[test]
fn help_has_two_pages() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["render", "bench", "balance"] {
        let [short, long] = ["-h", "--help"].map(|page| brickcast_ok(folder.path(), &[command, page]));
        assert!(short.lines().count() <= 50 && short.contains("--from") && !short.contains("--shininess"), "{short}");
        assert!(long.contains("--shininess") && long.contains("Examples"), "{long}");
    }
}

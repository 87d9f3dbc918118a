//! `--lod` on the command line: of stores, inputs and names, its errors, exit code and figures, and drawn again.

use std::path::Path;

use brickcast::output::exr;
use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok};
use brickcast_tests::turn;
use serde_json::{Value, json};

const LOOK: [&str; 12] = [
    "--window",
    "3000,52000",
    "--opacity",
    "0.3",
    "--colormap",
    "viridis",
    "--azimuth",
    "35",
    "--size",
    "64x48",
    "--backend",
    "cpu",
];

/// A folder with an input and a store of it, three levels deep.
fn site() -> tempfile::TempDir {
    let site = tempfile::tempdir().unwrap();
    brickcast_ok(site.path(), &["phantom", "part.nrrd", "--dims", "60,52,44", "--pores", "4", "--seed", "3"]);
    brickcast_ok(site.path(), &["prepare", "part.nrrd", "part", "--brick", "16"]);
    site
}

fn draw<'a>(path: &'a str, picture: &'a str, flags: &[&'a str]) -> Vec<&'a str> {
    [&["render", path, "-o", picture], &LOOK[..], flags].concat()
}

/// Exit code and what was said.
fn ended(at: &Path, args: &[&str]) -> (i32, String) {
    let output = brickcast(at, args);
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn bits(at: &Path, name: &str) -> Vec<[u32; 4]> {
    let picture = exr::read(&at.join(name)).unwrap();
    picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

fn json(at: &Path, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap()
}

#[test]
fn a_level_is_drawn_of_a_store_an_input_and_a_name() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    brickcast_ok(at, &draw("part", "one.exr", &["--lod", "1", "--exact"]));
    brickcast_ok(at, &draw("part", "full.exr", &["--exact"]));
    brickcast_ok(at, &draw("part", "zero.exr", &["--lod", "0", "--exact"]));
    assert!(bits(at, "full.exr") == bits(at, "zero.exr") && bits(at, "full.exr") != bits(at, "one.exr"));
    brickcast_ok(at, &draw("part.nrrd", "input.exr", &["--lod", "1", "--exact", "--brick", "16", "--local", "2"]));
    assert!(bits(at, "input.exr") == bits(at, "one.exr"), "prepared on the way");
    let node = NodeProcess::start(at, &["--backend", "cpu"]);
    // With the path of a store here, and, from another folder, with a name that only the node knows.
    let elsewhere = tempfile::tempdir().unwrap();
    for (from, picture) in [(at, "path.exr"), (elsewhere.path(), "name.exr")] {
        let drawn: Vec<&str> = draw("part", picture, &["--lod", "1", "--exact", "--nodes", &node.address]);
        let drawn: Vec<&str> = drawn.into_iter().filter(|word| !["--backend", "cpu"].contains(word)).collect();
        brickcast_ok(from, &drawn);
        assert!(bits(from, picture) == bits(at, "one.exr"), "{picture}");
    }
    let manifest = json(at, "one.exr.json");
    assert_eq!((&manifest["lod"], manifest["store"] == json(at, "full.exr.json")["store"]), (&json!(1), true));
    assert!(json(at, "full.exr.json").get("lod").is_none(), "full resolution is what there always was");
    let said = brickcast_ok(at, &["render", "--scene", "one.exr.json", "--check", "--local", "3", "--backend", "cpu"]);
    assert!(said.contains("the same bits"), "{said}");
    // By the store's hash alone.
    let by_hash = ["render", "--scene", "one.exr.json", "--check", "--nodes", &node.address];
    assert!(brickcast_ok(at, &by_hash).contains("the same bits"));
    let plan = brickcast_ok(at, &draw("part", "none.exr", &["--lod", "1", "--dry-run"]));
    assert!(plan.contains("30 x 26 x 22 voxels"), "{plan}");
}

#[test]
fn auto_tells_what_it_chose_and_is_drawn_again() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    let auto = ["--lod", "auto", "--exact", "--stats", "stats.json"];
    let (code, said) = ended(at, &draw("part", "coarse.exr", &[&auto[..], &["--pixel-error", "3"]].concat()));
    assert!(code == 4 && said.contains("lod auto: ") && said.contains("% of the volume's bricks' bytes"), "{said}");
    assert!(said.contains("complete picture written to coarse.exr, not at full resolution"), "{said}");
    let lod = &json(at, "stats.json")["lod"];
    let sum = |key: &str| lod[key].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum::<u64>();
    assert!(lod["chunks"].as_array().unwrap().len() == 3 && sum("chunks") > 0 && sum("bricks") > 0, "{lod}");
    assert!(sum("in_view") <= sum("chunks") && lod["share_of_bytes"].as_f64().unwrap() < 1.0, "{lod}");
    let manifest = json(at, "coarse.exr.json");
    assert_eq!(manifest["lod"], json!({ "criterion": "error", "pixel_error": 3.0 }));
    assert_eq!(manifest["complete"], json!(true));
    let again = ["render", "--scene", "coarse.exr.json", "--check", "--local", "2", "--backend", "cpu"];
    assert!(brickcast_ok(at, &again).contains("the same bits"));
    let redrawn = ["render", "--scene", "coarse.exr.json", "-o", "again.exr", "--local", "3", "--backend", "cpu"];
    assert_eq!(ended(at, &redrawn).0, 4);
    assert!(bits(at, "again.exr") == bits(at, "coarse.exr"));
    // Nothing in view is coarse: an ordinary picture.
    brickcast_ok(at, &draw("part", "full.exr", &["--exact"]));
    for (flags, lod) in [
        (&["--pixel-error", "0.001"][..], json!({ "criterion": "error", "pixel_error": 0.001 })),
        (&["--lod-criterion", "cone"], json!({ "criterion": "cone" })),
    ] {
        brickcast_ok(at, &draw("part", "fine.exr", &[&auto[..], flags].concat()));
        assert!(bits(at, "fine.exr") == bits(at, "full.exr"), "{flags:?}");
        assert_eq!(json(at, "fine.exr.json")["lod"], lod);
    }
    let focus = draw("part", "turn.apng", &["--lod", "auto", "--focus", "1,2,3", "--frames", "3", "--orbit", "40"]);
    let (code, said) = ended(at, &focus);
    assert!([0, 4].contains(&code), "{said}");
    assert_eq!(json(at, "turn.apng.json")["frames"][2]["lod"], json!({ "focus": [1.0, 2.0, 3.0] }));
    let (code, said) = ended(at, &draw("part", "b.exr", &[&auto[..], &["--balance", "static"]].concat()));
    assert!([0, 4].contains(&code) && said.contains("--balance static: frames of several levels"), "{said}");
}

/// What a frame's time allows is another picture each time; its manifest draws it again.
#[test]
fn a_frame_budget_is_kept_and_its_set_is_drawn_again() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    let within = |picture, budget, flags: &[&'static str]| {
        let auto = ["--lod", "auto", "--pixel-error", "0.01", "--frame-budget", budget, "--stats", "stats.json"];
        ended(at, &draw("part", picture, &[&auto[..], flags].concat()))
    };
    // No time at all: the coarsest level, and complete.
    let (code, said) = within("little.exr", "1us", &[]);
    assert!(code == 4 && said.contains("within 0 ms") && said.contains("not at full resolution"), "{code}: {said}");
    let lod = json(at, "stats.json")["lod"].clone();
    assert_eq!((&lod["in_view"][0], &lod["frame_budget"]["limit_ms"]), (&json!(0), &json!(0.001)), "{lod}");
    let manifest = json(at, "little.exr.json");
    let set = manifest["lod"]["set"].as_array().unwrap();
    assert!(set.iter().all(|run| run[0] == json!(2) && run[1].as_u64() > Some(0)), "{set:?}");
    // All the time: what was asked for.
    let (code, said) = within("much.exr", "1h", &[]);
    assert!(code == 0 && said.contains("within 3600000 ms"), "{code}: {said}");
    brickcast_ok(at, &draw("part", "full.exr", &[]));
    assert!(bits(at, "much.exr") == bits(at, "full.exr") && bits(at, "little.exr") != bits(at, "full.exr"));
    assert!(json(at, "stats.json")["lod"]["frame_budget"]["expected_ms"].as_f64().unwrap() > 0.0);
    for picture in ["little", "much"] {
        let manifest = format!("{picture}.exr.json");
        let again = ["render", "--scene", &manifest, "--check", "--backend", "cpu"];
        assert!(brickcast_ok(at, &again).contains("the same bits"), "{picture}");
    }
    // Frame by frame, each with its own.
    let (code, said) = within("turn.apng", "20ms", &["--frames", "4", "--orbit", "90"]);
    assert!([0, 4].contains(&code), "{said}");
    let frames = json(at, "turn.apng.json")["frames"].clone();
    assert!(frames.as_array().unwrap().iter().all(|frame| frame["lod"]["set"].is_array()), "{frames}");
    brickcast_ok(at, &["render", "--scene", "turn.apng.json", "--check", "--backend", "cpu"]);
    // A set of another volume.
    let mut other = json(at, "little.exr.json");
    other["lod"] = json!({ "set": [[0, 1]] });
    std::fs::write(at.join("other.json"), other.to_string()).unwrap();
    let (code, said) = ended(at, &["render", "--scene", "other.json", "-o", "other.exr", "--backend", "cpu"]);
    assert!(code == 1 && said.contains("set of levels is of 1 chunks"), "{code}: {said}");
}

#[test]
fn what_cannot_be_drawn_is_refused_with_the_way_out() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    brickcast_ok(at, &["prepare", "part.nrrd", "flat", "--brick", "16", "--levels", "0"]);
    for (path, flags, words) in [
        ("part", &["--lod", "7"][..], &["--lod 7", "levels 0 to 2", "--levels auto"][..]),
        ("flat", &["--lod", "1"], &["--lod 1", "level 0 alone", "prepare it anew"]),
        ("part", &["--lod", "7", "--dry-run"], &["no level 7", "levels 0 to 2"]),
        ("part", &["--lod", "half"], &["`half`", "full, auto"]),
        ("part", &["--pixel-error", "2"], &["--pixel-error", "--lod auto"]),
        ("part", &["--lod", "auto", "--pixel-error", "0"], &["pixel error 0"]),
        ("part", &["--lod", "auto", "--dry-run"], &["--dry-run", "one level"]),
        ("part", &["--lod", "auto", "--audit", "--accel", "all"], &["--audit", "one level"]),
        ("part", &["--lod", "auto", "--error", "e.exr", "--accel", "all"], &["--error", "one level"]),
        ("part", &["--frame-budget", "1s"], &["--frame-budget", "--lod auto"]),
        ("part", &["--lod", "auto", "--frame-budget", "1s", "--exact"], &["--frame-budget", "--exact", "--scene"]),
        ("part", &["--lod", "auto", "--frame-budget", "1s", "--progressive"], &["--progressive", "--frame-budget"]),
    ] {
        let (code, said) = ended(at, &draw(path, "none.exr", flags));
        assert!(code == 2 && words.iter().all(|word| said.contains(word)), "{flags:?}: {code} {said}");
        assert!(!at.join("none.exr").exists());
    }
    // A store of one level is drawn by auto as it is.
    brickcast_ok(at, &draw("flat", "flat.exr", &["--lod", "auto", "--exact"]));
    brickcast_ok(at, &draw("flat", "full.exr", &["--exact"]));
    assert!(bits(at, "flat.exr") == bits(at, "full.exr"));
}

/// Each picture is complete, the last is the one that is drawn without the flag.
#[test]
fn progressive_pictures_end_with_what_was_asked_for() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    brickcast_ok(at, &draw("part", "full.exr", &["--exact"]));
    let progressive = ["--progressive", "--exact", "--stats", "stats.json"];
    let (code, said) = ended(at, &draw("part", "p.exr", &progressive));
    let lines: Vec<&str> = said.lines().filter(|line| line.starts_with("picture ")).collect();
    assert!(code == 0 && lines.len() >= 3, "{code} {said}");
    assert!(lines[0].contains("picture 1 of") && lines[0].contains("of level 2"), "{said}");
    assert!(lines.last().unwrap().ends_with(": full resolution") && !lines[0].ends_with(": full resolution"), "{said}");
    assert!(bits(at, "p.exr") == bits(at, "full.exr"));
    assert_eq!(json(at, "p.exr.json"), {
        let mut full = json(at, "full.exr.json");
        for key in ["epoch", "nodes"] {
            full[key] = json(at, "p.exr.json")[key].clone();
        }
        full
    });
    let frames = json(at, "stats.json")["frames"].as_array().unwrap().clone();
    let shares: Vec<f64> = frames.iter().filter_map(|frame| frame["lod"]["share_of_pixels"].as_f64()).collect();
    assert!(frames.len() == lines.len() && shares.len() + 1 == frames.len(), "{frames:?}");
    assert!(shares.is_sorted() && shares[0] < 1.0, "{shares:?}");
    let changes: Vec<f64> = frames.iter().filter_map(|frame| frame["lod"]["change"]["mean"].as_f64()).collect();
    let is_told = said.lines().filter(|line| line.contains("full resolution changes")).count() == changes.len();
    assert!(is_told && changes.len() == shares.len() && changes[0] > *changes.last().unwrap(), "{changes:?}: {said}");
    // Up to an error, which is not full resolution.
    let coarse = ["--lod", "auto", "--pixel-error", "3", "--exact"];
    let (code, _) = ended(at, &draw("part", "coarse.exr", &coarse));
    let (progressive, said) = ended(at, &draw("part", "q.exr", &[&coarse[..], &["--progressive"]].concat()));
    assert!((code, progressive) == (4, 4) && bits(at, "q.exr") == bits(at, "coarse.exr"), "{said}");
    // A store without levels has one picture.
    brickcast_ok(at, &["prepare", "part.nrrd", "flat", "--brick", "16", "--levels", "0"]);
    let (code, said) = ended(at, &draw("flat", "flat.exr", &["--progressive"]));
    assert!(code == 0 && said.contains("picture 1 of 1"), "{said}");
    for (flags, words) in [
        (&["--frames", "3", "--orbit", "20"][..], "a sequence of frames"),
        (&["--lod", "1"], "--lod with a number"),
        (&["--dry-run"], "--dry-run draws nothing"),
    ] {
        let (code, said) = ended(at, &draw("part", "none.exr", &[&["--progressive"], flags].concat()));
        assert!(code == 2 && said.contains("--progressive") && said.contains(words), "{flags:?}: {code} {said}");
    }
}

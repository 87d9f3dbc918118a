//! What coarser levels hide, on the command line: a line, a file of places, stripes, statistics and manifests; and
//! drawn again.

use std::path::Path;

use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok};
use brickcast_tests::turn;
use serde_json::Value;

const LOOK: [&str; 12] = [
    "--window",
    "20000,22000",
    "--opacity",
    "0.5",
    "--colormap",
    "viridis",
    "--azimuth",
    "35",
    "--size",
    "96x64",
    "--backend",
    "cpu",
];

fn draw<'a>(picture: &'a str, flags: &[&'a str]) -> Vec<&'a str> {
    [&["render", "part", "-o", picture], &LOOK[..], flags].concat()
}

/// What was said on the way.
fn said(at: &Path, args: &[&str]) -> String {
    let ended = brickcast(at, args);
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.success(), "{args:?}: {said}");
    said
}

fn json(at: &Path, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap()
}

#[test]
fn what_a_level_hides_is_told_listed_and_marked() {
    let _turn = turn(module_path!());
    let site = tempfile::tempdir().unwrap();
    let at = site.path();
    brickcast_ok(at, &["phantom", "--store", "part", "--dims", "60,52,44", "--pores", "4", "--brick", "16"]);
    let told = ["--lod", "1", "--hidden", "all.json", "--stats", "stats.json"];
    let told_of = said(at, &draw("plain.png", &told));
    let (all, stats) = (json(at, "all.json"), json(at, "stats.json"));
    let counts = &all["counts"];
    let words = format!("coarser levels hide something in {} of {} cells", counts["cells"], counts["of"]);
    assert!(told_of.contains(&words), "{told_of}");
    let places = all["places"].as_array().unwrap();
    assert_eq!(places.len() as u64, counts["places"].as_u64().unwrap());
    assert!(places.len() > 64 && places[0]["level"] == 1, "{counts}");
    // Not all of them in statistics and manifest.
    let manifest = json(at, "plain.png.json");
    for short in [&stats["hidden"], &manifest["hidden"]] {
        assert_eq!((&short["counts"], short["places"].as_array().unwrap().len()), (counts, 64));
        assert!(short["places"].as_array().unwrap().iter().all(|place| places.contains(place)));
    }
    // The same from nodes elsewhere, which alone have the store.
    let node = NodeProcess::start(at, &["--backend", "cpu"]);
    let elsewhere = tempfile::tempdir().unwrap();
    let flags = [&told[..], &["--nodes", &node.address]].concat();
    let flags: Vec<&str> = draw("far.png", &flags).into_iter().filter(|w| !["--backend", "cpu"].contains(w)).collect();
    brickcast_ok(elsewhere.path(), &flags);
    assert_eq!(json(elsewhere.path(), "all.json"), all);
    // Several frames, of several levels.
    let turning = ["--lod", "auto", "--pixel-error", "4", "--hidden", "turn.json", "--frames", "2"];
    let ended = brickcast(at, &draw("turn.png", &turning));
    assert_eq!(ended.status.code(), Some(4));
    let frames = json(at, "turn.json")["frames"].clone();
    assert!(frames[0]["counts"]["cells"].as_u64() > Some(0) && frames.as_array().unwrap().len() == 2, "{frames}");
    // Full resolution hides nothing.
    let told_of = said(at, &draw("full.png", &["--hidden", "none.json"]));
    assert!(!told_of.contains("hide") && json(at, "none.json")["counts"]["cells"] == 0, "{told_of}");
    assert!(json(at, "full.png.json").get("hidden").is_none());

    brickcast_ok(at, &draw("marked.png", &["--lod", "1", "--mark-hidden"]));
    assert!(std::fs::read(at.join("marked.png")).unwrap() != std::fs::read(at.join("plain.png")).unwrap());
    for (picture, is_marked) in [("marked.png", true), ("plain.png", false)] {
        let manifest = format!("{picture}.json");
        assert_eq!(json(at, &manifest).get("marks_hidden").is_some(), is_marked);
        let again = ["render", "--scene", &manifest, "--check", "--local", "2", "--backend", "cpu"];
        let said = brickcast_ok(at, &again);
        assert!(said.contains("the same"), "{said}");
    }
    for (flags, words) in [
        (&["--lod", "1", "--hidden", "bad.png"][..], "the same file as the picture"),
        (
            &["--lod", "1", "--hidden", "a.json", "--stats", "a.json"],
            "--hidden a.json: that is the same file as --stats",
        ),
        (&["--lod", "1", "--hidden", "a.json", "--dry-run"], "--dry-run draws nothing"),
        (&["--lod", "1", "--mark-hidden", "--audit"], "leave --mark-hidden out"),
    ] {
        let ended = brickcast(at, &draw("bad.png", flags));
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(ended.status.code() == Some(2) && said.contains(words), "{flags:?}: {said}");
    }
}

//! Stores that cannot be read everywhere: drawn on the level that is there, and said
//! (docs/adr/0026-what-cannot-be-had.md).

use std::path::{Path, PathBuf};

use brickcast::output::exr;
use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok};
use brickcast_tests::turn;
use serde_json::{Value, json};

const LOOK: [&str; 9] =
    ["--window", "3000,52000", "--opacity", "0.3", "--azimuth", "35", "--size", "128x96", "--exact"];

/// A store of three levels, in bricks of 8: eight chunks along an edge.
fn site() -> tempfile::TempDir {
    let site = tempfile::tempdir().unwrap();
    brickcast_ok(site.path(), &["phantom", "part.nrrd", "--dims", "64,60,52", "--pores", "4", "--seed", "3"]);
    brickcast_ok(site.path(), &["prepare", "part.nrrd", "part", "--brick", "8"]);
    site
}

/// Exit code and what was said.
fn drawn(at: &Path, store: &str, picture: &str, flags: &[&str]) -> (i32, String) {
    let local = if flags.contains(&"--nodes") { &[][..] } else { &["--backend", "cpu"] };
    let args = [&["render", store, "-o", picture, "--stats", "stats.json"], &LOOK[..], local, flags].concat();
    let output = brickcast(at, &args);
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn bits(at: &Path, name: &str) -> Vec<[u32; 4]> {
    let picture = exr::read(&at.join(name)).unwrap();
    picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

fn json(at: &Path, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap()
}

/// The one shard of a level.
fn shard(at: &Path, store: &str, level: u8) -> PathBuf {
    at.join(format!("{store}/{level}/c/0/0/0"))
}

/// Flips a bit at a place between 0 and 1 of a file; what was there before.
fn flipped(path: &Path, place: f64) -> Vec<u8> {
    let before = std::fs::read(path).unwrap();
    let mut bytes = before.clone();
    let at = (bytes.len() as f64 * place) as usize;
    bytes[at] ^= 4;
    std::fs::write(path, bytes).unwrap();
    before
}

fn again(at: &Path, manifest: &str, local: &str) {
    let said = brickcast_ok(at, &["render", "--scene", manifest, "--check", "--local", local, "--backend", "cpu"]);
    assert!(said.contains("the same bits"), "{said}");
}

#[test]
fn a_flipped_bit_is_drawn_coarser_and_said_and_an_intact_store_draws_the_same() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    assert_eq!(drawn(at, "part", "full.exr", &[]).0, 0);
    let whole = flipped(&shard(at, "part", 0), 0.4);
    let (code, said) = drawn(at, "part", "hurt.exr", &[]);
    let told =
        ["complete picture written to hurt.exr, not at full resolution", "since not all can be read", "0/c/0/0/0"];
    assert!(code == 4 && told.iter().all(|words| said.contains(words)), "{code}: {said}");
    let stats = json(at, "stats.json");
    assert_eq!(stats["complete"], json!(true));
    let lod = &stats["lod"];
    let (fine, coarse) = (lod["in_view"][0].as_u64().unwrap(), lod["in_view"][1].as_u64().unwrap());
    assert!(fine > 0 && coarse > 0 && !lod["unreadable"].as_array().unwrap().is_empty(), "{lod}");
    let manifest = json(at, "hurt.exr.json");
    assert!(manifest["lod"]["set"].is_array() && manifest["complete"] == json!(true), "{manifest}");
    let (full, hurt) = (bits(at, "full.exr"), bits(at, "hurt.exr"));
    let differ = full.iter().zip(&hurt).filter(|(a, b)| a != b).count();
    assert!(differ > 0 && differ < full.len(), "{differ} of {} pixels", full.len());
    // From any number of nodes, in a sequence, coarse first, and with levels chosen.
    for flags in [&["--local", "3"][..], &["--progressive"]] {
        let (code, said) = drawn(at, "part", "other.exr", flags);
        assert!(code == 4 && bits(at, "other.exr") == hurt, "{flags:?}: {code}: {said}");
    }
    let turned = drawn(at, "part", "turn.apng", &["--frames", "3", "--orbit", "90"]);
    assert!(turned.0 == 4 && turned.1.contains("not all can be read"), "{turned:?}");
    let auto = drawn(at, "part", "auto.exr", &["--lod", "auto", "--pixel-error", "0.01"]);
    assert!(auto.0 == 4 && bits(at, "auto.exr") == hurt, "{auto:?}");
    // What was asked for by its number is not replaced.
    let (code, said) = drawn(at, "part", "zero.exr", &["--lod", "0"]);
    assert!(code == 3 && said.contains("0/c/0/0/0") && json(at, "zero.exr.json")["complete"] == json!(false), "{said}");
    assert_eq!(drawn(at, "part", "one.exr", &["--lod", "1"]).0, 0, "another level is whole");
    // The set is what the manifest says it is.
    std::fs::write(shard(at, "part", 0), whole).unwrap();
    again(at, "hurt.exr.json", "2");
    assert_eq!(drawn(at, "part", "full.exr", &[]).0, 0);
    assert!(bits(at, "full.exr") == full);
}

#[test]
fn whole_levels_that_are_gone_leave_the_next_one() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    let level = |level: &str| {
        assert_eq!(drawn(at, "part", "level.exr", &["--lod", level]).0, 0);
        bits(at, "level.exr")
    };
    let [one, two] = ["1", "2"].map(level);
    let all_zero = |path: &Path| std::fs::write(path, vec![0; std::fs::metadata(path).unwrap().len() as usize]);
    let cut = |path: &Path| std::fs::write(path, &std::fs::read(path).unwrap()[..100]);
    let removed = |path: &Path| std::fs::remove_file(path);
    type Damage<'a> = &'a dyn Fn(&Path) -> std::io::Result<()>;
    for (gone, left, damages) in [(0, one, &[&all_zero as Damage<'_>, &cut][..]), (1, two, &[&removed])] {
        let path = shard(at, "part", gone);
        for damage in damages {
            damage(&path).unwrap();
            for local in ["1", "2"] {
                let (code, said) = drawn(at, "part", "left.exr", &["--local", local]);
                assert!(code == 4 && bits(at, "left.exr") == left, "{gone}: {code}: {said}");
            }
        }
    }
    let output = brickcast(at, &["info", "part"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("0/c/0/0/0") && said.contains("brickcast verify"), "{said}");
    // Nothing is left.
    for level in 2..8 {
        let path = shard(at, "part", level);
        if path.exists() {
            all_zero(&path).unwrap();
        }
    }
    let (code, said) = drawn(at, "part", "none.exr", &[]);
    assert!(
        code == 1 && said.contains("nothing of the picture can be read") && !at.join("none.exr").exists(),
        "{said}"
    );
}

#[test]
fn a_store_of_one_level_is_drawn_with_a_hole() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    brickcast_ok(at, &["prepare", "part.nrrd", "flat", "--brick", "8", "--levels", "0"]);
    flipped(&shard(at, "flat", 0), 0.4);
    for local in ["1", "3"] {
        let (code, said) = drawn(at, "flat", "hole.exr", &["--local", local]);
        assert!(code == 3 && said.contains("incomplete picture written to hole.exr"), "{code}: {said}");
        assert!(said.contains("0/c/0/0/0") && !said.contains("waited for a node"), "{said}");
        let stats = json(at, "stats.json");
        assert!(stats["complete"] == json!(false) && stats["tiles"].as_u64().unwrap() > 0, "{stats}");
    }
}

/// Of two copies of a store one is damaged: the picture is whole.
#[test]
fn what_another_node_has_is_drawn_as_it_is() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    assert_eq!(drawn(at, "part", "full.exr", &[]).0, 0);
    let copy = tempfile::tempdir().unwrap();
    brickcast_ok(at, &["prepare", "part.nrrd", copy.path().join("part").to_str().unwrap(), "--brick", "8"]);
    flipped(&shard(copy.path(), "part", 0), 0.4);
    let nodes = [copy.path(), at].map(|data| NodeProcess::start(data, &["--backend", "cpu"]));
    let addresses = nodes.each_ref().map(|node| node.address.clone()).join(",");
    let (code, said) = drawn(at, "part", "both.exr", &["--nodes", &addresses]);
    assert!(code == 0 && bits(at, "both.exr") == bits(at, "full.exr"), "{code}: {said}");
    let stats = json(at, "stats.json");
    assert!(
        stats["reissued"].as_u64().unwrap() > 0 && stats["lost"][0]["address"] == json!(nodes[0].address),
        "{stats}"
    );
}

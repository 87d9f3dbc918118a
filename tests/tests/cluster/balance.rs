//! Two and three local nodes: from an uneven share to an even one, and every picture keeps its bits.
//!
//! Load is counted as cost times the declared throttle, which is the same in every run; wall times of nodes that share
//! cores say nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use brickcast_tests::process::{NodeProcess, brickcast_ok};
use brickcast_tests::turn;
use serde_json::Value;

/// From this frame on the load must be even.
const SETTLED: usize = 20;
const EVEN: f64 = 1.10;
/// A chunk may change hands once in so many frames.
const HOLD: usize = 30;

/// 128 x 64 x 64 voxels in bricks of 16, all of them shown: one half is full of material, in the other a speck in each
/// brick.
fn one_sided(folder: &Path) {
    let dims = [128_usize, 64, 64];
    let mut bytes =
        format!("NRRD0004\ntype: uint8\ndimension: 3\nsizes: {} {} {}\nencoding: raw\n\n", dims[0], dims[1], dims[2])
            .into_bytes();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let noise = ((x * 7919 + y * 104_729 + z * 1_299_709) % 97) as u8;
                let speck = [x, y, z].iter().all(|v| (7..9).contains(&(v % 16)));
                bytes.push(if x < dims[0] / 2 {
                    100 + noise
                } else if speck {
                    250
                } else {
                    0
                });
            }
        }
    }
    std::fs::write(folder.join("part.nrrd"), bytes).unwrap();
    brickcast_ok(folder, &["prepare", "part.nrrd", "part", "--brick", "16"]);
}

fn node(folder: &Path, extra: &[&str]) -> NodeProcess {
    NodeProcess::start(folder, &[&["--backend", "cpu"], extra].concat())
}

/// The frames of `brickcast balance`.
fn frames(folder: &Path, nodes: &[&NodeProcess], extra: &[&str]) -> Vec<Value> {
    let nodes = nodes.iter().map(|n| n.address.as_str()).collect::<Vec<_>>().join(",");
    let mut args =
        vec!["balance", "part", "--nodes", &nodes, "--exact", "--load-by", "samples", "--json", "balance.json"];
    args.extend(["--window", "50,255", "--opacity", "0.05", "--accel", "ess"]);
    args.extend(extra);
    let said = brickcast_ok(folder, &args);
    eprintln!("{}", said.trim().lines().last().unwrap());
    let json: Value = serde_json::from_slice(&std::fs::read(folder.join("balance.json")).unwrap()).unwrap();
    json["frames"].as_array().unwrap().clone()
}

fn with<'a>(path: &[&'a str], extra: &[&'a str]) -> Vec<&'a str> {
    [path, extra].concat()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn ratios(frames: &[Value]) -> Vec<f64> {
    frames.iter().map(|f| number(&f["max_over_mean"])).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn same_pictures(frames: &[Value], reference: &[Value]) {
    assert_eq!(frames.len(), reference.len());
    for (i, (frame, one)) in frames.iter().zip(reference).enumerate() {
        assert!(frame["complete"] == true, "frame {i}");
        assert_eq!(frame["picture"], one["picture"], "frame {i} has other bits than one node's");
    }
    let different: BTreeSet<String> = reference.iter().map(|f| f["picture"].to_string()).collect();
    assert!(different.len() * 2 > reference.len(), "the camera moves");
}

/// No chunk changes hands, and none is loaded on the same node, twice within [`HOLD`] frames.
fn no_oscillation(frames: &[Value]) {
    let mut changed: BTreeMap<String, usize> = BTreeMap::new();
    let mut seldom = |what: String, i: usize| {
        if let Some(before) = changed.insert(what.clone(), i) {
            assert!(i - before >= HOLD, "{what} in frames {before} and {i}");
        }
    };
    let mut loads = 0;
    for (i, frame) in frames.iter().enumerate() {
        let balance = &frame["balance"];
        for chunk in balance["moved"].as_array().unwrap() {
            seldom(format!("chunk {chunk} changes hands"), i);
        }
        for load in balance["loads"].as_array().unwrap() {
            for chunk in load["chunks"].as_array().unwrap() {
                seldom(format!("chunk {chunk} is loaded on {}", load["seat"]), i);
                loads += 1;
            }
        }
    }
    assert!(loads > 0, "nothing was loaded elsewhere, so nothing is shown");
}

fn both_render(frames: &[Value]) {
    for (i, frame) in frames.iter().enumerate() {
        let nodes = frame["nodes"].as_array().unwrap();
        assert!(nodes.len() == 2 && nodes.iter().all(|n| number(&n["layers"]) > 0.0), "frame {i}: {nodes:?}");
    }
}

/// From the even split of `--balance off` to an even load within 20 frames, and it stays even. Load is counted in
/// samples, so that long steps have the ratios of short ones.
fn becomes_even(folder: &Path, nodes: [&NodeProcess; 2], step: &str, at_first: f64) {
    // From the front: as the default view has it, nodes' shares of the part are more alike.
    let path = ["--frames", "60", "--orbit", "40", "--size", "192x192", "--azimuth", "0", "--step", step];
    let still = with(&path, &["--balance", "off"]);
    let one = frames(folder, &nodes[..1], &still);
    let off = frames(folder, &nodes, &still);
    let dynamic = frames(folder, &nodes, &path);
    same_pictures(&off, &one);
    same_pictures(&dynamic, &one);
    both_render(&dynamic);
    no_oscillation(&dynamic);
    let (off, dynamic) = (ratios(&off), ratios(&dynamic));
    eprintln!("off {:.2}; dynamic {:.2?}", mean(&off), dynamic);
    assert!(off.iter().all(|r| *r > at_first), "the split by bricks must be uneven: {off:.2?}");
    assert!(dynamic[0] > at_first, "it starts from there: {dynamic:.2?}");
    assert!(dynamic[SETTLED..].iter().all(|r| *r <= EVEN), "{dynamic:.2?}");
}

#[test]
fn a_one_sided_volume_on_two_equal_nodes() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    one_sided(folder.path());
    let nodes = [node(folder.path(), &[]), node(folder.path(), &[])];
    becomes_even(folder.path(), [&nodes[0], &nodes[1]], "1", 1.4);
}

#[test]
fn a_node_throttled_to_a_third() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    brickcast_ok(folder.path(), &["phantom", "part.nrrd", "--dims", "96,96,96", "--pores", "20"]);
    brickcast_ok(folder.path(), &["prepare", "part.nrrd", "part", "--brick", "16"]);
    let nodes = [node(folder.path(), &[]), node(folder.path(), &["--throttle", "3"])];
    becomes_even(folder.path(), [&nodes[0], &nodes[1]], "3", 1.3);
}

/// A dive puts most of the work into few chunks: copies and shared tiles must help, and change no bit.
#[test]
fn a_dive_on_three_nodes_needs_copies_and_shared_tiles() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    one_sided(folder.path());
    let nodes = [(); 3].map(|()| node(folder.path(), &[]));
    let all: Vec<&NodeProcess> = nodes.iter().collect();
    let path = ["--frames", "48", "--camera-path", "dive", "--orbit", "90", "--azimuth", "-70", "--size", "256x256"];
    let one = frames(folder.path(), &all[..1], &with(&path, &["--balance", "off"]));
    let fixed = frames(folder.path(), &all, &with(&path, &["--balance", "static"]));
    let bare = frames(folder.path(), &all, &with(&path, &["--replicas", "1", "--no-split"]));
    let dynamic = frames(folder.path(), &all, &path);
    for other in [&fixed, &bare, &dynamic] {
        same_pictures(other, &one);
    }
    let splits = dynamic.iter().filter(|f| number(&f["balance"]["splits"]) > 0.0).count();
    assert!(splits > 0, "no chunk was ever shared");
    assert!(number(&dynamic[47]["balance"]["copies"]) > 0.0, "nothing was ever copied");
    let later = |frames: &[Value]| mean(&ratios(frames)[SETTLED..]);
    let (fixed, bare, dynamic) = (later(&fixed), later(&bare), later(&dynamic));
    eprintln!(
        "max/mean from frame {SETTLED} on: static {fixed:.2}, dynamic without copies {bare:.2}, dynamic {dynamic:.2}"
    );
    assert!(dynamic < 1.25 && dynamic < 0.8 * fixed && dynamic < bare, "{fixed:.2}, {bare:.2}, {dynamic:.2}");
}

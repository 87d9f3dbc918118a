//! `brickcast phantom --store`: a store without a file between.

use std::path::Path;
use std::process::Command;

use brickcast_tests::process::{brickcast, brickcast_both, brickcast_ok};
use serde_json::Value;

use crate::interrupts::names;

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn refused(at: &Path, args: &[&str], code: i32) -> String {
    let ended = brickcast(at, args);
    let text = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(code), "{args:?}: {text}");
    text
}

const WHAT: [&str; 8] = ["--dims", "80,72,64", "--pores", "5", "--seed", "4", "--noise", "1"];

#[test]
fn a_phantom_goes_straight_into_a_store_with_the_truth_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = |first: &[&str], more: &[&str]| {
        let args: Vec<&str> = first.iter().chain(&WHAT).chain(more).copied().collect();
        brickcast_both(at, &args).1
    };
    let options = ["--brick", "32", "--levels", "1", "--segmentation-range", "0.05", "--min-region", "9"];
    let said = run(&["phantom", "--store", "v.2"], &options);
    assert!(said.contains("80 x 72 x 64 voxels") && said.contains("v.2.pores.json"), "{said}");
    assert_eq!(names(at), ["v.2", "v.2.pores.json"]);
    run(&["phantom", "v.nrrd"], &[]);
    brickcast_ok(at, &[&["prepare", "v.nrrd", "w"][..], &options].concat());

    // The same but for what names the input.
    let shards = |store: &str| std::fs::read(at.join(store).join("shards.bin")).unwrap();
    assert!(shards("v.2") == shards("w"));
    let [mut got, mut want] = ["v.2", "w"].map(|store| json(&at.join(store).join("brickcast.json")));
    assert_eq!(got["source"]["name"], "phantom, 5 pores, seed 4, noise 1 %");
    for manifest in [&mut got, &mut want] {
        drop(manifest["source"].take());
        drop(manifest["files"]["zarr.json"].take());
        manifest["levels"].as_array_mut().unwrap().iter_mut().for_each(|level| drop(level["hash"].take()));
    }
    assert_eq!(got, want);
    let [mut got, mut want] = ["v.2.pores.json", "v.pores.json"].map(|truth| json(&at.join(truth)));
    assert_eq!((got["volume"].take(), want["volume"].take()), ("v.2".into(), "v.nrrd".into()));
    assert_eq!(got, want);
}

#[test]
fn what_is_there_stays_and_what_cannot_be_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let make = ["phantom", "--store", "s", "--dims", "32,32,32", "--pores", "0"];
    let more = |more: &[&'static str]| [&make[..], more].concat();
    brickcast_ok(at, &make);
    let error = refused(at, &make, 1);
    assert!(error.contains("s.pores.json") && error.contains("--force"), "{error}");
    std::fs::remove_file(at.join("s.pores.json")).unwrap();
    let error = refused(at, &make, 1);
    assert!(error.contains("s exists already") && error.contains("--force"), "{error}");
    assert_eq!(names(at), ["s"]);
    brickcast_ok(at, &more(&["--force", "--brick", "16"]));
    assert_eq!(names(at), ["s", "s.pores.json"]);

    assert!(refused(at, &["phantom"], 2).contains("--store"));
    assert!(refused(at, &more(&["v.nrrd"]), 2).contains("--store"));
    assert!(refused(at, &more(&["--force", "--brick", "12"]), 2).contains("12"));
    assert!(refused(at, &["phantom", "--store", "s/.."], 2).contains("names no folder"));
    for alone in [["--brick", "16"], ["--levels", "0"], ["--range", "0,9"], ["--segmentation-range", "0.03"]] {
        let error = refused(at, &[&["phantom", "v.nrrd"][..], &alone].concat(), 2);
        assert!(error.contains("--store"), "{error}");
    }
    assert_eq!(names(at), ["s", "s.pores.json"]);
}

/// Free bytes where `at` lies.
fn free(at: &Path) -> u64 {
    let said = Command::new("df").arg("-Pk").arg(at).output().unwrap().stdout;
    let said = String::from_utf8_lossy(&said).into_owned();
    let row: Vec<&str> = said.lines().nth(1).unwrap().split_whitespace().collect();
    row[3].parse::<u64>().unwrap() << 10
}

#[test]
fn a_disk_that_is_clearly_too_small_is_told_of_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    if free(at) > 500 << 30 {
        brickcast_harness::ignore_anyway("this disk has room for the largest phantom");
    }
    let error = refused(at, &["phantom", "--store", "s", "--dims", "8192,8192,8192", "--pores", "0"], 1);
    assert!(error.contains("[8192, 8192, 8192]") && error.contains("are free there; make room"), "{error}");
    assert_eq!(names(at), [""; 0]);
}

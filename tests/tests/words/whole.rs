//! A store is absent or whole, whenever its writer is killed; and each of its chunks is watched over.

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::Instant;

use brickcast_tests::process::{brickcast, brickcast_command, brickcast_ok};
use brickcast_tests::turn;
use brickcast_volume::store::{CHUNK_EDGE, SHARD_EDGE};
use serde_json::Value;

use crate::interrupts::{is_temporary, names};

/// Kills `prepare` at `count` points all over the time that it takes, with and without a store that is there already.
fn killed(count: u32) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "96,80,90", "--pores", "3"]);
    let args = ["prepare", "part.nrrd", "s", "--brick", "16", "--segmentation-range", "0.03", "--force"];
    let started = Instant::now();
    brickcast_ok(at, &args);
    let whole = started.elapsed();
    let hash = |at: &Path| -> Value {
        let told = brickcast_ok(at, &["verify", "s", "--json"]);
        serde_json::from_str::<Value>(&told).unwrap()["hash"].clone()
    };
    let want = hash(at);
    let mut in_the_middle = 0;
    for i in 0..count {
        let is_there = i % 2 == 0;
        if !is_there {
            fs::remove_dir_all(at.join("s")).unwrap();
        }
        let mut command = brickcast_command(at);
        command.args(args).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        // By the golden ratio: evenly spread, and never the same.
        std::thread::sleep(whole.mul_f64((f64::from(i) * 0.618_033_988_75).fract()));
        child.kill().unwrap();
        child.wait().unwrap();
        in_the_middle += u32::from(names(at).iter().any(|name| is_temporary(name)));
        if at.join("s").exists() {
            assert_eq!(hash(at), want, "point {i}");
        } else {
            assert!(!is_there, "point {i}: what was there is gone");
            brickcast_ok(at, &args);
        }
    }
    assert!(in_the_middle > 0, "none of {count} was killed in the middle of {whole:?}");
    brickcast_ok(at, &args);
    assert_eq!(names(at).len(), 3, "{:?}", names(at));
}

#[test]
fn a_store_is_absent_or_whole_whenever_its_writer_is_killed() {
    killed(10);
}

#[test]
#[ignore = "slow"]
fn a_store_is_absent_or_whole_at_fifty_points() {
    killed(50);
}

/// Where a shard's index has its inner chunks: their slots, x fastest in a store of one shard, and their bytes.
fn chunks(shard: &[u8]) -> Vec<(u32, std::ops::Range<usize>)> {
    let count = (SHARD_EDGE / CHUNK_EDGE).pow(3) as usize;
    let index = &shard[shard.len() - 4 - 16 * count..shard.len() - 4];
    let number = |b: &[u8]| u64::from_le_bytes(b.try_into().unwrap());
    let places = index.chunks(16).map(|entry| (number(&entry[..8]), number(&entry[8..])));
    let present = (0..).zip(places).filter(|(_, (start, _))| *start != u64::MAX);
    present.map(|(slot, (start, length))| (slot, start as usize..(start + length) as usize)).collect()
}

/// Bricks of a chunk each: of others, rays meet some chunks as copies in halos.
/// Of every chunk of every array one bit in turn: `verify` names that chunk and no other, `render` draws without it and
/// ends with 3.
#[test]
fn a_flipped_bit_is_noticed_in_every_chunk() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "32,32,32", "--pores", "0", "--noise", "3"]);
    let making = ["--brick", "16", "--levels", "0", "--segmentation-range", "0.2"];
    brickcast_ok(at, &[&["prepare", "part.nrrd", "s"][..], &making].concat());
    let edge = SHARD_EDGE / CHUNK_EDGE;
    let mut seen = 0;
    for array in ["0", "labels/regions/0", "distances"] {
        let path = at.join("s").join(array).join("c/0/0/0");
        let whole = fs::read(&path).unwrap();
        let all = chunks(&whole);
        assert!(array != "0" || all.len() == 8, "{all:?}");
        for (slot, bytes) in all {
            let mut broken = whole.clone();
            broken[(bytes.start + bytes.end) / 2] ^= 1 << (slot % 8);
            fs::write(&path, broken).unwrap();
            let output = brickcast(at, &["verify", "s", "--json"]);
            let told: Value = serde_json::from_slice(&output.stdout).unwrap();
            let faults = told["faults"].as_array().unwrap();
            let chunk = format!("inner chunk ({}, {}, {})", slot % edge, slot / edge % edge, slot / edge / edge);
            assert!(output.status.code() == Some(1) && faults.len() == 1, "{array} {chunk}: {faults:?}");
            let what = faults[0]["what"].as_str().unwrap();
            assert!(what.contains(&chunk), "{array} {chunk}: {what}");
            if array == "0" {
                let look =
                    ["-o", "p.png", "--size", "48", "--backend", "cpu", "--window", "0,20000", "--accel", "none"];
                let output = brickcast(at, &[&["render", "s"][..], &look].concat());
                let said = String::from_utf8_lossy(&output.stderr).into_owned();
                assert!(output.status.code() == Some(3) && said.contains("0/c/0/0/0"), "{chunk}: {said}");
            }
            seen += 1;
        }
        fs::write(&path, whole).unwrap();
    }
    assert!(seen > 12, "{seen}");
    brickcast_ok(at, &["verify", "s"]);
}

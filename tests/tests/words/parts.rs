//! Preparing in parts, by real processes: at once, killed at any time, and begun again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use brickcast_tests::patience::output;
use brickcast_tests::process::{brickcast, brickcast_both, brickcast_command, brickcast_ok};

use crate::interrupts::{PATIENCE, names};

/// Every file below, with its content.
fn content(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut files, mut open) = (BTreeMap::new(), vec![root.to_path_buf()]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                files.insert(path.strip_prefix(root).unwrap().to_path_buf(), std::fs::read(&path).unwrap());
            }
        }
    }
    files
}

fn check_same(got: &Path, want: &BTreeMap<PathBuf, Vec<u8>>, what: &str) {
    let got = content(got);
    assert!(got.keys().eq(want.keys()), "{what}");
    for (name, bytes) in want {
        assert!(got[name] == *bytes, "{what}: {} differs", name.display());
    }
}

fn refused(at: &Path, args: &[&str], code: i32) -> String {
    let ended = brickcast(at, args);
    let text = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(code), "{args:?}: {text}");
    text
}

const OPTIONS: [&str; 4] = ["--brick", "32", "--segmentation-range", "0.05"];

fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    ["prepare", "v.nrrd", "s"].iter().chain(&OPTIONS).chain(more).copied().collect()
}

/// Three parts of a volume whose last one is of few planes, with regions, and what one go makes of it.
fn phantom(at: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    brickcast_ok(at, &["phantom", "v.nrrd", "--dims", "96,80,530", "--pores", "12"]);
    let whole: Vec<&str> = ["prepare", "v.nrrd", "whole"].iter().chain(&OPTIONS).copied().collect();
    brickcast_ok(at, &whole);
    content(&at.join("whole"))
}

#[test]
fn parts_at_once_and_one_killed_make_the_bytes_of_one_go() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let want = phantom(at);
    let start = |part: &str| {
        let mut command = brickcast_command(at);
        command.args(with(&["--shard", part])).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    };
    let mut all: Vec<_> = ["2/3", "0/3", "1/3", "1/3"].into_iter().map(|part| (part, start(part))).collect();
    let killed = all.remove(1);
    let mut killed = killed.1;
    std::thread::sleep(Duration::from_millis(30));
    killed.kill().unwrap();
    killed.wait().unwrap();
    for (part, child) in all {
        let ended = output(child, PATIENCE, part);
        let text = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.success() && text.contains(&format!("s: part {part}, planes ")), "{text}");
    }
    if !at.join(".s.brickcast-parts/0-of-3/part").exists() {
        let text = refused(at, &with(&["--merge"]), 1);
        assert!(text.contains("of 3 parts 0 are missing in "), "{text}");
    }
    brickcast_ok(at, &with(&["--shard", "0/3"]));
    let (_, text) = brickcast_both(at, &with(&["--shard", "0/3"]));
    assert!(text.contains("s: part 0/3, planes 0 to 255, was there already, in .s.brickcast-parts"), "{text}");
    brickcast_ok(at, &with(&["--merge"]));
    check_same(&at.join("s"), &want, "merged");
    assert!(!at.join(".s.brickcast-parts").exists(), "{:?}", names(at));
    brickcast_ok(at, &["verify", "s"]);
}

#[test]
fn whatever_is_wrong_with_a_part_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    brickcast_ok(at, &["phantom", "v.nrrd", "--dims", "40,40,300", "--pores", "1"]);
    for (args, code, text) in [
        (&["--shard", "2/2"][..], 2, "`2/2` is no part I/N"),
        (&["--shard", "one"], 2, "I counts from 0 and is below N"),
        (&["--scan"], 2, "--shard"),
        (&["--shard", "0/2", "--merge"], 2, "cannot be used with"),
        (&["--merge", "--resume"], 2, "cannot be used with"),
        (&["--shard", "0/9"], 1, "this volume has 2 layers of 256 planes"),
        (&["--merge"], 1, "there are no parts in "),
    ] {
        let said = refused(at, &with(args), code);
        assert!(said.contains(text), "{args:?}: {said}");
    }
    let (_, text) = brickcast_both(at, &with(&["--shard", "0/2", "--scan"]));
    assert!(text.contains("voxels of uint16 are stored as they are, there is nothing to scan"), "{text}");
    assert_eq!(names(at), ["v.nrrd", "v.pores.json"]);
    // Another input under the same name.
    brickcast_ok(at, &with(&["--shard", "0/2"]));
    brickcast_ok(at, &["phantom", "v.nrrd", "--dims", "40,40,300", "--pores", "1", "--seed", "2", "--force"]);
    for args in [&["--shard", "0/2"][..], &["--merge"], &["--resume"]] {
        let said = refused(at, &with(args), 1);
        assert!(said.contains("part 0/2 in ") && said.contains("file 0 of the input was v.nrrd, "), "{said}");
    }
}

/// Kills a process that prepares, at a time that `when` tells from what is there; false where it ended before.
fn killed(at: &Path, what: &str, mut when: impl FnMut(Duration) -> bool) -> bool {
    let mut command = brickcast_command(at);
    command.args(with(&["--resume"])).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let started = Instant::now();
    while !when(started.elapsed()) {
        assert!(started.elapsed() < PATIENCE, "{what}");
        if child.try_wait().unwrap().is_some() {
            let ended = output(child, PATIENCE, what);
            assert!(ended.status.success(), "{what}: {}", String::from_utf8_lossy(&ended.stderr));
            return false;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    !child.wait().unwrap().success()
}

/// Goes on with what is there, to the bytes of one go, and clears up; what was said.
fn gone_on(at: &Path, want: &BTreeMap<PathBuf, Vec<u8>>, what: &str) -> String {
    let (_, text) = brickcast_both(at, &with(&["--resume"]));
    check_same(&at.join("s"), want, what);
    let left = names(at);
    assert!(left.iter().all(|name| !name.contains(".brickcast-")), "{what}: {left:?}");
    std::fs::remove_dir_all(at.join("s")).unwrap();
    text
}

#[test]
fn what_was_killed_at_any_time_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let want = phantom(at);
    let started = Instant::now();
    let text = gone_on(at, &want, "without a kill");
    let all = started.elapsed();
    assert!(text.contains("s: nothing to go on from, 3 parts to make"), "{text}");
    // As soon as something is there: what follows it is not.
    let part = |i: u32| at.join(format!(".s.brickcast-parts/{i}-of-3/part"));
    for (i, found) in [(0, "1 of 3 parts are there, 2 to make"), (1, "2 of 3 parts are there, 1 to make")] {
        let what = format!("killed after part {i}");
        assert!(killed(at, &what, |_| part(i).exists()), "{what}");
        let text = gone_on(at, &want, &what);
        assert!(text.contains(found), "{what}: {text}");
    }
    let (joined, store) = (at.join(".s.brickcast-parts/joined"), at.join("s"));
    for (what, path) in [("before the store is at its place", &joined), ("before its parts are gone", &store)] {
        if killed(at, what, |_| path.exists()) {
            gone_on(at, &want, what);
        } else {
            std::fs::remove_dir_all(&store).unwrap();
        }
    }
    // At any time, and again and again.
    let mut state = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_nanos() as u64 | 1;
    for round in 0..6 {
        let mut times = Vec::new();
        for _ in 0..3 {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let time = all.mul_f64((state % 1000) as f64 / 1000.0);
            times.push(time);
            if !killed(at, "at any time", |passed| passed >= time) {
                std::fs::remove_dir_all(at.join("s")).unwrap();
            }
        }
        gone_on(at, &want, &format!("round {round}, killed after {times:?} of {all:?}"));
    }
}

/// A journal that was cut, has a bit that flipped, or lies there for another input.
#[test]
fn a_damaged_journal_is_made_good_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let want = phantom(at);
    for (file, damage) in [
        ("part.json", "cut"),
        ("part.json", "flipped"),
        ("0/c/0/0/0", "flipped"),
        ("0/c/0/0/0", "cut"),
        ("halos.bin", "flipped"),
        ("voxels-1", "flipped"),
        ("statistics.bin", "gone"),
    ] {
        let what = format!("{file} {damage}");
        brickcast_ok(at, &with(&["--shard", "0/3"]));
        brickcast_ok(at, &with(&["--shard", "1/3"]));
        let path = at.join(".s.brickcast-parts/0-of-3/part").join(file);
        let mut bytes = std::fs::read(&path).unwrap();
        match damage {
            "cut" => bytes.truncate(bytes.len() / 2),
            "flipped" => {
                let middle = bytes.len() / 2;
                bytes[middle] ^= 4;
            }
            _ => {}
        }
        std::fs::write(&path, &bytes).unwrap();
        if damage == "gone" {
            std::fs::remove_file(&path).unwrap();
        }
        let text = refused(at, &with(&["--merge"]), 1);
        assert!(text.contains("part 0/3 is damaged: ") && text.contains(file), "{what}: {text}");
        let text = gone_on(at, &want, &what);
        assert!(text.contains("1 of 3 parts are there, 2 to make"), "{what}: {text}");
    }
}

/// Voxels of 32 bits: all parts are scanned before the first is made.
#[test]
fn mapped_voxels_are_scanned_in_parts_first() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let voxels = (0..30 * 20 * 300_u32).flat_map(|i| (f64::from(i).sin() as f32 * 1e-3 * i as f32).to_le_bytes());
    std::fs::write(at.join("v.raw"), voxels.collect::<Vec<u8>>()).unwrap();
    let with = |out: &'static str, more: &[&'static str]| {
        let shape = ["--dims", "30,20,300", "--type", "float32"];
        ["prepare", "v.raw", out].iter().chain(&shape).chain(more).copied().collect::<Vec<_>>()
    };
    brickcast_ok(at, &with("whole", &[]));
    let want = content(&at.join("whole"));
    let text = refused(at, &with("s", &["--shard", "0/2"]), 1);
    assert!(text.contains("voxels of float32 are mapped") && text.contains("0, 1 of 2 were not scanned"), "{text}");
    for part in ["1/2", "0/2"] {
        let (_, text) = brickcast_both(at, &with("s", &["--shard", part, "--scan"]));
        assert!(text.contains(", scanned in "), "{text}");
    }
    for part in ["1/2", "0/2"] {
        brickcast_ok(at, &with("s", &["--shard", part]));
    }
    brickcast_ok(at, &with("s", &["--merge"]));
    check_same(&at.join("s"), &want, "merged");
    brickcast_ok(at, &with("t", &["--resume"]));
    check_same(&at.join("t"), &want, "resumed");
}

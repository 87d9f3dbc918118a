//! Stores on a plain HTTP server: the same bits as from the disk, or named and never wrong, whatever the server does.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use brickcast_tests::patience::ends;
use brickcast_tests::process::{NodeProcess, brickcast_both, brickcast_command, brickcast_ok};
use brickcast_tests::turn;
use brickcast_tests::web::{Manners, WebServer};

const PATIENCE: Duration = Duration::from_secs(120);
const SLOW: Duration = Duration::from_millis(200);

/// A part of 96 x 80 x 88 voxels in bricks of 32, with regions and levels, in the folder `data`; and its server.
struct Stage {
    folder: tempfile::TempDir,
    server: WebServer,
}

impl Stage {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "96,80,88", "--pores", "2"]);
        let regions = ["--segmentation-range", "0.05", "--brick", "32"];
        fs::create_dir(at.join("data")).unwrap();
        brickcast_ok(at, &[&["prepare", "part.nrrd", "data/part"][..], &regions].concat());
        let server = WebServer::start(&at.join("data"));
        Self { folder, server }
    }

    fn at(&self) -> &Path {
        self.folder.path()
    }

    fn address(&self) -> String {
        format!("{}/part", self.server.address)
    }

    /// The picture of a store, and what was said.
    fn drawn(&self, path: &str, flags: &[&str]) -> (Option<i32>, Option<Vec<u8>>, String) {
        let picture = self.at().join("o.png");
        fs::remove_file(&picture).ok();
        let base = ["render", path, "-o", "o.png", "--size", "96x80", "--exact", "--no-manifest"];
        let mut command = brickcast_command(self.at());
        command.args(base).args(flags);
        if !flags.contains(&"--nodes") {
            command.args(["--backend", "cpu"]);
        }
        let output = ends(&mut command, PATIENCE);
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        (output.status.code(), fs::read(&picture).ok(), said)
    }

    fn drawn_from_disk(&self, flags: &[&str]) -> Vec<u8> {
        let (code, picture, said) = self.drawn("data/part", flags);
        assert_eq!(code, Some(0), "{said}");
        picture.unwrap()
    }
}

#[test]
fn a_store_is_read_from_where_it_lies_as_from_the_disk() {
    let _turn = turn(module_path!());
    let stage = Stage::new();
    for flags in [&[][..], &["--accel", "none"], &["--lod", "auto"], &["--lod", "1"], &["--local", "3"]] {
        let want = stage.drawn_from_disk(flags);
        stage.server.set(Manners::default());
        let (code, picture, said) = stage.drawn(&stage.address(), flags);
        assert_eq!(code, Some(0), "{flags:?}: {said}");
        assert!(picture.unwrap() == want, "{flags:?}: other bits than from the disk");
        eprintln!("{flags:?}: {} requests", stage.server.requests());
    }
    let json = |path: &str| brickcast_ok(stage.at(), &["info", path, "--json"]);
    assert_eq!(json(&stage.address()), json("data/part"));
    let file = format!("file://{}", stage.at().join("data/part").display());
    assert_eq!(json(&file), json("data/part"));
    let verified = brickcast_both(stage.at(), &["verify", &stage.address()]);
    assert!(format!("{verified:?}").contains("every byte is as the manifest says"), "{verified:?}");
}

#[test]
fn a_slow_server_and_one_that_fails_at_every_tenth_request_give_the_same_bits() {
    let _turn = turn(module_path!());
    let stage = Stage::new();
    let want = stage.drawn_from_disk(&[]);
    for manners in [
        Manners { delay: SLOW, ..Manners::default() },
        Manners { fails_one_in: 10, ..Manners::default() },
        Manners { delay: SLOW / 4, fails_one_in: 3, ..Manners::default() },
    ] {
        stage.server.set(manners.clone());
        let started = Instant::now();
        let (code, picture, said) = stage.drawn(&stage.address(), &[]);
        let (requests, failed) = (stage.server.requests(), stage.server.failed());
        eprintln!("{manners:?}: {:?}, {requests} requests, {failed} failed", started.elapsed());
        assert_eq!(code, Some(0), "{said}");
        assert!(picture.unwrap() == want, "{manners:?}: other bits");
        assert!(manners.fails_one_in == 0 || failed >= requests / manners.fails_one_in / 2, "{failed} of {requests}");
    }
}

/// After so many quarters of the requests. What is told of a store on the disk that lacks a shard is what is told of a
/// server that went away; and when it is back, the same node goes on.
fn gone_midway(quarters: u64) {
    let stage = Stage::new();
    let want = stage.drawn_from_disk(&[]);
    let node = NodeProcess::start(Path::new(&stage.server.address), &["--backend", "cpu"]);
    let flags = ["--nodes", &node.address];
    // Once, to know how many requests there are: a node that knows nothing of the store yet.
    stage.server.set(Manners::default());
    let (code, picture, said) = stage.drawn("part", &flags);
    assert_eq!(code, Some(0), "{said}");
    assert!(picture.unwrap() == want, "other bits from a node");
    let after = stage.server.requests() * quarters / 4;
    drop(node);
    stage.server.set(Manners::default());
    let node = NodeProcess::start(Path::new(&stage.server.address), &["--backend", "cpu"]);
    stage.server.set(Manners { gone_after: Some(after), ..Manners::default() });
    let started = Instant::now();
    let (code, picture, said) = stage.drawn("part", &["--nodes", &node.address]);
    eprintln!("gone after {after} requests: exit code {code:?}, {:?}: {said}", started.elapsed());
    assert!(matches!(code, Some(1 | 3)), "{code:?} {said}");
    assert!(said.contains(&stage.server.address) && said.contains("tries"), "{said}");
    assert!(code == Some(3) || picture.is_none(), "a picture without a warning");
    assert!(started.elapsed() < Duration::from_secs(60), "{:?}", started.elapsed());
    stage.server.set(Manners::default());
    let (code, picture, said) = stage.drawn("part", &["--nodes", &node.address]);
    assert_eq!(code, Some(0), "{said}");
    assert!(picture.unwrap() == want, "other bits after it came back");
}

// Tests of their own, beside each other: most of their time goes by waiting.
#[test]
fn a_server_that_goes_away_after_a_quarter_is_named_and_asked_again_when_it_is_back() {
    let _turn = turn(module_path!());
    gone_midway(1);
}

#[test]
fn a_server_that_goes_away_midway_is_named_and_asked_again_when_it_is_back() {
    let _turn = turn(module_path!());
    gone_midway(2);
}

#[test]
fn a_server_that_goes_away_near_the_end_is_named_and_asked_again_when_it_is_back() {
    let _turn = turn(module_path!());
    gone_midway(3);
}

/// Of every kind of file: where it strikes, no picture is made, and the file is named.
#[test]
fn a_bit_that_flips_on_the_way_is_found_and_its_file_named() {
    let _turn = turn(module_path!());
    let stage = Stage::new();
    let flags = ["--accel", "all"];
    let want = stage.drawn_from_disk(&flags);
    let mut struck = 0;
    let files = [
        "part/zarr.json",
        "part/0/zarr.json",
        "part/bricks.bin",
        "part/cells.bin",
        "part/means.bin",
        "part/shards.bin",
        "part/0/c/0/0/0",
        "part/halos.bin",
        "part/halo_index.bin",
        "part/regions.bin",
        "part/labels/regions/0/c/0/0/0",
        "part/distances/c/0/0/0",
        "part/levels/1/level.json",
    ];
    for file in files {
        for byte in [3, 200, 5000] {
            stage.server.set(Manners { flips: Some((file.to_owned(), byte, 3)), ..Manners::default() });
            let (code, picture, said) = stage.drawn(&stage.address(), &flags);
            if stage.server.failed() == 0 {
                assert!(code == Some(0) && picture.unwrap() == want, "{file} {byte}: {said}");
                continue;
            }
            if code == Some(0) {
                // What was fetched beside what was wanted.
                assert!(picture.unwrap() == want, "{file} {byte}: a wrong picture");
                continue;
            }
            struck += 1;
            let name = match file {
                "part/bricks.bin" | "part/cells.bin" | "part/means.bin" => "ranges",
                file => file.trim_start_matches("part/"),
            };
            assert!(matches!(code, Some(1 | 3 | 4)) && said.contains(name), "{file} {byte}: {code:?} {said}");
            assert!(matches!(code, Some(3 | 4)) || picture.is_none(), "{file} {byte}: a picture without a warning");
        }
    }
    assert!(struck > 15, "only {struck} flips struck");
    stage.server.set(Manners { flips: Some(("part/0/c/0/0/0".to_owned(), 5000, 3)), ..Manners::default() });
    let output = brickcast_command(stage.at()).args(["verify", &stage.address()]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    assert!(output.status.code() == Some(1) && said.contains("broken   0/c/0/0/0"), "{said}");
}

#[test]
fn servers_that_cannot_serve_a_store_are_told_what_is_wrong_with_them() {
    let _turn = turn(module_path!());
    let stage = Stage::new();
    let refused = Manners { status: Some(403), ..Manners::default() };
    for (manners, path, words) in [
        (Manners { without_ranges: true, ..Manners::default() }, stage.address(), "does not answer for a range"),
        (refused, stage.address(), "AWS_ACCESS_KEY_ID"),
        (Manners { endless: true, ..Manners::default() }, stage.address(), "that were asked for came"),
        (Manners::default(), format!("{}/none", stage.server.address), "is not a brickcast store"),
        (Manners::default(), format!("{}/part/0", stage.server.address), "is not a brickcast store"),
        (Manners { status: Some(302), ..Manners::default() }, stage.address(), "tries failed"),
    ] {
        stage.server.set(manners.clone());
        // A store's array is an input like any other of Zarr: `info` tells of it.
        let commands = if path.ends_with("/part/0") { &["verify"][..] } else { &["info", "verify"] };
        for command in commands {
            let output = ends(brickcast_command(stage.at()).args([*command, &path]), PATIENCE);
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.code() == Some(1) && said.contains(words), "{manners:?} {command}: {said}");
            assert!(said.contains(&path), "{said}");
        }
    }
}

#[test]
fn secrets_in_addresses_are_refused_and_not_told() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let node = brickcast_tests::process::binaries().join("brickcast-node");
    for address in
        ["http://user:hunter2@127.0.0.1:1/a", "https://127.0.0.1:1/a?X-Amz-Signature=hunter2", "s3://k:hunter2@b/a"]
    {
        for args in [&["info", address][..], &["verify", address], &["render", address, "-o", "o.png"]] {
            let output = ends(brickcast_command(folder.path()).args(args), PATIENCE);
            let said = format!("{output:?}");
            assert!(output.status.code() == Some(2) && said.contains("AWS_SECRET_ACCESS_KEY"), "{args:?}: {said}");
            assert!(!said.contains("hunter2"), "{args:?}: {said}");
        }
        let mut command = std::process::Command::new(&node);
        let output = ends(command.args(["--listen", "127.0.0.1:0", "--backend", "cpu", "--data", address]), PATIENCE);
        let said = format!("{output:?}");
        assert!(output.status.code() == Some(2) && said.contains("AWS_SECRET_ACCESS_KEY"), "{said}");
        assert!(!said.contains("hunter2"), "{said}");
    }
    for (path, words) in [("ftp://host/a", "s3://"), ("s3://", "bucket"), ("http://", "host")] {
        let output = ends(brickcast_command(folder.path()).args(["info", path]), PATIENCE);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(words), "{path}: {said}");
    }
    let output = ends(brickcast_command(folder.path()).args(["prepare", "a.nrrd", "http://host/s"]), PATIENCE);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && said.contains("which only gives"), "{said}");
}

/// The root is a jail: what leads out of it, or might in the eyes of some server, is refused before anything is asked.
#[test]
fn names_do_not_leave_a_far_root() {
    let _turn = turn(module_path!());
    let stage = Stage::new();
    fs::create_dir(stage.at().join("data/inner")).unwrap();
    let node = NodeProcess::start(Path::new(&format!("{}/inner", stage.server.address)), &["--backend", "cpu"]);
    stage.server.set(Manners::default());
    let other = format!("{}/part", stage.server.address);
    for name in ["../part", "%2e%2e/part", "..%2fpart", "/part", "a/../../part", "a//b", "..\\part", "part?x", &other] {
        let (code, picture, said) = stage.drawn(name, &["--nodes", &node.address]);
        // An address is opened here, and then asked for by its hash.
        assert!(code == Some(1) && picture.is_none(), "{name}: {code:?} {said}");
        // What could be a pattern of slices here is no name.
        let told = ["store name", "no store", "no file fits this pattern"];
        assert!(told.iter().any(|words| said.contains(words)), "{name}: {said}");
    }
    let asked: Vec<_> = stage.server.asked().into_iter().filter(|path| !path.starts_with("/part/")).collect();
    assert!(asked.iter().all(|path| path.starts_with("/inner/brickcast.json")), "{asked:?}");
}

//! Stores that are put to an object store as they are made: what a folder would have got, or nothing.

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use brickcast_tests::patience::ends;
use brickcast_tests::process::{brickcast_command, brickcast_ok};
use brickcast_tests::s3::S3Server;
use brickcast_tests::web::WebServer;

use crate::ome_zarr::Stage;

const PATIENCE: Duration = Duration::from_secs(120);

/// A bucket `scans`, and programs that know it.
struct Bucket<'a> {
    at: &'a Path,
    server: S3Server,
}

impl<'a> Bucket<'a> {
    fn new(at: &'a Path) -> Self {
        fs::create_dir_all(at.join("data")).unwrap();
        fs::create_dir(at.join("tmp")).unwrap();
        Self { at, server: S3Server::start(&at.join("data")) }
    }

    fn command(&self, args: &[&str]) -> std::process::Command {
        let mut command = brickcast_command(self.at);
        command.args(args).envs(self.server.variables(&self.server.address)).env("TMPDIR", self.at.join("tmp"));
        command
    }

    fn run(&self, args: &[&str]) -> (Option<i32>, String) {
        let output = ends(&mut self.command(args), PATIENCE);
        let said = String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned();
        assert!(!said.contains(&self.server.secret), "the secret key was told: {said}");
        (output.status.code(), said)
    }

    fn ok(&self, args: &[&str]) -> String {
        let (code, said) = self.run(args);
        assert_eq!(code, Some(0), "{args:?}: {said}");
        said
    }

    fn fails(&self, args: &[&str], code: i32, words: &str) {
        let (got, said) = self.run(args);
        assert!(got == Some(code) && said.contains(words), "{args:?}: {got:?} {said}");
    }

    /// The store there is the one in the folder, and nothing is left on the way.
    fn is(&self, address: &str, folder: &str) {
        assert!(self.ok(&["verify", address]).contains("every byte is as the manifest says"));
        let hash = |path: &str| {
            let told: serde_json::Value = serde_json::from_str(&self.ok(&["info", path, "--json"])).unwrap();
            told["store"]["hash"].as_str().unwrap().to_owned()
        };
        assert_eq!(hash(address), hash(folder), "{address}");
        assert_eq!(fs::read_dir(self.at.join("tmp")).unwrap().count(), 0, "left in the temporary folder");
    }
}

#[test]
fn a_store_is_put_to_a_bucket_as_it_is_made() {
    let stage = Stage::new();
    let at = stage.at();
    fs::create_dir(at.join("data")).unwrap();
    fs::rename(at.join("five-2-1.zarr"), at.join("data/five-2-1.zarr")).unwrap();
    let bucket = Bucket::new(at);
    // With regions, which are found in voxels that are there already.
    brickcast_ok(at, &["phantom", "v.nrrd", "--dims", "280,60,50", "--pores", "5"]);
    fn prepare<'a>(to: &'a str, more: &[&'a str]) -> Vec<&'a str> {
        [&["prepare", "v.nrrd", to, "--brick", "32", "--segmentation-range", "0.05"], more].concat()
    }
    bucket.ok(&prepare("here", &[]));
    assert!(bucket.ok(&prepare("s3://scans/made/v", &[])).contains("s3://scans/made/v: 280 x 60 x 50 voxels"));
    bucket.is("s3://scans/made/v", "here");
    bucket.fails(&prepare("s3://scans/made/v", &[]), 1, "exists already; choose another name, or pass --force");
    // A smaller one in its place: what only the old one had is gone.
    brickcast_ok(at, &["phantom", "v.nrrd", "--dims", "60,50,40", "--pores", "2", "--force"]);
    bucket.ok(&prepare("here", &["--force"]));
    bucket.ok(&prepare("s3://scans/made/v", &["--force"]));
    bucket.is("s3://scans/made/v", "here");

    // From there to there.
    let (scan, channel) = ("s3://scans/five-2-1.zarr", ["--channel", "1", "--time", "2", "--brick", "16"]);
    bucket.ok(&[&["prepare", "data/five-2-1.zarr", "here", "--force"], &channel[..]].concat());
    bucket.ok(&[&["prepare", scan, "s3://scans/store"], &channel[..]].concat());
    bucket.ok(&[&["prepare", scan, "s3://scans/view", "--in-place"], &channel[..]].concat());
    for address in ["s3://scans/store", "s3://scans/view"] {
        let args = ["-o", "o.png", "--size", "40x32", "--exact", "--backend", "cpu", "--no-manifest"];
        assert!(bucket.ok(&["verify", address]).contains("every byte is as the manifest says"));
        let [got, want] = [address, "here"].map(|path| {
            bucket.ok(&[&["render", path], &args[..]].concat());
            fs::read(at.join("o.png")).unwrap()
        });
        assert!(got == want, "{address}");
    }
    // What lies there is not written over.
    bucket.fails(&["prepare", "v.nrrd", scan, "--force"], 1, "it is a prefix that holds something else");
    bucket.fails(&["prepare", scan, scan, "--force"], 1, "which the new store would replace");
    bucket.fails(&["prepare", "v.nrrd", "s3://scans/x", "--shard", "0/1"], 2, "where parts cannot be joined");
    bucket.fails(
        &["prepare", "data/five-2-1.zarr", "s3://scans/x", "--in-place"],
        1,
        "would be a view of what lies on",
    );
    let web = WebServer::start(&at.join("data"));
    bucket.fails(&["prepare", "v.nrrd", &format!("{}/x", web.address)], 2, "is a web server, which only gives");
    bucket.fails(&["prepare", "v.nrrd", "s3://nothing/x"], 1, "s3://nothing/x");
}

/// Files of more than one part, and a process that is killed at some time: there is a store or none, and the next one
/// is made in its place.
#[test]
fn a_killed_one_leaves_no_store_and_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bucket = Bucket::new(at);
    let mut state = 1u32;
    let noise: Vec<u8> = (0..256 * 256 * 260)
        .flat_map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 16) as u16).to_le_bytes()
        })
        .collect();
    fs::write(at.join("v.raw"), noise).unwrap();
    fn prepare(to: &str) -> [&str; 9] {
        ["prepare", "v.raw", to, "--dims", "256,256,260", "--type", "uint16", "--levels", "1"]
    }
    bucket.ok(&prepare("here"));
    for milliseconds in [150, 900] {
        let to = format!("s3://scans/killed-{milliseconds}");
        let mut child = bucket.command(&prepare(&to)).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        child.kill().unwrap();
        child.wait().unwrap();
        let (code, said) = bucket.run(&["verify", &to]);
        assert!(code == Some(0) || said.contains("is not a brickcast store"), "{said}");
        let again: Vec<&str> = prepare(&to).into_iter().chain((code == Some(0)).then_some("--force")).collect();
        bucket.ok(&again);
        let _ = fs::remove_dir_all(at.join("tmp"));
        fs::create_dir(at.join("tmp")).unwrap();
        bucket.is(&to, "here");
    }
}

//! Stores in an object store: read in place by nodes and by the command line, found below a prefix, and never outside.

use std::fs;
use std::path::Path;
use std::process::Output;
use std::time::Duration;

use brickcast_tests::patience::ends;
use brickcast_tests::process::{NodeProcess, brickcast_command, brickcast_ok};
use brickcast_tests::proxy::{Fault, Proxy};
use brickcast_tests::s3::S3Server;
use brickcast_tests::turn;

const PATIENCE: Duration = Duration::from_secs(120);

/// `lab/part` and `lab/deep/er/part`, which are one store; `elsewhere/part`, which is another.
struct Stage {
    folder: tempfile::TempDir,
    server: S3Server,
}

impl Stage {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let flags = ["--segmentation-range", "0.05", "--brick", "32"];
        for (name, seed) in [("lab/part", "1"), ("lab/deep/er/part", "1"), ("elsewhere/part", "2")] {
            brickcast_ok(
                at,
                &["phantom", "part.nrrd", "--dims", "96,80,88", "--pores", "2", "--seed", seed, "--force"],
            );
            fs::create_dir_all(at.join("data").join(name).parent().unwrap()).unwrap();
            brickcast_ok(at, &[&["prepare", "part.nrrd", &format!("data/{name}")][..], &flags].concat());
        }
        let server = S3Server::start(&at.join("data"));
        Self { folder, server }
    }

    fn run(&self, args: &[&str], variables: &[(&str, &str)]) -> (Output, String) {
        let output = ends(brickcast_command(self.folder.path()).args(args).envs(variables.iter().copied()), PATIENCE);
        let said = String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned();
        assert!(!said.contains(&self.server.secret), "the secret key was told: {said}");
        (output, said)
    }

    /// The picture, where there is one.
    fn drawn(&self, path: &str, flags: &[&str], variables: &[(&str, &str)]) -> (Option<i32>, Option<Vec<u8>>, String) {
        let picture = self.folder.path().join("o.png");
        fs::remove_file(&picture).ok();
        let base = ["render", path, "-o", "o.png", "--size", "96x80", "--exact", "--no-manifest"];
        let backend: &[&str] = if flags.contains(&"--nodes") { &[] } else { &["--backend", "cpu"] };
        let (output, said) = self.run(&[&base, flags, backend].concat(), variables);
        (output.status.code(), fs::read(&picture).ok(), said)
    }

    fn drawn_from_disk(&self) -> Vec<u8> {
        let (code, picture, said) = self.drawn("data/lab/part", &[], &[]);
        assert_eq!(code, Some(0), "{said}");
        picture.unwrap()
    }

    fn node(&self, data: &str, address: &str) -> NodeProcess {
        NodeProcess::start_with(Path::new(data), &["--backend", "cpu"], &self.server.variables(address))
    }
}

#[test]
fn a_store_in_a_bucket_is_read_in_place_by_all_and_found_below_its_prefix() {
    let _turn = turn(module_path!());
    let stage = Stage::new();
    let (want, keys) = (stage.drawn_from_disk(), stage.server.variables(&stage.server.address));
    let same = |path: &str, flags: &[&str], variables: &[(&str, &str)]| {
        let (code, picture, said) = stage.drawn(path, flags, variables);
        assert_eq!(code, Some(0), "{path} {flags:?}: {said}");
        assert!(picture.unwrap() == want, "{path} {flags:?}: other bits than from the disk");
    };
    same("s3://scans/lab/part", &[], &keys);
    let (output, said) = stage.run(&["verify", "s3://scans/lab/part"], &keys);
    assert!(output.status.success() && said.contains("every byte is as the manifest says"), "{said}");
    let node = stage.node("s3://scans/lab", &stage.server.address);
    let nodes = ["--nodes", node.address.as_str()];
    // By the store's hash, which the node finds by listing; by its names below the prefix; by its address.
    same("data/lab/part", &nodes, &[]);
    same("part", &nodes, &[]);
    same("deep/er/part", &nodes, &[]);
    same("s3://scans/lab/part", &nodes, &keys);
    same("data/lab/part", &[&nodes[..], &["--lod", "0"]].concat(), &[]);
    let (_, said) = stage.run(&["nodes", nodes[0], nodes[1]], &[]);
    assert!(said.contains("part") && said.contains("deep/er/part"), "{said}");
    // What lies beside the prefix, and in another bucket.
    for name in ["../elsewhere/part", "/elsewhere/part", "s3://other/lab/part", "..%2felsewhere/part", "none"] {
        let (code, picture, said) = stage.drawn(name, &nodes, &keys);
        let is_told = said.contains("store name") || said.contains("no store named");
        // Of another bucket's store, this one has the same bits: it is known by its hash.
        assert!(name.starts_with("s3://other") || (code == Some(1) && picture.is_none() && is_told), "{name}: {said}");
    }
    let (code, _, said) = stage.drawn("s3://other/elsewhere/part", &nodes, &keys);
    assert!(code == Some(1) && said.contains("no store with hash"), "{said}");
}

#[test]
fn keys_come_from_the_environment_and_what_is_wrong_with_them_is_told() {
    let _turn = turn(module_path!());
    let stage = Stage::new();
    let keys = stage.server.variables(&stage.server.address);
    let with = |name: &str, value: &'static str| {
        keys.iter().map(|(n, v)| if *n == name { (*n, value) } else { (*n, *v) }).collect::<Vec<_>>()
    };
    let without = |name: &str| keys.iter().filter(|(n, _)| *n != name).copied().collect::<Vec<_>>();
    let mut no_keys = without("AWS_ACCESS_KEY_ID");
    no_keys.retain(|(name, _)| *name != "AWS_SECRET_ACCESS_KEY");
    // Where a machine in a cloud would be asked for keys.
    no_keys.push(("AWS_METADATA_ENDPOINT", "http://127.0.0.1:1"));
    for (variables, path, words) in [
        (with("AWS_SECRET_ACCESS_KEY", "wrong"), "s3://scans/lab/part", "status 403"),
        (with("AWS_ACCESS_KEY_ID", "unknown"), "s3://scans/lab/part", "AWS_SECRET_ACCESS_KEY"),
        (without("AWS_SECRET_ACCESS_KEY"), "s3://scans/lab/part", "SecretAccessKey"),
        (without("AWS_ALLOW_HTTP"), "s3://scans/lab/part", "AWS_ALLOW_HTTP=true"),
        (with("AWS_ENDPOINT_URL", "http://127.0.0.1:1"), "s3://scans/lab/part", "tries failed"),
        (with("AWS_ENDPOINT_URL", "localhost"), "s3://scans/lab/part", "write it as https://host"),
        (with("AWS_ACCESS_KEY_ID", "key\n"), "s3://scans/lab/part", "AWS_ACCESS_KEY_ID holds a character"),
        (no_keys, "s3://scans/lab/part", "no keys in the environment"),
        (keys.to_vec(), "s3://scans/lab/none", "is not a brickcast store"),
        (keys.to_vec(), "s3://nowhere/lab/part", "is not a brickcast store"),
    ] {
        let (output, said) = stage.run(&["info", path], &variables);
        assert!(output.status.code() == Some(1) && said.contains(words) && said.contains(path), "{words}: {said}");
    }
}

/// Cut, and a bit flipped, on the way from the object store to a node.
#[test]
fn a_bucket_behind_a_bad_network_is_named_and_asked_again() {
    let _turn = turn(module_path!());
    let stage = Stage::new();
    let want = stage.drawn_from_disk();
    let proxy = Proxy::start(stage.server.address.trim_start_matches("http://"));
    let address = format!("http://{}", proxy.address);
    for (fault, breaks) in [
        (Fault::Cut { after: 300_000 }, true),
        (Fault::Corrupt { after: 300_000 }, false),
        (Fault::Corrupt { after: 20_000 }, false),
        (Fault::Slow { rate: 4 << 20 }, false),
    ] {
        let node = stage.node("s3://scans/lab", &address);
        proxy.set(fault);
        let (code, picture, said) = stage.drawn("part", &["--nodes", &node.address], &[]);
        eprintln!("{fault:?}, struck {} times: exit code {code:?}", proxy.hits());
        assert!(!breaks || code != Some(0), "{fault:?}: {said}");
        match code {
            Some(0) => assert!(picture.unwrap() == want, "{fault:?}: a wrong picture"),
            Some(1) => assert!(picture.is_none() && said.contains("s3://scans/lab"), "{fault:?}: {said}"),
            code => assert!(code == Some(3) && said.contains("s3://scans/lab"), "{fault:?}: {code:?} {said}"),
        }
        proxy.set(Fault::None);
        let (code, picture, said) = stage.drawn("part", &["--nodes", &node.address], &[]);
        assert_eq!(code, Some(0), "{fault:?}: {said}");
        assert!(picture.unwrap() == want, "{fault:?}: other bits after it was over");
    }
}

//! Other people's OME-Zarr in place: a view is drawn as the store of its voxels, and what was changed since is named.

use std::fs;
use std::path::Path;
use std::time::Duration;

use brickcast_tests::patience::ends;
use brickcast_tests::process::{NodeProcess, brickcast, brickcast_command, brickcast_ok};
use brickcast_tests::s3::S3Server;
use brickcast_tests::web::WebServer;
use serde_json::Value;

use crate::ome_zarr::Stage;

const PATIENCE: Duration = Duration::from_secs(120);
const SCAN: &str = "five-2-1.zarr";
const CHANNEL: [&str; 4] = ["--channel", "1", "--time", "2"];

/// Arguments of a render of `path` into `o.png`.
fn render_args<'a>(path: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let base = ["render", path, "-o", "o.png", "--size", "80x64", "--exact", "--no-manifest", "--window", "9000,40000"];
    [&base[..], more].concat()
}

fn picture(at: &Path, path: &str, more: &[&str]) -> Vec<u8> {
    brickcast_ok(at, &render_args(path, more));
    fs::read(at.join("o.png")).unwrap()
}

/// A view beside its array in `data`, and the picture of the store of the same voxels.
fn viewed(stage: &Stage) -> Vec<u8> {
    let at = stage.at();
    brickcast_ok(at, &["prepare", "five-2-1.nrrd", "store", "--brick", "16"]);
    fs::create_dir(at.join("data")).unwrap();
    fs::rename(at.join(SCAN), at.join("data").join(SCAN)).unwrap();
    let scan = format!("data/{SCAN}");
    brickcast_ok(at, &[&["prepare", &scan, "data/view", "--in-place", "--brick", "16"], &CHANNEL[..]].concat());
    picture(at, "store", &["--backend", "cpu"])
}

#[test]
fn a_view_is_drawn_as_the_store_of_its_voxels_by_any_node() {
    let stage = Stage::new();
    let at = stage.at();
    let want = viewed(&stage);
    let told: Value = serde_json::from_str(&brickcast_ok(at, &["info", "data/view", "--json"])).unwrap();
    assert_eq!(told["store"]["view_of"], "../five-2-1.zarr", "{told}");
    assert!(brickcast_ok(at, &["info", "data/view"]).contains("a view of ../five-2-1.zarr"));
    assert!(brickcast_ok(at, &["verify", "data/view"]).contains("every byte is as the manifest says"));
    for local in ["1", "2", "3"] {
        assert!(picture(at, "data/view", &["--backend", "cpu", "--local", local]) == want, "{local} nodes");
    }
    assert!(picture(at, "data/view", &["--memory-budget", "2MiB", "--backend", "cpu"]) == want, "a small budget");
    // Both lie elsewhere now; nodes that are other processes, whose data root holds both.
    fs::rename(at.join("data"), at.join("moved")).unwrap();
    let nodes = [0; 2].map(|_| NodeProcess::start(&at.join("moved"), &["--backend", "cpu"]));
    let addresses = nodes.each_ref().map(|node| node.address.clone()).join(",");
    assert!(picture(at, "moved/view", &["--nodes", &addresses]) == want, "by two nodes");
    assert!(picture(at, "view", &["--nodes", &addresses]) == want, "by its name");
    // A store is no input, whatever it is.
    let (code, error) = stage.fails(&["prepare", "moved/view", "again"]);
    assert!(code == 1 && error.contains("is a brick store already"), "{code} {error}");
}

#[test]
fn what_was_changed_or_taken_away_is_named_and_never_drawn_wrong() {
    let stage = Stage::new();
    let at = stage.at();
    let want = viewed(&stage);
    let chunk = at.join("data").join(SCAN).join("0/0/2/1/1/1/1");
    let kept = fs::read(&chunk).unwrap();
    let render = || {
        let output = brickcast(at, &render_args("data/view", &["--backend", "cpu"]));
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    for (content, words) in [
        (
            Some(fs::read(at.join("data").join(SCAN).join("0/0/0/0/1/1/1")).unwrap()),
            "is a view of voxels at ../five-2-1.zarr",
        ),
        (None, "is a view of voxels at ../five-2-1.zarr"),
        (Some(kept[..kept.len() / 2].to_vec()), "0/0/2/1/1/1/1"),
    ] {
        match content {
            Some(content) => fs::write(&chunk, content).unwrap(),
            None => fs::remove_file(&chunk).unwrap(),
        }
        let (code, error) = render();
        assert!(matches!(code, Some(1 | 3 | 4)) && error.contains(words), "{code:?} {error}");
        assert!(brickcast(at, &["verify", "data/view"]).status.code() == Some(1));
    }
    fs::write(&chunk, kept).unwrap();
    assert!(render().0 == Some(0) && fs::read(at.join("o.png")).unwrap() == want);
    // A data root without the array: nodes read nothing outside of it.
    fs::create_dir(at.join("alone")).unwrap();
    fs::rename(at.join("data/view"), at.join("alone/view")).unwrap();
    fs::rename(at.join("data").join(SCAN), at.join(SCAN)).unwrap();
    let node = NodeProcess::start(&at.join("alone"), &["--backend", "cpu"]);
    let by_node = render_args("view", &["--nodes", &node.address]);
    let (code, error) = stage.fails(&by_node);
    assert!(code == 1 && error.contains("alone/five-2-1.zarr: no Zarr lies here"), "{code} {error}");
    let file = at.join("alone/view/view.json");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replace("../five-2-1.zarr", "../../five-2-1.zarr")).unwrap();
    let (code, error) = stage.fails(&by_node);
    let words = "it is a view of voxels at ../../five-2-1.zarr, which lies outside of the node's --data";
    assert!(code == 1 && error.contains(words), "{code} {error}");
    // Who names a view follows it wherever it leads.
    assert!(picture(at, "alone/view", &["--backend", "cpu"]) == want);
    fs::rename(at.join(SCAN), at.join("gone.zarr")).unwrap();
    let (code, error) = stage.fails(&["info", "alone/view"]);
    assert!(code == 1 && error.contains("five-2-1.zarr: no Zarr lies here"), "{code} {error}");

    let (code, error) = stage.fails(&["prepare", "five-2-1.nrrd", "out", "--in-place"]);
    assert!(
        code == 1 && error.contains("five-2-1.nrrd is no OME-Zarr, and of other formats there are no views"),
        "{error}"
    );
    assert_eq!(stage.fails(&["prepare", "gone.zarr", "out", "--in-place", "--shard", "0/1"]).0, 2);
    assert!(!at.join("out").exists());
}

/// On the way to a picture the cache holds a view; and a view may lie behind a network, with its array or without.
#[test]
fn arrays_behind_a_network_are_drawn_where_they_lie() {
    let stage = Stage::new();
    let at = stage.at();
    let want = viewed(&stage);
    let server = S3Server::start(&at.join("data"));
    let web = WebServer::start(&at.join("data"));
    let run = |args: &[&str]| {
        let mut command = brickcast_command(at);
        let output = ends(command.args(args).envs(server.variables(&server.address)), PATIENCE);
        let said = String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned();
        assert!(!said.contains(&server.secret), "the secret key was told: {said}");
        (output.status.code(), said)
    };
    let drawn = |path: &str, more: &[&str]| {
        let (code, said) = run(&render_args(path, &[&["--backend", "cpu"], more].concat()));
        assert_eq!(code, Some(0), "{path}: {said}");
        fs::read(at.join("o.png")).unwrap()
    };
    let on_the_way = ["--cache-dir", "cache", "--brick", "16", "--channel", "1", "--time", "2"];
    for root in ["s3://scans", &web.address] {
        let (scan, view) = (format!("{root}/{SCAN}"), format!("{root}/view"));
        assert!(drawn(&view, &[]) == want, "{view}");
        assert!(drawn(&scan, &on_the_way) == want && drawn(&scan, &on_the_way) == want, "{scan}");
        let args = ["prepare", &scan, "here", "--in-place", "--force", "--brick", "16"];
        let (code, said) = run(&[&args, &CHANNEL[..]].concat());
        assert_eq!(code, Some(0), "{said}");
        assert!(drawn("here", &[]) == want, "a view here of {scan}");
        let told: Value = serde_json::from_str(&run(&["info", "here", "--json"]).1).unwrap();
        assert_eq!(told["store"]["view_of"], scan.as_str());
    }
    let entries: Vec<_> = fs::read_dir(at.join("cache")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let views = entries.iter().filter(|path| path.join("view.json").is_file()).count();
    assert_eq!((views, entries.iter().filter(|path| path.is_dir()).count()), (2, 2), "one of each place: {entries:?}");
}

//! Other people's OME-Zarr, written by zarr-python in every way that is read: what is prepared and rendered of it is
//! what is prepared and rendered of the same voxels as NRRD.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use brickcast_harness::ignore;
use brickcast_tests::patience::ends;
use brickcast_tests::process::{brickcast, brickcast_command, brickcast_ok};
use brickcast_tests::s3::S3Server;
use brickcast_tests::web::WebServer;
use brickcast_volume::format::{self, RawHints, VolumeSource};
use brickcast_volume::store::{Objects, PrepareOptions, Store, StoreFolder, ViewInput, prepare};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(120);

/// What the script tells of the images that it wrote into `folder`.
fn written(folder: &Path) -> Vec<Value> {
    let mut probe = Command::new("python3");
    probe.args(["-c", "import zarr, sys; sys.exit(int(zarr.__version__.split('.')[0]) < 3)"]).stderr(Stdio::null());
    if !probe.status().is_ok_and(|status| status.success()) {
        ignore("python3 with zarr >= 3 is missing: pip install 'zarr>=3'");
    }
    let mut python = Command::new("python3");
    let output = python.args(["-W", "ignore", "-c", include_str!("ome_zarr.py")]).arg(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Of a store, all that its manifest says but what its input was.
fn prepared(source: &mut dyn VolumeSource, store: &Path, tile_voxels: u64, view: Option<ViewInput>) -> Value {
    let options = PrepareOptions {
        brick_size: 16,
        source_name: Some("volume".to_owned()),
        force: true,
        view,
        tile_voxels,
        ..PrepareOptions::default()
    };
    prepare(source, store, &options, &mut |_| ()).unwrap();
    manifest(store)
}

/// Of all levels, in one. The hashes of levels' manifests are not: those tell of the input, too.
pub(crate) fn manifest(store: &Path) -> Value {
    let read = |file: &str| {
        let mut manifest: Value = serde_json::from_slice(&fs::read(store.join(file)).unwrap()).unwrap();
        for what in ["source", "notes"] {
            manifest.as_object_mut().unwrap().remove(what);
        }
        manifest
    };
    let mut whole = read("brickcast.json");
    for (i, level) in whole["levels"].as_array_mut().into_iter().flatten().enumerate() {
        *level = read(&format!("levels/{}/level.json", i + 1));
    }
    whole
}

fn open(folder: &Path, hints: &RawHints) -> Box<dyn VolumeSource> {
    brickcast_zarr::open(Arc::new(StoreFolder::free(folder)), hints).unwrap()
}

#[test]
fn every_codec_layout_and_type_gives_the_store_of_the_same_voxels() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let images = written(at);
    assert!(images.len() > 60, "{}", images.len());
    for image in images {
        let path = |key: &str| at.join(image[key].as_str().unwrap());
        let hints =
            RawHints { channel: image["channel"].as_u64(), time: image["time"].as_u64(), ..RawHints::default() };
        let mut nrrd = format::open(&path("nrrd"), &RawHints::default()).unwrap();
        let mut zarr = open(&path("zarr"), &hints);
        let (want, got) = (nrrd.header().clone(), zarr.header().clone());
        assert_eq!(
            (got.geometry, got.voxel_type, &got.space_unit),
            (want.geometry, want.voxel_type, &want.space_unit),
            "{image}"
        );
        let all = PrepareOptions::default().tile_voxels;
        let want = prepared(nrrd.as_mut(), &at.join("want"), all, None);
        // In boxes of whole planes, and of tiles with what halos need of their neighbours.
        for tile_voxels in [all, 1] {
            zarr.rewind().unwrap();
            assert!(prepared(zarr.as_mut(), &at.join("got"), tile_voxels, None) == want, "another store: {image}");
        }
        // Where it lies: every byte that the store has is made of the array.
        let place = path("zarr").display().to_string();
        let view = ViewInput { place, channel: hints.channel, time: hints.time };
        zarr.rewind().unwrap();
        assert!(prepared(zarr.as_mut(), &at.join("view"), all, Some(view)) == want, "another view: {image}");
        let free = |path: &Path| Arc::new(StoreFolder::free(path));
        let find = |array: &str| Ok(free(Path::new(array)) as Arc<dyn Objects>);
        let view = Store::open_objects(brickcast_zarr::whole(free(&at.join("view")), find, 1 << 16).unwrap()).unwrap();
        assert_eq!(view.hash(), Store::open(&at.join("got")).unwrap().hash(), "{image}");
        view.verify(&mut |_| ()).unwrap();
        // In order, in pieces that end anywhere, from anywhere.
        let (mut in_order, mut want, mut piece) = (Vec::new(), Vec::new(), Vec::new());
        nrrd.rewind().unwrap();
        nrrd.read_planes(u32::MAX, &mut want).unwrap();
        zarr.rewind().unwrap();
        while in_order.len() < want.len() {
            zarr.read_piece(10_007, &mut piece).unwrap();
            in_order.extend_from_slice(&piece);
        }
        assert!(in_order == want, "other voxels in order: {image}");
        let bytes = got.voxel_type.bytes();
        assert!(zarr.seek(70_001).unwrap());
        zarr.read_piece(64 * bytes, &mut piece).unwrap();
        assert_eq!(piece, want[70_001 * bytes..70_065 * bytes], "{image}");
    }
}

/// The images that tests of the command line take, in a folder of their own.
pub(crate) struct Stage {
    folder: tempfile::TempDir,
}

impl Stage {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        written(folder.path());
        Self { folder }
    }

    pub(crate) fn at(&self) -> &Path {
        self.folder.path()
    }

    pub(crate) fn fails(&self, args: &[&str]) -> (i32, String) {
        let output = brickcast(self.at(), args);
        assert!(!output.status.success(), "{args:?} ended well");
        (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

#[test]
fn prepare_info_and_render_take_a_folder_of_ome_zarr_as_any_input() {
    let stage = Stage::new();
    let at = stage.at();
    // With what it does not say told.
    let info = brickcast_ok(at, &["info", "five-None-None.zarr"]);
    for words in [
        "OME-Zarr (Zarr v2)",
        "70 x 45 x 37",
        "0.5 x 0.25 x 2 micrometer",
        "its only image, `0`, was taken",
        "channel 0 of 2 was taken; --channel N takes another",
        "time 0 of 3 was taken; --time N takes another",
    ] {
        assert!(info.contains(words), "{words}: {info}");
    }
    let told: Value = serde_json::from_str(&brickcast_ok(at, &["info", "five-2-1.zarr/0", "--json"])).unwrap();
    assert!(told["kind"] == "input" && told["notes"].as_array().unwrap().len() == 2, "{told}");
    let (code, error) = stage.fails(&["info", "five-2-1.zarr", "--channel", "2"]);
    assert!(code == 1 && error.contains("--channel 2: there are 2, counted from 0"), "{code} {error}");
    let (code, error) = stage.fails(&["info", "v3-zstd.zarr", "--time", "1"]);
    assert!(code == 1 && error.contains("--time 1: it has no axis for it"), "{code} {error}");

    brickcast_ok(at, &["prepare", "five-2-1.zarr", "a", "--brick", "16", "--channel", "1", "--time", "2"]);
    brickcast_ok(at, &["prepare", "five-2-1.nrrd", "b", "--brick", "16"]);
    let shards = |store: &str| manifest(&at.join(store))["files"]["shards.bin"].clone();
    assert!(!shards("a").is_null() && shards("a") == shards("b"));
    // A store is no input, and its own array is not taken for one by its name.
    let (code, error) = stage.fails(&["prepare", "a", "c"]);
    assert!(code == 1 && error.contains("a is a brick store already"), "{code} {error}");

    let render = |path: &str, more: &[&str]| {
        let base = ["render", path, "-o", "o.png", "--size", "80x64", "--exact", "--no-manifest", "--backend", "cpu"];
        let cache = ["--cache-dir", "cache", "--brick", "16", "--window", "9000,40000"];
        brickcast_ok(at, &[&base[..], &cache, more].concat());
        fs::read(at.join("o.png")).unwrap()
    };
    let entries = || fs::read_dir(at.join("cache")).unwrap().filter(|e| e.as_ref().unwrap().path().is_dir()).count();
    let want = render("b", &[]);
    let channel = ["--channel", "1", "--time", "2"];
    assert!(render("five-2-1.zarr", &channel) == want, "another picture than of the prepared NRRD");
    let made = entries();
    assert!(render("five-2-1.zarr/0/", &channel) == want && render("five-2-1.zarr", &channel) == want);
    assert_eq!(entries(), made + 1, "one for each way to name it, and none again");
    assert!(render("five-2-1.zarr", &[]) != want, "another channel and time");
    let list = brickcast_ok(at, &["cache", "list", "--cache-dir", "cache"]);
    assert!(list.contains("five-2-1.zarr"), "{list}");
    // A chunk that changes makes another entry, and another picture.
    let chunk = at.join("five-2-1.zarr/0/0/2/1/1/1/1");
    fs::copy(at.join("five-2-1.zarr/0/0/0/0/1/1/1"), &chunk).unwrap();
    assert!(render("five-2-1.zarr", &channel) != want, "of a chunk that is no more");
}

#[test]
fn what_cannot_be_taken_is_named_with_the_way_out() {
    let stage = Stage::new();
    let at = stage.at();
    let fails = |path: &str, words: &[&str]| {
        let (code, error) = stage.fails(&["prepare", path, "out"]);
        let missing: Vec<_> = words.iter().filter(|words| !error.contains(**words)).collect();
        assert!(code == 1 && missing.is_empty(), "{path}: {code} {missing:?} in {error}");
        assert!(!at.join("out").exists());
    };
    let copy = |from: &str, to: &str| {
        let copied = Command::new("cp").arg("-r").args([from, to]).current_dir(at).status();
        assert!(copied.unwrap().success());
    };
    // Several images; a plate.
    copy("five-0-1.zarr", "several.zarr");
    copy("five-0-1.zarr/0", "several.zarr/1");
    fails("several.zarr", &["it holds 2 images: 0, 1; name one, such as PATH/0"]);
    fs::create_dir(at.join("plate.zarr")).unwrap();
    fs::write(at.join("plate.zarr/.zattrs"), r#"{ "plate": { "wells": [ { "path": "B/3" } ] } }"#).unwrap();
    fails("plate.zarr", &["a plate of wells", "PATH/B/3/0"]);
    fs::create_dir(at.join("empty.zarr")).unwrap();
    fs::write(at.join("empty.zarr/.zgroup"), r#"{ "zarr_format": 2 }"#).unwrap();
    fails("empty.zarr", &["no `multiscales`"]);
    fs::create_dir(at.join("nothing")).unwrap();
    fails("nothing", &["nothing is a directory, but no OME-Zarr"]);

    // Metadata and chunks, each in an image of its own.
    let damaged = |from: &str, file: &str, change: &dyn Fn(Vec<u8>) -> Vec<u8>| {
        fs::remove_dir_all(at.join("bad.zarr")).ok();
        copy(from, "bad.zarr");
        let path = at.join("bad.zarr").join(file);
        fs::write(&path, change(fs::read(&path).unwrap())).unwrap();
    };
    let swap = |from: &'static str, to: &'static str| {
        move |file: Vec<u8>| {
            let text = String::from_utf8(file).unwrap();
            assert!(text.contains(from), "{from} is not in {text}");
            text.replacen(from, to, 1).into_bytes()
        }
    };
    let cut = |file: Vec<u8>| file[..file.len() / 2].to_vec();
    let flipped = |mut file: Vec<u8>| {
        let middle = file.len() / 2;
        file[middle] ^= 0x55;
        file
    };
    for (from, chunk) in [
        ("v2-plain.zarr", "0/1.1.1"),
        ("v2-zstd.zarr", "0/1.1.1"),
        ("v2-lz4.zarr", "0/1.1.1"),
        ("v2-blosc-lz4-1.zarr", "0/1.1.1"),
        ("v3-gzip.zarr", "0/c/1/1/1"),
        ("v3-blosc-zstd-bitshuffle.zarr", "0/c/1/1/1"),
        ("v3-sharded.zarr", "0/c/1/1/1"),
    ] {
        damaged(from, chunk, &cut);
        fails("bad.zarr", &[chunk, "copy or export it again"]);
    }
    for (from, chunk) in [("v3-checked.zarr", "0/c/1/1/1"), ("v3-sharded-checked.zarr", "0/c/0/1/0")] {
        damaged(from, chunk, &flipped);
        fails("bad.zarr", &[chunk, "checksum"]);
    }
    let array = "0/zarr.json";
    damaged("v3-zstd.zarr", array, &cut);
    fails("bad.zarr", &["0/zarr.json is no JSON"]);
    damaged("v3-zstd.zarr", array, &swap("\"uint16\"", "\"complex64\""));
    fails("bad.zarr", &["the voxel type `complex64` is not read", "uint16"]);
    damaged("v3-zstd.zarr", array, &swap("\"zstd\"", "\"zfp\""));
    fails("bad.zarr", &["the codec `zfp` is not read; read are: blosc"]);
    damaged("v3-zstd.zarr", array, &swap("16,", "1000000,"));
    fails("bad.zarr", &["1000000, 20, 32", "write it in smaller chunks"]);
    damaged("v3-zstd.zarr", array, &swap("16,", "18446744073709551615,"));
    fails("bad.zarr", &["chunks of [18446744073709551615"]);
    damaged("v3-zstd.zarr", array, &swap("37,", "3000000000,"));
    fails("bad.zarr", &["shape"]);
    damaged("v3-zstd.zarr", array, &swap("37,", "2000000,"));
    fails("bad.zarr", &["every axis must have between 1 and"]);
    damaged("v2-zstd.zarr", ".zattrs", &swap("\"path\": \"0\"", "\"path\": \"../v2-plain.zarr/0\""));
    fails("bad.zarr", &["leads out of its group"]);
    damaged("v2-zstd.zarr", ".zattrs", &swap("\"path\": \"0\"", "\"path\": \"5\""));
    fails("bad.zarr", &["names the array `5`, where none lies"]);
    damaged("v2-zstd.zarr", "0/.zarray", &swap("\".\"", "\"/\""));
    fails("bad.zarr", &["not one chunk is there (0/0/0/0 is where the first would be)"]);
}

/// All that a store of it has but its input's name is the same from an object store and a web server; and what is not
/// there, or breaks off, is named.
#[test]
fn ome_zarr_behind_a_network_is_prepared_where_it_lies() {
    let stage = Stage::new();
    let at = stage.at();
    fs::create_dir(at.join("data")).unwrap();
    for name in ["v3-sharded.zarr", "five-2-1.zarr"] {
        fs::rename(at.join(name), at.join("data").join(name)).unwrap();
    }
    let server = S3Server::start(&at.join("data"));
    let web = WebServer::start(&at.join("data"));
    let run = |args: &[&str]| {
        let mut command = brickcast_command(at);
        let output = ends(command.args(args).envs(server.variables(&server.address)), PATIENCE);
        let said = String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned();
        assert!(!said.contains(&server.secret), "the secret key was told: {said}");
        (output.status.code(), said)
    };
    let images: [(&str, &[&str]); 2] =
        [("v3-sharded.zarr", &[]), ("five-2-1.zarr", &["--channel", "1", "--time", "2"])];
    for (name, flags) in images {
        let prepare = |from: &str| {
            let (code, said) = run(&[&["prepare", from, "out", "--brick", "16", "--force"], flags].concat());
            assert_eq!(code, Some(0), "{from}: {said}");
            manifest(&at.join("out"))
        };
        let want = prepare(&format!("data/{name}"));
        assert!(prepare(&format!("s3://scans/{name}")) == want, "another store from the bucket: {name}");
        assert!(prepare(&format!("{}/{name}", web.address)) == want, "another store from the web: {name}");
    }
    let (code, said) = run(&["info", "s3://scans/v3-sharded.zarr", "--json"]);
    assert!(code == Some(0) && said.contains("OME-Zarr (Zarr v3)"), "{said}");
    let (code, said) = run(&["prepare", "s3://scans/nothing.zarr", "out", "--force"]);
    assert!(code == Some(1) && said.contains("s3://scans/nothing.zarr is no OME-Zarr"), "{said}");
    let left: Vec<PathBuf> = fs::read_dir(at).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(left.iter().all(|path| !path.to_string_lossy().contains("brickcast-tmp")), "{left:?}");
}

//! The command line: what good input gives, and what bad input gets.

use std::path::Path;

use brickcast_tests::process::{brickcast, brickcast_both, brickcast_ok, cached_stores};

fn part(folder: &Path) {
    brickcast_ok(folder, &["phantom", "part.nrrd", "--dims", "48,40,44", "--pores", "2"]);
}

/// Exit code and stderr.
fn fails(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = brickcast(folder, args);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    let code = output.status.code().unwrap_or(-1);
    assert_ne!(code, 0, "{args:?} should fail");
    assert!(!error.contains("panicked"), "{args:?}: {error}");
    (code, error)
}

#[test]
fn every_output_format_and_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let base = ["render", "part.nrrd", "--size", "48x32", "--backend", "cpu", "--brick", "16"];
    let render = |extra: &[&str]| brickcast_ok(at, &[&base[..], extra].concat());
    let (_, said) = brickcast_both(at, &[&base[..], &["-o", "a.png"]].concat());
    assert!(said.contains("--window"), "the default transfer function is explained: {said}");
    render(&["-o", "a.exr"]);
    render(&["-o", "a.apng", "--frames", "3", "--orbit", "90"]);
    render(&["-o", "seq.png", "--frames", "3"]);
    render(&["-o", "bare.png", "--no-manifest"]);
    for name in
        ["a.png", "a.png.json", "a.exr", "a.apng", "a.apng.json", "seq_0000.png", "seq_0002.png", "seq_0002.png.json"]
    {
        assert!(at.join(name).is_file(), "{name}");
    }
    assert!(!at.join("bare.png.json").exists());
    assert!(!at.join("seq.png").exists());
    let plan = render(&["--dry-run", "--local", "3"]);
    assert!(plan.contains("local 2") && plan.contains("layers"), "{plan}");
}

#[test]
fn the_cache_is_reused_while_the_input_is_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let render = || brickcast_ok(at, &["render", "part.nrrd", "-o", "a.png", "--size", "16x16", "--backend", "cpu"]);
    let stores = || cached_stores(&at.join("cache")).len();
    render();
    render();
    assert_eq!(stores(), 1);
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "40,40,40", "--pores", "1", "--force"]);
    render();
    assert_eq!(stores(), 2);
}

#[test]
fn info_speaks_of_inputs_and_stores_alike() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--brick", "16"]);
    let of = |path: &str| -> serde_json::Value {
        serde_json::from_str(&brickcast_ok(at, &["info", path, "--json"])).unwrap()
    };
    let (input, store) = (of("part.nrrd"), of("part"));
    for key in ["dims", "spacing", "min", "max", "otsu", "quantiles"] {
        assert_eq!(input[key], store[key], "{key}");
    }
    assert!(brickcast_ok(at, &["info", "part"]).contains("48 x 40 x 44"));
}

#[test]
fn levels_are_made_until_the_volume_is_one_brick_or_as_many_as_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let levels = |flags: &[&str]| {
        brickcast_ok(at, &[&["prepare", "part.nrrd", "part", "--brick", "16", "--force"], flags].concat());
        let info: serde_json::Value = serde_json::from_str(&brickcast_ok(at, &["info", "part", "--json"])).unwrap();
        (info["levels"].to_string(), brickcast_ok(at, &["info", "part"]))
    };
    let (json, text) = levels(&[]);
    assert_eq!(json, "[[48,40,44],[24,20,22],[12,10,11]]");
    assert!(text.contains("levels     3: 48 x 40 x 44, 24 x 20 x 22, 12 x 10 x 11\n"), "{text}");
    assert_eq!(levels(&["--levels", "auto"]).0, json);
    assert_eq!(levels(&["--levels", "99"]).0, json);
    assert_eq!(levels(&["--levels", "1"]).0, "[[48,40,44],[24,20,22]]");
    assert_eq!(levels(&["--levels", "0"]).0, "[[48,40,44]]");
    for bad in ["-1", "many", "256"] {
        let (code, error) = fails(at, &["prepare", "part.nrrd", "bad", &format!("--levels={bad}")]);
        assert!(code == 2 && error.contains(bad) && error.contains("auto"), "{code}: {error}");
    }
    let input: serde_json::Value = serde_json::from_str(&brickcast_ok(at, &["info", "part.nrrd", "--json"])).unwrap();
    assert!(input["levels"].is_null());
}

/// With regions, `info` says so; the cache tells regions, labels and none apart.
#[test]
fn regions_are_asked_for_by_range_or_label_volume() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let prepare = ["prepare", "part.nrrd", "part", "--brick", "16", "--segmentation-range", "0.2"];
    let (_, said) = brickcast_both(at, &prepare);
    assert!(said.contains("regions (windows of range 0.2"), "{said}");
    let info: serde_json::Value = serde_json::from_str(&brickcast_ok(at, &["info", "part", "--json"])).unwrap();
    let regions = &info["regions"];
    assert_eq!((&regions["method"], regions["segmentation_range"].as_f64()), (&"windows".into(), Some(0.2)));
    assert!(regions["count"].as_u64() > Some(0) && regions["share"].as_f64() > Some(0.1), "{regions}");
    // A mean is no further than the range from any voxel of its region.
    let deviation = regions["largest_deviation"].as_f64().unwrap();
    let [lo, hi] = [0, 1].map(|i| info["range"][i].as_f64().unwrap());
    assert!(deviation > 0.0 && deviation <= 0.2 * (hi - lo), "{regions}");
    assert!(brickcast_ok(at, &["info", "part"]).contains("windows of range 0.2"));

    brickcast_ok(at, &["prepare", "part.nrrd", "none", "--brick", "16", "--segmentation-range", "0"]);
    brickcast_ok(at, &["prepare", "part.nrrd", "plain", "--brick", "16"]);
    let manifest = |store: &str| std::fs::read(at.join(store).join("brickcast.json")).unwrap();
    assert_eq!(manifest("none"), manifest("plain"));

    std::fs::write(at.join("l_48x40x44_uint8.raw"), vec![5; 48 * 40 * 44]).unwrap();
    let (_, said) = brickcast_both(at, &["prepare", "part.nrrd", "given", "--labels", "l_48x40x44_uint8.raw"]);
    assert!(said.contains("1 regions (labels") && said.contains("100.0 % of the voxels"), "{said}");

    for (args, says) in [
        (&["--segmentation-range", "1.5"][..], "from 0 to 1"),
        (&["--min-region", "9"], "--segmentation-range"),
        (&["--segmentation", "flood"], "--segmentation-range"),
        (&["--labels", "x.raw", "--segmentation-range", "0.1"], "cannot be used with"),
    ] {
        let (code, error) = fails(at, &[&["prepare", "part.nrrd", "bad"], args].concat());
        assert!(code == 2 && error.contains(says), "{code}: {error}");
    }

    let dry = |more: &[&str]| {
        let args = ["render", "part.nrrd", "--dry-run", "--brick", "16", "--cache-dir", "cache", "--backend", "cpu"];
        brickcast_ok(at, &[&args[..], more].concat());
        cached_stores(&at.join("cache")).len()
    };
    assert_eq!(dry(&[]), 1);
    assert_eq!(dry(&["--segmentation-range", "0.2"]), 2);
    assert_eq!(dry(&["--segmentation-range", "0.2", "--min-region", "9"]), 3);
    assert_eq!(dry(&["--labels", "l_48x40x44_uint8.raw"]), 4);
    assert_eq!(dry(&["--segmentation-range", "0.2"]), 4);
    std::fs::write(at.join("l_48x40x44_uint8.raw"), vec![0; 48 * 40 * 44]).unwrap();
    assert_eq!(dry(&["--labels", "l_48x40x44_uint8.raw"]), 5);
}

#[test]
fn usage_errors_exit_with_two_and_name_the_operand() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    for (args, word) in [
        (vec!["--size", "0x10"], "0x10"),
        (vec!["--size", "99999x99999"], "99999"),
        (vec!["--size", "ten"], "ten"),
        (vec!["--step", "0"], "step"),
        (vec!["--step", "nan"], "step"),
        (vec!["--zoom", "-1"], "zoom"),
        (vec!["--view-angle", "180"], "180"),
        (vec!["--position", "1,1,1", "--focal-point", "1,1,1"], "focalPoint"),
        (vec!["--position", "1,nan,1"], "position"),
        (vec!["--position", "0,90,0", "--focal-point", "0,0,0"], "viewUp"),
        (vec!["--early-termination", "2"], "early-termination"),
        (vec!["--window", "5,1"], "5"),
        (vec!["--colormap", "beige"], "viridis"),
        (vec!["--frames", "0"], "frames"),
        (vec!["--local", "0"], "local"),
        (vec!["--deadline", "0s"], "0s"),
        (vec!["--memory-budget", "lots"], "lots"),
        (vec!["--nodes", "x:1", "--local", "2"], "--local"),
        (vec!["--exact", "--transport", "u8"], "transport"),
        (vec!["-o", "x.bmp"], "png"),
        (vec!["--brick", "17"], "17"),
    ] {
        let mut all = vec!["render", "part.nrrd", "--backend", "cpu"];
        if args[0] == "--nodes" {
            all.truncate(2);
        }
        if args[0] != "-o" {
            all.extend(["-o", "x.png"]);
        }
        all.extend(&args);
        let (code, error) = fails(at, &all);
        assert!(code == 2 && error.contains(word), "{args:?}: {code} {error}");
        assert!(!at.join("x.png").exists());
    }
}

#[test]
fn bad_files_exit_with_one_and_say_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let write = |name: &str, bytes: &[u8]| std::fs::write(at.join(name), bytes).unwrap();
    let good = std::fs::read(at.join("part.nrrd")).unwrap();
    write("short.nrrd", &good[..good.len() - 100]);
    write("long.nrrd", &[&good[..], &[0; 7]].concat());
    write("empty.nrrd", b"");
    write("words.txt", b"hello");
    let header = |fields: &str| format!("NRRD0004\n{fields}\n\n").into_bytes();
    write("type.nrrd", &header("type: quaternion\ndimension: 3\nsizes: 2 2 2\nencoding: raw"));
    write("encoding.nrrd", &header("type: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: bzip2"));
    write("zero.nrrd", &header("type: uint8\ndimension: 3\nsizes: 2 0 2\nencoding: raw"));
    write("huge.nrrd", &header("type: uint8\ndimension: 3\nsizes: 4294967295 4294967295 4294967295\nencoding: raw"));
    write(
        "spacing.nrrd",
        &[header("type: uint8\ndimension: 3\nsizes: 2 2 2\nspacings: 1 -1 1\nencoding: raw"), vec![0; 8]].concat(),
    );
    write("detached.nhdr", &header("type: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: gone.raw"));
    write("part_4x4x4_uint8.raw", &[0; 63]);
    write("unknown.raw", &[0; 64]);
    for (name, words) in [
        ("short.nrrd", vec!["short.nrrd"]),
        ("long.nrrd", vec!["long.nrrd"]),
        ("empty.nrrd", vec!["empty.nrrd"]),
        ("words.txt", vec!["words.txt"]),
        ("type.nrrd", vec!["quaternion"]),
        ("encoding.nrrd", vec!["bzip2"]),
        ("zero.nrrd", vec!["0"]),
        ("huge.nrrd", vec!["4294967295"]),
        ("spacing.nrrd", vec!["-1"]),
        ("detached.nhdr", vec!["gone.raw"]),
        ("part_4x4x4_uint8.raw", vec!["63", "64"]),
        ("unknown.raw", vec!["--dims"]),
        ("missing.nrrd", vec!["missing.nrrd"]),
    ] {
        let (code, error) = fails(at, &["prepare", name, "out"]);
        assert_eq!(code, 1, "{name}: {error}");
        for word in words {
            assert!(error.contains(word), "{name}: `{word}` is not named: {error}");
        }
        assert!(!at.join("out").exists(), "{name}: something half-written");
        let left: Vec<_> = std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert!(left.iter().all(|n| !n.to_string_lossy().contains("tmp")), "{left:?}");
    }
}

#[test]
fn malformed_presets_and_cameras_name_path_and_position() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    write("broken.json", "[{\"RGBPoints\": [0, 1, 1,\n");
    write("shape.json", "[{\"RGBPoints\": [0, 1, \"red\", 1]}]");
    write("count.json", "[{\"RGBPoints\": [0, 1, 1, 1, 5]}]");
    write("camera.json", "{\"position\": [0, 0, 9]}");
    write("up.json", "{\"position\": [0, 0, 9], \"focalPoint\": [0, 0, 0], \"viewUp\": [0, 0, 1]}");
    for (flag, file, word) in [
        ("--transfer-function", "broken.json", "line"),
        ("--transfer-function", "shape.json", "RGBPoints[2]"),
        ("--transfer-function", "count.json", "RGBPoints"),
        ("--transfer-function", "none.json", "none.json"),
        ("--camera", "camera.json", "focalPoint"),
        ("--camera", "up.json", "viewUp"),
    ] {
        let (code, error) = fails(at, &["render", "part.nrrd", "-o", "x.png", "--backend", "cpu", flag, file]);
        assert!(code == 1 && error.contains(word), "{file}: {code} {error}");
    }
}

#[test]
fn what_is_broken_in_a_store_is_named_and_not_rendered() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--brick", "16"]);
    let mut shards = Vec::new();
    let mut folders = vec![at.join("part/0/c")];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap().map(Result::unwrap) {
            if entry.path().is_dir() { folders.push(entry.path()) } else { shards.push(entry.path()) }
        }
    }
    let shard = &shards[0];
    let good = std::fs::read(shard).unwrap();
    let mut bad = good.clone();
    bad[good.len() / 3] ^= 0x10;
    std::fs::write(shard, &bad).unwrap();
    let render = ["render", "part", "-o", "x.png", "--backend", "cpu", "--size", "32x32", "--window", "0,100"];
    let (code, error) = fails(at, &render);
    assert!(code == 4 && error.contains("0/c/") && error.contains("drawn coarser"), "{code} {error}");
    std::fs::write(shard, &good[..good.len() - 9]).unwrap();
    let (code, error) = fails(at, &render);
    assert!(code == 4 && error.contains("0/c/") && error.contains("drawn coarser"), "{code} {error}");
    std::fs::write(at.join("part/bricks.bin"), b"short").unwrap();
    std::fs::remove_file(at.join("x.png")).unwrap();
    let (code, error) = fails(at, &render);
    assert!(code == 1 && error.contains("bricks.bin") && !at.join("x.png").exists(), "{code} {error}");
}

#[test]
fn prepare_never_loses_an_existing_store() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--brick", "16"]);
    let before = brickcast_ok(at, &["info", "part", "--json"]);
    let (code, error) = fails(at, &["prepare", "part.nrrd", "part"]);
    assert!(code == 1 && error.contains("--force"), "{error}");
    let good = std::fs::read(at.join("part.nrrd")).unwrap();
    std::fs::write(at.join("short.nrrd"), &good[..good.len() / 2]).unwrap();
    fails(at, &["prepare", "short.nrrd", "part", "--force"]);
    assert_eq!(before, brickcast_ok(at, &["info", "part", "--json"]));
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--force", "--brick", "32"]);
}

#[test]
fn help_names_exit_codes_and_version_names_the_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let help = brickcast_ok(folder.path(), &["--help"]);
    assert!(help.contains("Exit codes") && help.contains("3  incomplete"), "{help}");
    assert!(brickcast_ok(folder.path(), &["--version"]).contains("protocol"));
    assert!(brickcast_ok(folder.path(), &["completions", "bash"]).contains("brickcast"));
}

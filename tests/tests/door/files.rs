//! Files that are not what they should be: pipes, devices, files without end, headers that promise more than there is
//! memory, names that speak to terminals, two outputs of one name.

use std::fs::File;
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

use brickcast_tests::patience::ends;
use brickcast_tests::process::{brickcast_command, brickcast_ok};
use brickcast_tests::turn;

const PATIENCE: Duration = Duration::from_secs(60);

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
}

fn run(at: &Path, args: &[&str]) -> (Option<i32>, String) {
    let output = ends(brickcast_command(at).args(args), PATIENCE);
    (output.status.code(), said(&output))
}

/// As [`run`], within so many KiB of address space.
fn run_within(at: &Path, kib: u64, args: &[&str]) -> (Option<i32>, String) {
    let inner = brickcast_command(at);
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -v {kib} && exec \"$0\" \"$@\"")]).arg(inner.get_program()).args(args);
    command.current_dir(at).env("RAYON_NUM_THREADS", "2").env("XDG_CONFIG_HOME", at.join("no-configuration"));
    command.env("BRICKCAST_CACHE_DIR", at.join("cache")).env_remove("RUST_LOG");
    let output = ends(&mut command, 5 * PATIENCE);
    (output.status.code(), said(&output))
}

fn mkfifo(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

fn store(at: &Path) {
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "48,40,44", "--pores", "2"]);
    brickcast_ok(at, &["prepare", "part.nrrd", "s", "--brick", "16"]);
}

/// An NRRD file of zeros that takes no room on the disk.
fn sparse(path: &Path, sizes: [u64; 3], (kind, bytes): (&str, u64)) {
    let [x, y, z] = sizes;
    let header = format!("NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {x} {y} {z}\nendian: little\nencoding: raw\n\n");
    std::fs::write(path, &header).unwrap();
    let file = File::options().write(true).open(path).unwrap();
    file.set_len(header.len() as u64 + x * y * z * bytes).unwrap();
}

/// Pipes were waited for without end, devices and large files read into memory until it was gone.
#[test]
fn no_file_of_parameters_is_waited_for_or_read_without_end() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    store(at);
    mkfifo(&at.join("pipe"));
    File::create(at.join("large")).unwrap().set_len(1 << 40).unwrap();
    std::fs::create_dir(at.join("tls")).unwrap();
    symlink("/dev/zero", at.join("tls/ca.pem")).unwrap();
    for (path, why) in
        [("pipe", "is a named pipe"), ("/dev/zero", "is a character device"), ("large", "has more than the")]
    {
        let (list, base) =
            (format!("file:{path}"), ["render", "s", "-o", "o.png", "--backend", "cpu", "--size", "16x16"]);
        for args in [
            &["transfer-function", "show", path][..],
            &["transfer-function", "convert", path, "o.json"],
            &[&base[..], &["--camera", path]].concat(),
            &[&base[..], &["--transfer-function", path]].concat(),
            &["nodes", "--nodes", &list],
            &["nodes", "--nodes", "127.0.0.1:1", "--token-file", path],
            &["nodes", "--nodes", "127.0.0.1:1", "--config", path],
            &["config", "--config", path],
        ] {
            let (code, text) = run(at, args);
            assert!(matches!(code, Some(1 | 2)), "{args:?}: {code:?} {text}");
            assert!(text.contains(path) && text.contains(why), "{args:?}: {text}");
        }
    }
    let (code, text) = run(at, &["nodes", "--nodes", "127.0.0.1:1", "--tls", "tls"]);
    assert!(code == Some(1) && text.contains("ca.pem is a character device"), "{text}");
    assert!(!at.join("o.png").exists());
}

#[test]
fn a_volume_that_is_a_pipe_or_a_device_is_refused_by_name() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    store(at);
    mkfifo(&at.join("pipe.nrrd"));
    symlink("/dev/zero", at.join("zero_9x9x9_uint8.raw")).unwrap();
    for (path, kind) in [("pipe.nrrd", "a named pipe"), ("zero_9x9x9_uint8.raw", "a character device")] {
        for args in [
            &["info", path][..],
            &["prepare", path, "x"],
            &["prepare", "part.nrrd", "x", "--labels", path],
            &["render", path, "-o", "o.png"],
            &["render", path, "-o", "o.png", "--nodes", "127.0.0.1:1"],
        ] {
            let (code, text) = run(at, args);
            assert!(code == Some(1) && text.contains(path) && text.contains(kind), "{args:?}: {code:?} {text}");
        }
    }
    assert!(!at.join("x").exists());
}

/// A plane of a gigabyte in less memory than that: what is held does not follow the plane.
#[test]
fn one_gigantic_plane_is_looked_at_and_prepared_in_parts() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    sparse(&at.join("plane.nrrd"), [1 << 15, 1 << 15, 1], ("uint8", 1));
    let (code, text) = run_within(at, 900_000, &["info", "plane.nrrd"]);
    assert!(code == Some(0) && text.contains("1073741824 voxels"), "{code:?} {text}");
    // Every shard goes to the disk by itself: fewer of them.
    sparse(&at.join("half.nrrd"), [1 << 14, 1 << 14, 1], ("uint16", 2));
    let (code, text) = run_within(at, 400_000, &["prepare", "half.nrrd", "half", "--brick", "512"]);
    assert!(code == Some(0) && text.contains("1024 bricks"), "{code:?} {text}");
}

/// Ended with SIGABRT, or with the machine's other programs.
#[test]
fn a_volume_that_needs_more_memory_than_there_is_is_refused_with_both_figures() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    sparse(&at.join("deep.nrrd"), [2048, 2048, 64], ("uint16", 2));
    let (code, text) = run_within(at, 330_000, &["prepare", "deep.nrrd", "deep"]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("preparing this volume needs at least") && text.contains("ulimit -v"), "{text}");
    sparse(&at.join("wide.nrrd"), [1 << 18, 1 << 18, 1], ("uint8", 1));
    let (code, text) = run(at, &["prepare", "wide.nrrd", "wide", "--segmentation-range", "0.1", "--brick", "256"]);
    assert!(code == Some(1) && text.contains("regions hold whole planes"), "{code:?} {text}");
    let left: Vec<_> = std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "{left:?}");
}

#[test]
fn names_of_files_and_addresses_never_reach_a_terminal_raw() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    store(at);
    let name = "e\x1b[31mv\u{202e}il\n.nrrd";
    std::fs::copy(at.join("part.nrrd"), at.join(name)).unwrap();
    std::fs::write(at.join("list"), "127.0.0.1:1\x1b[2J\u{202e}\n").unwrap();
    let escaped = "e\\u{1b}[31mv\\u{202e}il";
    for (args, shown) in [
        (&["info", name][..], escaped),
        (&["prepare", name, "e\x1b[1m.store"], "e\\u{1b}[1m.store"),
        (&["prepare", "no\x1b[1msuch", "x"], "no\\u{1b}[1msuch"),
        (&["render", "s", "-o", "no\u{202e}/x\x07.png", "--size", "8x8"], "x"),
        (&["render", "s", "-o", "x.png", "--camera", name, "--size", "8x8"], escaped),
        (&["nodes", "--nodes", "file:list"], "127.0.0.1:1\\u{1b}[2J\\u{202e}"),
    ] {
        let (_, text) = run(at, args);
        assert!(text.contains(shown), "{args:?}: {text:?}");
        let bad = |c: char| (c.is_control() && c != '\n') || ('\u{202a}'..='\u{202e}').contains(&c);
        assert!(!text.contains(bad), "{args:?}: {text:?}");
        assert!(!text.contains("il\n.nrrd"), "a line of another's making: {text:?}");
    }
}

#[test]
fn a_cause_is_told_once() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    store(at);
    for args in [
        &["info", "none.nrrd"][..],
        &["render", "s", "-o", "x.png", "--backend", "cpu", "--camera", "none"],
        &["nodes", "--nodes", "127.0.0.1:1", "--token-file", "none"],
        &["nodes", "--nodes", "file:none"],
        &["config", "--config", "none"],
        &["prepare", "part.nrrd", "s/zarr.json/x"],
        &["tls", "init", "part.nrrd/x"],
    ] {
        let output = ends(brickcast_command(at).args(args), PATIENCE);
        let (code, text) = (output.status.code(), String::from_utf8_lossy(&output.stderr));
        assert!(matches!(code, Some(1 | 2)), "{args:?}: {text}");
        assert!(text.matches("os error").count() <= 1, "{args:?}: {text}");
        assert_eq!(text.trim().lines().count(), 1, "{args:?}: {text}");
    }
}

/// The statistics took the place of the picture, and the command said that all was well.
#[test]
fn statistics_do_not_take_the_place_of_the_picture() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    store(at);
    std::fs::create_dir(at.join("sub")).unwrap();
    symlink(at, at.join("link")).unwrap();
    let base = ["render", "s", "-o", "a.png", "--size", "16x16", "--backend", "cpu", "--stats"];
    for (stats, more) in [
        ("a.png", &[][..]),
        ("sub/../a.png", &[]),
        ("link/a.png", &[]),
        ("a.png.json", &[]),
        ("a_0002.png", &["--frames", "3"]),
        ("a_0000.png.json", &["--frames", "3"]),
    ] {
        let (code, text) = run(at, &[&base[..], &[stats], more].concat());
        assert!(code == Some(2) && text.contains("--stats") && text.contains("same file"), "{stats}: {code:?} {text}");
    }
    assert!(!at.join("a.png").exists() && !at.join("a_0000.png").exists());
    let (code, text) = run(at, &[&base[..], &["a.png.json", "--no-manifest"]].concat());
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn keys_that_others_can_read_are_told_of_where_they_are_used() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    brickcast_ok(at, &["tls", "init", "tls"]);
    let ask = || run(at, &["nodes", "--nodes", "127.0.0.1:1", "--tls", "tls"]).1;
    assert!(!ask().contains("by others"), "{}", ask());
    for name in ["client.key", "token"] {
        std::fs::set_permissions(at.join("tls").join(name), std::fs::Permissions::from_mode(0o644)).unwrap();
        let text = ask();
        assert!(text.contains(&format!("{name} (mode 644) can be read or changed by others")), "{text}");
    }
}

/// A certificate of one authority beside the key of another fits nothing.
#[test]
fn certificates_that_cannot_all_be_made_leave_those_that_were_there() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    brickcast_ok(at, &["tls", "init", "tls"]);
    std::fs::remove_file(at.join("tls/token")).unwrap();
    std::fs::create_dir(at.join("tls/token")).unwrap();
    let content = |name: &str| std::fs::read(at.join("tls").join(name)).unwrap();
    let files = ["ca.pem", "ca.key", "node.pem", "node.key", "client.pem", "client.key"];
    let before = files.map(content);
    let (code, text) = run(at, &["tls", "init", "tls", "--force"]);
    assert!(code == Some(1) && text.contains("token") && text.contains("is a folder"), "{code:?} {text}");
    assert!(files.map(content) == before);
    assert_eq!(std::fs::read_dir(at.join("tls")).unwrap().count(), 7);
    let (code, text) = run(at, &["tls", "init", "new", "--name", "ü.example"]);
    assert!(code == Some(1) && text.contains("cannot make certificates"), "{code:?} {text}");
    assert!(!at.join("new").exists());
}

//! The cache of inputs prepared on the way, as several programs and other users meet it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use brickcast_tests::process::{brickcast, brickcast_both, brickcast_command, brickcast_ok, cached_stores};

const RENDER: [&str; 7] = ["render", "--backend", "cpu", "--size", "32x32", "--no-manifest", "-o"];

fn phantom(at: &Path, name: &str, seed: &str) {
    brickcast_ok(at, &["phantom", name, "--dims", "40,40,40", "--pores", "3", "--seed", seed, "--force"]);
}

fn render(at: &Path, input: &str, picture: &str, more: &[&str]) -> Output {
    brickcast(at, &[&RENDER[..], &[picture, input], more].concat())
}

fn error(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn command(at: &Path, input: &str, picture: &str) -> Command {
    let mut command = brickcast_command(at);
    command.args(RENDER).args([picture, input]);
    command
}

#[test]
fn eight_renders_at_once_on_a_cold_cache_all_succeed_and_prepare_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    phantom(at, "p.nrrd", "1");
    for round in 0..3 {
        let running: Vec<_> = (0..8)
            .map(|i| {
                let mut one = command(at, "p.nrrd", &format!("{i}.png"));
                one.stderr(Stdio::piped()).stdout(Stdio::piped()).arg("-v").spawn().unwrap()
            })
            .collect();
        let done: Vec<_> = running.into_iter().map(|child| child.wait_with_output().unwrap()).collect();
        for output in &done {
            assert!(output.status.success(), "round {round}: {}", error(output));
        }
        let pictures: Vec<_> = (0..8).map(|i| fs::read(at.join(format!("{i}.png"))).unwrap()).collect();
        assert!(pictures.iter().all(|picture| *picture == pictures[0]));
        assert_eq!(cached_stores(&at.join("cache")).len(), 1);
        let names: Vec<_> = fs::read_dir(at.join("cache")).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert!(names.iter().all(|name| !name.to_string_lossy().contains("tmp")), "{names:?}");
        fs::remove_dir_all(at.join("cache")).unwrap();
    }
}

/// A header with its data apart, under every name and spelling by which it is known.
#[test]
fn new_data_behind_an_unchanged_header_is_never_shown_as_the_old() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let data = |upper: bool| {
        let voxel = |i: u32| if (i / 32 % 32 < 16) == upper { (i % 32 * 8) as u8 } else { 0 };
        fs::write(at.join("d.raw"), (0..32 * 32 * 32).map(voxel).collect::<Vec<_>>()).unwrap();
    };
    for (name, line, comment) in [
        ("v.nhdr", "data file: d.raw", &b""[..]),
        ("v.nrrd", "data file: d.raw", b""),
        ("v.nhdr", "Data File: d.raw", b""),
        ("v.nhdr", "data file: d.raw", b"# caf\xe9 latin1\n"),
        ("v.NHDR", "datafile: d.raw", b""),
        ("v.raw", "data file: d.raw", b""),
        ("v", "data file: d.raw", b""),
    ] {
        let _ = fs::remove_dir_all(at.join("cache"));
        let fields = format!("type: uint8\ndimension: 3\nsizes: 32 32 32\nspacings: 1 1 1\nencoding: raw\n{line}\n\n");
        fs::write(at.join(name), [b"NRRD0004\n", comment, fields.as_bytes()].concat()).unwrap();
        data(true);
        assert!(render(at, name, "a.png", &[]).status.success(), "{name}");
        assert!(render(at, name, "again.png", &[]).status.success(), "{name}");
        assert_eq!(cached_stores(&at.join("cache")).len(), 1, "{name}, {line}: found again");
        std::thread::sleep(std::time::Duration::from_millis(50));
        data(false);
        assert!(render(at, name, "b.png", &[]).status.success(), "{name}");
        assert!(render(at, name, "fresh.png", &["--cache-dir", "other"]).status.success(), "{name}");
        fs::remove_dir_all(at.join("other")).unwrap();
        let picture = |name: &str| fs::read(at.join(name)).unwrap();
        assert!(picture("a.png") != picture("b.png"), "{name}, {line}: the old picture");
        assert!(picture("b.png") == picture("fresh.png"), "{name}, {line}");
    }
}

/// Whoever or whatever put it there: a hash in a name says nothing of what is in the folder.
#[test]
fn a_store_that_was_not_made_of_this_input_is_not_taken_from_the_cache() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    phantom(at, "p.nrrd", "1");
    phantom(at, "q.nrrd", "2");
    assert!(render(at, "p.nrrd", "p.png", &[]).status.success());
    let entry = cached_stores(&at.join("cache")).remove(0);
    brickcast_ok(at, &["prepare", "q.nrrd", "planted"]);
    fs::remove_dir_all(&entry).unwrap();
    fs::rename(at.join("planted"), &entry).unwrap();
    let output = render(at, "p.nrrd", "again.png", &[]);
    assert!(output.status.success() && error(&output).contains("is not made of p.nrrd"), "{}", error(&output));
    assert_eq!(fs::read(at.join("p.png")).unwrap(), fs::read(at.join("again.png")).unwrap());
    let key = entry.with_file_name(format!("{}.key", entry.file_name().unwrap().to_str().unwrap()));
    fs::write(&key, fs::read_to_string(&key).unwrap() + "file of another volume\n").unwrap();
    assert!(error(&render(at, "p.nrrd", "again.png", &[])).contains("is not made of p.nrrd"));
    fs::remove_file(&key).unwrap();
    assert!(error(&render(at, "p.nrrd", "again.png", &[])).contains("is missing"));
    let output = render(at, "p.nrrd", "again.png", &[]);
    assert!(output.status.success() && !error(&output).contains("WARN"), "found as it was made: {}", error(&output));
}

#[test]
fn the_cache_keeps_its_size_and_says_what_went() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ["1", "2", "3"].iter().for_each(|seed| phantom(at, &format!("p{seed}.nrrd"), seed));
    let size = ["--cache-size", "600k"];
    let run = |input: &str| {
        let output = render(at, input, "x.png", &size);
        assert!(output.status.success(), "{}", error(&output));
        error(&output)
    };
    assert!(!run("p1.nrrd").contains("WARN"));
    let bytes = |dir: &Path| -> u64 {
        let mut open = vec![dir.to_path_buf()];
        let mut sum = 0;
        while let Some(next) = open.pop() {
            for entry in fs::read_dir(next).unwrap().flatten() {
                if entry.path().is_dir() { open.push(entry.path()) } else { sum += entry.metadata().unwrap().len() }
            }
        }
        sum
    };
    let one = bytes(&cached_stores(&at.join("cache"))[0]);
    assert!(
        (200_000..400_000).contains(&one),
        "the premise: one fits with what the next may need, three do not: {one}"
    );
    run("p2.nrrd");
    run("p1.nrrd");
    let said = run("p3.nrrd");
    assert!(said.contains("removed") && said.contains("p2-") && said.contains("--cache-size"), "{said}");
    assert!(bytes(&at.join("cache")) <= 600 << 10);
    assert!(cached_stores(&at.join("cache")).iter().all(|store| !store.to_str().unwrap().contains("p2-")));
    let output = render(at, "p2.nrrd", "x.png", &["--cache-size", "10k"]);
    assert!(error(&output).contains("more than the 10k of --cache-size"), "{}", error(&output));
    let output = render(at, "p2.nrrd", "x.png", &["--cache-size", "lots"]);
    assert!(output.status.code() == Some(2) && error(&output).contains("lots"), "{}", error(&output));
}

#[test]
fn the_demos_volume_is_an_entry_of_the_cache_and_makes_room_for_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let demo = |dims: &str| {
        let args =
            ["demo", "--dims", dims, "--size", "32x32", "-o", "d.png", "--backend", "cpu", "--cache-size", "1MiB"];
        brickcast_both(at, &args).1
    };
    let stores = || cached_stores(&at.join("cache"));
    assert!(demo("48,48,48").contains("made a phantom part"));
    let first = stores();
    assert!(demo("48,48,48").contains("still there") && stores() == first);
    assert!(demo("72,72,72").contains("made a phantom part"));
    let second = stores();
    assert!(second.len() == 1 && second != first, "{second:?}");
    let names: Vec<_> = fs::read_dir(at.join("cache")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(names.iter().all(|name| !name.to_string_lossy().contains("phantom-")), "{names:?}");
}

#[cfg(unix)]
#[test]
fn without_a_home_the_cache_is_a_folder_of_the_users_own_that_nobody_else_prepared() {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    phantom(at, "p.nrrd", "1");
    let temporary = at.join("tmp");
    fs::create_dir(&temporary).unwrap();
    let homeless = || {
        let mut one = command(at, "p.nrrd", "x.png");
        for name in ["HOME", "XDG_CACHE_HOME", "BRICKCAST_CACHE_DIR"] {
            one.env_remove(name);
        }
        one.env("TMPDIR", &temporary).output().unwrap()
    };
    assert!(homeless().status.success());
    let user = fs::metadata(&temporary).unwrap().uid();
    let cache = temporary.join(format!("brickcast-{user}"));
    assert_eq!(fs::metadata(&cache).unwrap().mode() & 0o777, 0o700);
    assert_eq!(cached_stores(&cache).len(), 1);
    fs::set_permissions(&cache, fs::Permissions::from_mode(0o777)).unwrap();
    let output = homeless();
    let said = error(&output);
    assert!(output.status.code() == Some(1) && said.contains("others may read or write there (mode 777)"), "{said}");
}

#[cfg(unix)]
#[test]
fn a_long_wait_says_what_it_waits_for_and_a_dead_maker_holds_nobody_up() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    phantom(at, "p.nrrd", "1");
    assert!(render(at, "p.nrrd", "x.png", &[]).status.success());
    let entry = cached_stores(&at.join("cache")).remove(0);
    let lock = entry.with_file_name(format!("{}.lock", entry.file_name().unwrap().to_str().unwrap()));
    fs::remove_dir_all(&entry).unwrap();
    // As a maker that died would leave it: its number in the file, and nobody's lock on it.
    fs::write(&lock, "123456789").unwrap();
    let held = fs::File::options().write(true).open(&lock).unwrap();
    held.lock().unwrap();
    let waiting = command(at, "p.nrrd", "y.png").stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert!(!at.join("y.png").exists());
    drop(held);
    let output = waiting.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", error(&output));
    assert!(error(&output).contains("waiting for another brickcast that prepares p.nrrd"), "{}", error(&output));
}

//! Signals in the middle of writing, and what a killed writer leaves.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use brickcast_harness::not_tried;
use brickcast_tests::patience::output;
use brickcast_tests::process::{brickcast_command, brickcast_ok};

pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

pub(crate) fn names(at: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

pub(crate) fn is_temporary(name: &str) -> bool {
    name.starts_with('.') && name.contains(".brickcast-")
}

/// A process that has begun to write in `folder`.
pub(crate) fn writing(at: &Path, folder: &Path, args: &[&str]) -> Child {
    let mut command = brickcast_command(at);
    command.args(args);
    begun(command, folder)
}

/// As [`writing`], of a command that is ready.
pub(crate) fn begun(mut command: Command, folder: &Path) -> Child {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let started = Instant::now();
    while !folder.is_dir() || !names(folder).iter().any(|name| is_temporary(name)) {
        assert!(child.try_wait().unwrap().is_none(), "{command:?} ended before it could be interrupted");
        assert!(started.elapsed() < PATIENCE, "{command:?} does not write");
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

pub(crate) fn signal(child: &Child, signal: &str) {
    assert!(Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).status().unwrap().success());
}

/// True where tests are run so that programs must not hear it (`nohup`).
pub(crate) fn is_ignored(number: u32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    u64::from_str_radix(mask.trim(), 16).unwrap() >> (number - 1) & 1 == 1
}

/// Parts, working folders and half-filled caches stayed for ever.
#[test]
fn a_signal_leaves_nothing_half_written_and_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    brickcast_ok(at, &["phantom", "small.nrrd", "--dims", "32,32,32", "--pores", "1"]);
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "320,320,320", "--pores", "2"]);
    brickcast_ok(at, &["prepare", "small.nrrd", "s", "--brick", "16"]);
    std::fs::create_dir(at.join("cache")).unwrap();
    let before = names(at);
    let manifest = std::fs::read(at.join("s/brickcast.json")).unwrap();
    let cache = at.join("cache");
    let commands: [(&Path, &[&str]); 4] = [
        (at, &["phantom", "big.nrrd", "--dims", "512,512,512", "--pores", "1"]),
        (at, &["prepare", "part.nrrd", "s", "--brick", "16", "--force", "--segmentation-range", "0.1"]),
        (&cache, &["render", "part.nrrd", "-o", "b.png", "--brick", "16", "--backend", "cpu"]),
        (&cache, &["demo", "--dims", "320,320,320", "-o", "d.png", "--backend", "cpu"]),
    ];
    for (number, name) in [(2, "INT"), (15, "TERM"), (1, "HUP")] {
        if is_ignored(number) {
            not_tried(format_args!("SIG{name} is ignored here"));
            continue;
        }
        for (writes_in, args) in commands {
            let child = writing(at, writes_in, args);
            signal(&child, name);
            let ended = output(child, PATIENCE, &format!("{args:?} after SIG{name}"));
            let text = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(ended.status.code(), Some(128 + number as i32), "{args:?}: {text}");
            assert!(text.contains(&format!("ended by SIG{name}")), "{args:?}: {text}");
            assert_eq!(names(at), before, "{args:?} after SIG{name}");
            // Of an entry that is being made there stay its lock, and its name, which says that it is none yet.
            let stays = |name: &String| name.ends_with(".lock") || name.ends_with(".key");
            assert!(names(&cache).iter().all(stays), "{args:?} after SIG{name}: {:?}", names(&cache));
        }
    }
    assert!(std::fs::read(at.join("s/brickcast.json")).unwrap() == manifest);
}

#[test]
fn what_was_ignored_from_the_start_stays_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let inner = brickcast_command(at);
    let mut command = Command::new("sh");
    command.args(["-c", "trap '' HUP; exec \"$0\" \"$@\""]).arg(inner.get_program());
    command.args(["phantom", "p.nrrd", "--dims", "160,160,160", "--pores", "1"]).current_dir(at);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    while !names(at).iter().any(|name| is_temporary(name)) {
        assert!(child.try_wait().unwrap().is_none(), "ended before it could be hung up on");
        std::thread::sleep(Duration::from_millis(2));
    }
    signal(&child, "HUP");
    let ended = output(child, PATIENCE, "phantom under nohup");
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(at.join("p.nrrd").is_file());
}

#[test]
fn the_part_of_a_killed_writer_goes_with_the_next_write_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut killed = writing(at, at, &["phantom", "big.nrrd", "--dims", "512,512,512", "--pores", "1"]);
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert_eq!(names(at).len(), 1, "{:?}", names(at));
    let living = writing(at, at, &["phantom", "other.nrrd", "--dims", "512,512,512", "--pores", "1"]);
    // What the dead one left goes before the living one begins, or the other way round.
    let started = Instant::now();
    let parts = loop {
        let parts: Vec<_> = names(at).into_iter().filter(|name| is_temporary(name)).collect();
        if matches!(&parts[..], [one] if one.starts_with(".other.nrrd.")) {
            break parts;
        }
        assert!(started.elapsed() < PATIENCE, "{parts:?}");
        std::thread::sleep(Duration::from_millis(2));
    };
    // Those of the living are left alone.
    brickcast_ok(at, &["phantom", "small.nrrd", "--dims", "16,16,16", "--pores", "0"]);
    assert_eq!(names(at).into_iter().filter(|name| is_temporary(name)).collect::<Vec<_>>(), parts);
    signal(&living, "KILL");
    output(living, PATIENCE, "phantom");
}

/// Once its folder has its lock.
fn kill_in_the_middle(mut child: Child, at: &Path) {
    let locked = || names(at).iter().any(|name| is_temporary(name) && at.join(name).join("lock").exists());
    while !locked() {
        assert!(child.try_wait().unwrap().is_none(), "ended before it could be killed");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(names(at).iter().any(|name| is_temporary(name)), "{:?}", names(at));
}

/// A phantom of some hundred megabytes, and a store half made, under names that nobody looked at again.
#[test]
fn what_a_killed_demo_or_prepare_left_goes_with_the_next_run_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let cache = at.join("cache");
    std::fs::create_dir(&cache).unwrap();
    let demo = |dims| ["demo", "--dims", dims, "--size", "32x32", "-o", "d.png", "--backend", "cpu"];
    kill_in_the_middle(writing(at, &cache, &demo("320,320,320")), &cache);
    brickcast_ok(at, &demo("32,32,32"));
    assert!(!names(&cache).iter().any(|name| is_temporary(name)), "{:?}", names(&cache));

    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "320,320,320", "--pores", "2"]);
    kill_in_the_middle(writing(at, at, &["prepare", "part.nrrd", "never-again", "--brick", "16"]), at);
    brickcast_ok(at, &demo("32,32,32"));
    assert!(!names(at).iter().any(|name| is_temporary(name)), "{:?}", names(at));
}

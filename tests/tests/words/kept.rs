//! Sequences that do not come to their end: the frames that were done stay, and it is said how many.

use std::path::Path;
use std::time::Duration;

use brickcast::output::png;
use brickcast_harness::not_tried;
use brickcast_tests::patience::output;
use brickcast_tests::process::{NodeProcess, brickcast, brickcast_command, brickcast_ok};
use serde_json::Value;

use crate::films::with_ffmpeg;
use crate::interrupts::{PATIENCE, begun, is_ignored, is_temporary, names, signal, writing};

fn part(at: &Path) {
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "40,40,40", "--pores", "2"]);
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--brick", "16"]);
}

fn manifest(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The number before ` of OF frames that were done`.
fn told(said: &str, of: &str) -> usize {
    let before = said.split(&format!(" of {of} frames that were done")).next().unwrap();
    let number = before.rsplit(' ').next().unwrap();
    number.parse().unwrap_or_else(|_| panic!("no number of frames: {said}"))
}

/// So long that a plain line tells how far it is; nothing at all with -q but how it ended.
#[test]
fn an_animation_that_a_signal_ends_plays_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let render = ["render", "part", "-o", "a.apng", "--frames", "90000", "--size", "32x32", "--backend", "cpu"];
    for (number, name, quiet) in [(2, "INT", false), (15, "TERM", true)] {
        if is_ignored(number) {
            not_tried(format_args!("SIG{name} is ignored here"));
            continue;
        }
        // The second finds the first's file, which it does not take away.
        let (file, before) = if quiet { ("a.partial.apng", names(at)) } else { ("a.apng", names(at)) };
        let child = writing(at, at, &[&render[..], if quiet { &["-q"] } else { &[] }].concat());
        std::thread::sleep(Duration::from_secs(if quiet { 1 } else { 7 }));
        signal(&child, name);
        let ended = output(child, PATIENCE, &format!("render after SIG{name}"));
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(128 + number as i32), "{said}");
        let frames = told(&said, "90000");
        assert!(said.contains(&format!("ended by SIG{name}; {file} keeps the {frames} of 90000")), "{said}");
        assert!(said.contains("nothing half-written is left"), "{said}");
        let lines = said.lines().filter(|line| line.starts_with("rendering a.apng: ")).count();
        assert_eq!(lines, usize::from(!quiet), "one in five seconds, in seven: {said}");
        assert!(quiet || said.contains(" of 90000 frames, ") && said.contains(" left"), "{said}");
        assert!(!quiet || said.lines().count() == 1, "{said}");

        let picture = png::read(&at.join(file)).unwrap();
        assert!(frames > 1 && picture.frames.len() == frames, "{} of {frames}", picture.frames.len());
        let beside = manifest(&at.join(format!("{file}.json")));
        assert_eq!((&beside["complete"], &beside["frames_asked"]), (&Value::Bool(false), &Value::from(90_000)));
        assert_eq!(beside["frames"].as_array().unwrap().len(), frames);
        assert!(names(at).iter().all(|name| !is_temporary(name)), "{:?}", names(at));
        assert_eq!(names(at).len(), before.len() + 2, "{:?}", names(at));
    }
    // What is kept is a picture as any other: it is drawn again.
    let mut short = manifest(&at.join("a.apng.json"));
    short["frames"].as_array_mut().unwrap().truncate(2);
    std::fs::write(at.join("two.json"), short.to_string()).unwrap();
    brickcast_ok(at, &["render", "--scene", "two.json", "-o", "two.apng", "--backend", "cpu"]);
    let (all, two) = (png::read(&at.join("a.apng")).unwrap(), png::read(&at.join("two.apng")).unwrap());
    assert!(two.frames == all.frames[..2], "frames of a cut animation are the frames");
    let whole = manifest(&at.join("two.apng.json"));
    assert_eq!((&whole["complete"], &whole["frames_asked"]), (&Value::Bool(true), &Value::from(2)));
}

/// How many frames a whole GIF has.
fn frames_of_gif(bytes: &[u8]) -> usize {
    assert!(bytes.starts_with(b"GIF89a"));
    let colors = |flags: u8| if flags & 0x80 == 0 { 0 } else { 3 << ((flags & 7) + 1) };
    let (mut at, mut frames) = (13 + colors(bytes[10]), 0);
    loop {
        match bytes[at] {
            0x3b => break,
            // An extension, and an image with its colours and the size of its codes: then blocks up to an empty one.
            0x21 => at += 2,
            0x2c => (at, frames) = (at + 11 + colors(bytes[at + 9]), frames + 1),
            other => panic!("{other:#x} at {at}"),
        }
        while bytes[at] != 0 {
            at += 1 + usize::from(bytes[at]);
        }
        at += 1;
    }
    assert_eq!(at + 1, bytes.len(), "nothing follows the end");
    frames
}

/// As an .apng: a GIF by its blocks, a film by an encoder that keeps all bytes that it gets and ends with their end.
#[test]
fn gifs_and_films_that_a_signal_ends_keep_what_was_done() {
    if is_ignored(15) {
        not_tried("SIGTERM is ignored here");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let base = ["render", "part", "--frames", "90000", "--size", "32x32", "--backend", "cpu", "-q", "-o"];
    for (name, mut command) in [("a.gif", brickcast_command(at)), ("a.mp4", with_ffmpeg(at, "exec cat"))] {
        command.args(base).arg(name);
        let child = begun(command, at);
        std::thread::sleep(Duration::from_secs(1));
        signal(&child, "TERM");
        let ended = output(child, PATIENCE, name);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(143), "{said}");
        let frames = told(&said, "90000");
        assert!(said.contains(&format!("ended by SIGTERM; {name} keeps the {frames} of 90000")), "{said}");
        let bytes = std::fs::read(at.join(name)).unwrap();
        let has = if name == "a.gif" { frames_of_gif(&bytes) } else { bytes.len() / (32 * 32 * 3) };
        assert!(frames > 1 && has == frames, "{has} of {frames}");
        let beside = manifest(&at.join(format!("{name}.json")));
        assert_eq!((&beside["complete"], &beside["frames_asked"]), (&Value::Bool(false), &Value::from(90_000)));
        assert_eq!(beside["frames"].as_array().unwrap().len(), frames);
        assert!(names(at).iter().all(|name| !is_temporary(name)), "{:?}", names(at));
    }
    // An encoder that does not end in time, or badly, leaves nothing, and that is said.
    let mut command = with_ffmpeg(at, "cat >/dev/null; echo broken disk >&2; exit 1");
    command.args(base).arg("b.mp4");
    let child = begun(command, at);
    std::thread::sleep(Duration::from_secs(1));
    signal(&child, "TERM");
    let ended = output(child, PATIENCE, "b.mp4");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.code() == Some(143) && said.contains("could not be kept: "), "{said}");
    assert!(said.contains("broken disk") && !at.join("b.mp4").exists(), "{said}");
}

#[test]
fn numbered_pictures_stay_and_are_counted_after_a_signal_and_after_a_frame_that_fails() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let render = |out: &'static str, frames: &'static str| {
        ["render", "part", "-o", out, "--frames", frames, "--size", "32x32", "--backend", "cpu"]
    };
    // Nobody can write a picture over a folder.
    std::fs::create_dir(at.join("f_0003.png")).unwrap();
    let output_of = brickcast(at, &render("f.png", "6"));
    let said = String::from_utf8_lossy(&output_of.stderr).into_owned();
    assert_eq!(output_of.status.code(), Some(1), "{said}");
    assert!(said.contains("the 3 of 6 frames that were done stay, from f_0000.png on"), "{said}");
    assert!(at.join("f_0002.png").is_file() && !at.join("f_0004.png").exists());
    if is_ignored(15) {
        not_tried("SIGTERM is ignored here");
        return;
    }
    let child = writing(at, at, &render("s.png", "9000"));
    while !at.join("s_0002.png").exists() {
        std::thread::sleep(Duration::from_millis(2));
    }
    signal(&child, "TERM");
    let ended = output(child, PATIENCE, "render");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(143), "{said}");
    let frames = told(&said, "9000");
    let written = names(at).iter().filter(|name| name.starts_with("s_") && name.ends_with(".png")).count();
    // One may have been given its name, and not been counted yet.
    assert!(frames >= 2 && (frames..=frames + 1).contains(&written), "{written}: {said}");
}

/// The only node dies.
#[test]
fn an_animation_whose_frame_fails_plays_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let mut node = NodeProcess::start(at, &["--backend", "cpu"]);
    let render = ["render", "part", "-o", "a.apng", "--frames", "9000", "--size", "32x32", "--nodes", &node.address];
    let child = writing(at, at, &[&render[..], &["--deadline", "2s"]].concat());
    std::thread::sleep(Duration::from_millis(1500));
    node.kill();
    let ended = output(child, PATIENCE, "render");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(1), "{said}");
    let frames = told(&said, "9000");
    assert!(frames > 1 && png::read(&at.join("a.apng")).unwrap().frames.len() == frames, "{said}");
    assert_eq!(manifest(&at.join("a.apng.json"))["complete"], Value::Bool(false));
}

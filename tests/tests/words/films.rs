//! Animations that other programs play: GIFs, and films by the user's ffmpeg.

use std::path::Path;
use std::process::Command;

use brickcast_harness::ignore;
use brickcast_tests::process::{brickcast, brickcast_command, brickcast_ok, cached_stores};
use serde_json::{Value, json};

const RENDER: [&str; 10] =
    ["render", "part.nrrd", "--size", "47x35", "--backend", "cpu", "--frames", "3", "--fps", "10"];

fn part(at: &Path) {
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "40,36,32", "--pores", "2"]);
}

fn manifest(at: &Path, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap()
}

/// What lies in a folder beside the volume and the cache.
fn made(at: &Path) -> Vec<String> {
    let names = std::fs::read_dir(at).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> =
        names.filter(|name| !name.starts_with("part") && !["cache", "bin"].contains(&name.as_str())).collect();
    names.sort();
    names
}

#[test]
fn a_gif_lies_on_its_background_and_is_drawn_again_but_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    brickcast_ok(at, &[&RENDER[..], &["-o", "a.gif"]].concat());
    let bytes = std::fs::read(at.join("a.gif")).unwrap();
    assert_eq!(bytes[..10], [b"GIF89a".as_slice(), &[47, 0, 35, 0]].concat());
    let told = manifest(at, "a.gif.json");
    assert_eq!(told["frames"].as_array().map(Vec::len), Some(3));
    assert_eq!(told["frames"][2]["background"], json!([1.0, 1.0, 1.0]));
    brickcast_ok(at, &["render", "--scene", "a.gif.json", "-o", "b.gif", "--fps", "10", "--backend", "cpu"]);
    assert_eq!(std::fs::read(at.join("b.gif")).unwrap(), bytes);
    brickcast_ok(at, &[&RENDER[..], &["-o", "c.gif", "--background", "0,0,0"]].concat());
    assert!(std::fs::read(at.join("c.gif")).unwrap() != bytes);
    let output = brickcast(at, &["render", "--scene", "a.gif.json", "--check", "--backend", "cpu"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("a.gif") && said.contains("is not compared"), "{said}");
    let output = brickcast(at, &[&RENDER[..8], &["-o", "d.gif", "--fps", "60"]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("at most 50"), "{said}");
    assert_eq!(made(at), ["a.gif", "a.gif.json", "b.gif", "b.gif.json", "c.gif", "c.gif.json"]);
}

#[test]
fn without_ffmpeg_a_film_is_refused_before_anything_else_happens() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let output = brickcast_command(at).args(RENDER).args(["-o", "a.mp4"]).env("PATH", at).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && said.contains("ffmpeg -framerate"), "{said}");
    assert!(cached_stores(&at.join("cache")).is_empty() && made(at).is_empty());
}

/// `brickcast` with a program by the name of ffmpeg first on the PATH.
#[cfg(unix)]
pub(crate) fn with_ffmpeg(at: &Path, script: &str) -> Command {
    use std::os::unix::fs::PermissionsExt as _;

    let bin = at.join("bin");
    std::fs::create_dir_all(&bin).unwrap();
    std::fs::write(bin.join("ffmpeg"), format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(bin.join("ffmpeg"), std::fs::Permissions::from_mode(0o755)).unwrap();
    let mut command = brickcast_command(at);
    let rest = std::env::var("PATH").unwrap_or_default();
    command.env("PATH", format!("{}:{rest}", bin.display()));
    command
}

#[cfg(unix)]
#[test]
fn frames_go_to_ffmpeg_as_they_are_and_what_it_says_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    brickcast_ok(at, &[&RENDER[..], &["-o", "f.png", "--background", "1,1,1", "--no-manifest"]].concat());
    let output =
        with_ffmpeg(at, "echo \"$@\" > part.said; exec cat").args(RENDER).args(["-o", "a.webm"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = std::fs::read_to_string(at.join("part.said")).unwrap();
    assert!(said.contains("-video_size 48x36 -framerate 10 ") && said.contains("-f webm"), "{said}");
    // Odd sides are one longer: the last column and row twice.
    let film = std::fs::read(at.join("a.webm")).unwrap();
    let mut want: Vec<u8> = Vec::new();
    for frame in ["f_0000.png", "f_0001.png", "f_0002.png"] {
        let picture = brickcast::output::png::read(&at.join(frame)).unwrap();
        let at = |x: usize, y: usize| picture.frames[0][y.min(34) * 47 + x.min(46)];
        (0..36).for_each(|y| (0..48).for_each(|x| want.extend(&at(x, y)[..3])));
    }
    assert!(film == want, "{} bytes of {}", film.len(), want.len());
    assert_eq!(manifest(at, "a.webm.json")["frames"][0]["background"], json!([1.0, 1.0, 1.0]));

    for (script, words) in
        [("echo Unknown encoder >&2; exit 1", "Unknown encoder"), ("cat > part.rest; exit 1", "ended early")]
    {
        let output = with_ffmpeg(at, script).args(RENDER).args(["-o", "b.mp4"]).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && said.contains("ffmpeg") && said.contains(words), "{said}");
    }
    assert_eq!(made(at), ["a.webm", "a.webm.json", "f_0000.png", "f_0001.png", "f_0002.png"]);
}

/// Read back by the same program, and compared with the frames as PNGs.
#[test]
fn films_show_the_frames() {
    if !Command::new("ffmpeg").arg("-version").output().is_ok_and(|output| output.status.success()) {
        ignore("no ffmpeg on the PATH");
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let look = ["--size", "96x64", "--colormap", "viridis"];
    let base = [&["render", "part.nrrd", "--backend", "cpu", "--frames", "5"][..], &look].concat();
    brickcast_ok(at, &[&base[..], &["-o", "f.png", "--background", "1,1,1", "--no-manifest"]].concat());
    for name in ["a.mp4", "a.webm"] {
        brickcast_ok(at, &[&base[..], &["-o", name]].concat());
        let mut decode = Command::new("ffmpeg");
        decode.args(["-loglevel", "error", "-i"]).arg(at.join(name)).args(["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]);
        let output = decode.output().unwrap();
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.stdout.len(), 5 * 96 * 64 * 3, "{name}");
        for (i, got) in output.stdout.chunks_exact(96 * 64 * 3).enumerate() {
            let picture = brickcast::output::png::read(&at.join(format!("f_{i:04}.png"))).unwrap();
            let want = picture.frames[0].iter().flat_map(|p| &p[..3]);
            let apart: u64 = got.iter().zip(want).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
            let mean = apart as f64 / got.len() as f64;
            assert!(mean < 4.0, "{name}, frame {i}: {mean}");
        }
    }
}

//! `brickcast cache`: what lies there, and what goes.

use std::fs;
use std::path::{Path, PathBuf};

use brickcast_tests::process::{brickcast, brickcast_ok, cached_stores};
use serde_json::{Value, json};

/// A folder whose cache holds what `p.nrrd` and `q.nrrd` became.
fn site() -> tempfile::TempDir {
    let site = tempfile::tempdir().unwrap();
    let at = site.path();
    for (name, seed) in [("p.nrrd", "1"), ("q.nrrd", "2")] {
        brickcast_ok(at, &["phantom", name, "--dims", "24,24,24", "--pores", "1", "--seed", seed]);
        let render = ["render", name, "-o", "x.png", "--size", "16x16", "--backend", "cpu", "--no-manifest"];
        brickcast_ok(at, &render);
    }
    site
}

fn listed(at: &Path) -> Value {
    serde_json::from_str(&brickcast_ok(at, &["cache", "list", "--json"])).unwrap()
}

fn entries(at: &Path) -> Vec<Value> {
    listed(at)["entries"].as_array().unwrap().clone()
}

/// Both streams: where talk goes is not this file's business.
fn said(at: &Path, args: &[&str]) -> (Option<i32>, String) {
    let output = brickcast(at, args);
    let text = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned()).concat();
    assert!(!text.contains("panicked"), "{text}");
    (output.status.code(), text)
}

fn store_of(at: &Path, name: &str) -> PathBuf {
    let stores = cached_stores(&at.join("cache"));
    stores.into_iter().find(|path| path.file_name().unwrap().to_str().unwrap().starts_with(name)).unwrap()
}

#[test]
fn what_lies_there_is_listed_with_what_it_was_made_of() {
    let site = site();
    let at = site.path();
    let list = listed(at);
    assert_eq!(list["limit"], json!(50_u64 << 30));
    let entries = list["entries"].as_array().unwrap();
    assert_eq!(entries.len(), 2);
    let total: u64 = entries.iter().map(|entry| entry["bytes"].as_u64().unwrap()).sum();
    assert!(total > 10_000 && list["bytes"] == json!(total), "{list}");
    let input = at.join("p.nrrd").canonicalize().unwrap();
    assert_eq!(entries[0]["input"], json!(input.to_str().unwrap()), "the least used first");
    assert_eq!(entries[0]["in_use"], json!(false));
    let (code, text) = said(at, &["cache", "list", "--cache-size", "7MiB"]);
    assert_eq!(code, Some(0));
    assert!(text.contains("p.nrrd") && text.contains("2 entries") && text.contains("7.0 MiB (--cache-size)"), "{text}");
    // Looking makes no folder.
    let (code, text) = said(at, &["cache", "list", "--cache-dir", "none"]);
    assert!(code == Some(0) && text.contains("nothing lies in the cache") && !at.join("none").exists(), "{text}");
    fs::write(at.join("c.toml"), "cache_dir = 'elsewhere'\n").unwrap();
    let mut command = brickcast_tests::process::brickcast_command(at);
    command.env_remove("BRICKCAST_CACHE_DIR").args(["cache", "list", "--config", "c.toml"]);
    assert!(String::from_utf8_lossy(&command.output().unwrap().stdout).contains("elsewhere"));
}

#[test]
fn what_is_named_or_old_goes_and_nothing_else() {
    let site = site();
    let at = site.path();
    let (code, text) = said(at, &["cache", "clear", "--older-than", "30d"]);
    assert!(code == Some(0) && text.contains("freed 0 B, 0 entries") && entries(at).len() == 2, "{text}");
    let (code, text) = said(at, &["cache", "clear", "r.nrrd"]);
    assert!(code == Some(1) && text.contains("r.nrrd: nothing in the cache") && entries(at).len() == 2, "{text}");
    let (code, text) = said(at, &["cache", "clear", "p.nrrd"]);
    assert!(code == Some(0) && text.contains("removed p-") && text.contains("1 entry"), "{text}");
    assert_eq!(cached_stores(&at.join("cache")), [store_of(at, "q-")]);
    let name = entries(at)[0]["name"].as_str().unwrap().to_owned();
    let key = fs::File::options().write(true).open(at.join(format!("cache/{name}.key"))).unwrap();
    key.set_modified(std::time::SystemTime::now() - std::time::Duration::from_secs(3 * 86_400)).unwrap();
    assert!(said(at, &["cache", "list"]).1.contains("3 days ago"));
    let (code, text) = said(at, &["cache", "clear", &name, "--older-than", "2d"]);
    assert!(code == Some(0) && text.contains("removed q-") && entries(at).is_empty(), "{text}");
    let left: Vec<_> = fs::read_dir(at.join("cache")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["brickcast-cache.lock"]);
}

#[test]
fn what_a_process_uses_stays() {
    let site = site();
    let at = site.path();
    let store = store_of(at, "p-");
    let lock = fs::File::open(store.with_extension("lock")).unwrap();
    lock.lock_shared().unwrap();
    let used = |entry: &Value| entry["in_use"] == json!(true) && entry["name"].as_str().unwrap().starts_with("p-");
    assert_eq!(entries(at).into_iter().filter(used).count(), 1);
    let (code, text) = said(at, &["cache", "clear"]);
    assert!(code == Some(0) && text.contains("removed q-") && text.contains("stays: a process uses it"), "{text}");
    let (code, text) = said(at, &["cache", "clear", "p.nrrd"]);
    assert!(code == Some(1) && text.contains("stays: a process uses it") && store.is_dir(), "{text}");
    drop(lock);
    assert_eq!(said(at, &["cache", "clear"]).0, Some(0));
    assert!(cached_stores(&at.join("cache")).is_empty());
}

#[test]
fn what_earlier_versions_left_goes_and_what_others_put_there_stays() {
    let site = site();
    let at = site.path();
    let (p, q) = (store_of(at, "p-"), store_of(at, "q-"));
    fs::remove_file(p.with_extension("key")).unwrap();
    // A demo's own folder, a store of the user's, and one with a note in it.
    let demo = at.join("cache/demo-0.1.0-8x8x8");
    fs::create_dir(&demo).unwrap();
    brickcast_ok(at, &["prepare", "p.nrrd", demo.join("phantom.brickcast").to_str().unwrap()]);
    fs::write(demo.join("phantom.nrrd"), "volume").unwrap();
    brickcast_ok(at, &["prepare", "p.nrrd", "cache/mine"]);
    fs::write(q.join("notes.txt"), "mine").unwrap();
    let list = brickcast_ok(at, &["cache", "list"]);
    for words in ["its key is missing", "the demo of an earlier version", "q-"] {
        assert!(list.contains(words), "{list}");
    }
    assert!(!list.contains("mine"), "{list}");
    let (code, text) = said(at, &["cache", "clear"]);
    assert!(code == Some(0) && text.contains("2 entries") && text.contains("other files than a store's"), "{text}");
    assert!(!p.exists() && !demo.exists() && at.join("cache/mine/brickcast.json").is_file());
    assert!(q.join("brickcast.json").is_file() && q.join("notes.txt").is_file());
}

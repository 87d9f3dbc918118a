//! Stores at the hands of the command line: what is replaced, what is never removed, what is noticed.

use std::fs;
use std::path::Path;

use brickcast_tests::process::{brickcast, brickcast_ok};
use serde_json::Value;

/// What stderr says of a command that must fail, with its exit code.
fn fails(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = brickcast(folder, args);
    assert!(!output.status.success(), "{args:?} ended well");
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn prepared(at: &Path) {
    brickcast_ok(at, &["phantom", "p.nrrd", "--dims", "48,40,36", "--pores", "3"]);
    brickcast_ok(at, &["prepare", "p.nrrd", "s", "--segmentation-range", "0.05"]);
}

#[test]
fn force_never_removes_its_own_input_or_what_others_put_into_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepared(at);
    fs::rename(at.join("p.nrrd"), at.join("s/p.nrrd")).unwrap();
    fs::write(at.join("s/notes.txt"), "notes").unwrap();
    fs::create_dir(at.join("s/pictures")).unwrap();
    fs::write(at.join("s/pictures/1.png"), "picture").unwrap();
    let (code, error) = fails(at, &["prepare", "s/p.nrrd", "s", "--force"]);
    assert!(code == 1 && error.contains("the input s/p.nrrd lies in s"), "{code} {error}");
    fs::rename(at.join("s/p.nrrd"), at.join("p.nrrd")).unwrap();
    let (code, error) = fails(at, &["prepare", "p.nrrd", "s", "--force"]);
    assert!(
        code == 1 && error.contains("notes.txt, pictures/") && error.contains("move it elsewhere"),
        "{code} {error}"
    );
    assert_eq!(fs::read_to_string(at.join("s/pictures/1.png")).unwrap(), "picture");
    let left: Vec<_> = fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().contains("tmp")), "{left:?}");
    // The label volume is an input, too.
    fs::copy(at.join("p.nrrd"), at.join("s/labels.nrrd")).unwrap();
    let (_, error) = fails(at, &["prepare", "p.nrrd", "s", "--force", "--labels", "s/labels.nrrd"]);
    assert!(error.contains("the input s/labels.nrrd lies in s"), "{error}");
    fs::remove_file(at.join("s/labels.nrrd")).unwrap();
    fs::remove_file(at.join("s/notes.txt")).unwrap();
    fs::remove_dir_all(at.join("s/pictures")).unwrap();
    brickcast_ok(at, &["prepare", "p.nrrd", "s", "--force"]);
    brickcast_ok(at, &["verify", "s"]);
}

/// Noise that does not compress, with the bright half on either side: the indices of both stores' shards are the same
/// bytes.
fn twin(at: &Path, name: &str, bright_first: bool) {
    let mut state = 1u32;
    let mut voxels = Vec::with_capacity(64 * 64 * 64 * 2);
    for i in 0..64 * 64 * 64 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let high = (state >> 16) as u8;
        voxels.push((state >> 24) as u8);
        voxels.push(if (i % 64 < 32) == bright_first { high | 0x80 } else { high & 0x7F });
    }
    let raw = format!("{name}_64x64x64_uint16.raw");
    fs::write(at.join(&raw), voxels).unwrap();
    brickcast_ok(at, &["prepare", &raw, name, "--endian", "little", "--range", "0,65535", "-q"]);
}

#[test]
fn a_shard_of_another_store_is_named_and_not_shown() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    twin(at, "one", true);
    twin(at, "two", false);
    let shard = "0/c/0/0/0";
    let (own, other) = (fs::read(at.join("one").join(shard)).unwrap(), fs::read(at.join("two").join(shard)).unwrap());
    let index = own.len() - 65_540;
    assert!(own[index..] == other[index..] && own != other, "the premise: equal indices");
    fs::write(at.join("one").join(shard), other).unwrap();
    let render = ["render", "one", "-o", "x.png", "--backend", "cpu", "--size", "48x48", "--window", "30000,50000"];
    let (code, error) = fails(at, &render);
    assert_eq!(code, 1, "{error}");
    for words in ["shard 0/c/0/0/0", "another store's", "prepare it again"] {
        assert!(error.contains(words), "{error}");
    }
    assert!(!at.join("x.png").exists());
}

#[test]
fn verify_names_every_part_and_ends_with_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    prepared(at);
    let said = brickcast_ok(at, &["verify", "s"]);
    assert!(said.contains("every byte is as the manifest says"), "{said}");
    let told: Value = serde_json::from_str(&brickcast_ok(at, &["verify", "s", "--json"])).unwrap();
    assert_eq!((told["whole"].as_bool(), told["faults"].as_array().map(Vec::len)), (Some(true), Some(0)));
    let flip = |name: &str| {
        let mut bytes = fs::read(at.join("s").join(name)).unwrap();
        bytes[3] ^= 1;
        fs::write(at.join("s").join(name), bytes).unwrap();
    };
    flip("0/c/0/0/0");
    flip("bricks.bin");
    fs::remove_file(at.join("s/distances/c/0/0/0")).unwrap();
    fs::write(at.join("s/notes.txt"), "mine").unwrap();
    let output = brickcast(at, &["verify", "s"]);
    let (said, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(1));
    for line in
        ["broken   0/c/0/0/0: ", "broken   bricks.bin: ", "missing  distances/c/0/0/0: ", "foreign  notes.txt: "]
    {
        assert_eq!(said.lines().filter(|l| l.starts_with(line)).count(), 1, "{line}\n{said}");
    }
    assert_eq!(said.lines().count(), 4, "{said}");
    assert!(error.contains("2 broken, 1 missing, 1 foreign"), "{error}");
    let output = brickcast(at, &["verify", "s", "--json"]);
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let kinds: Vec<_> = told["faults"].as_array().unwrap().iter().map(|f| f["kind"].as_str().unwrap()).collect();
    assert_eq!((output.status.code(), told["whole"].as_bool(), kinds.len()), (Some(1), Some(false), 4), "{kinds:?}");
    let (code, error) = fails(at, &["verify", "."]);
    assert!(code == 1 && error.contains("is not a brickcast store"), "{error}");
}

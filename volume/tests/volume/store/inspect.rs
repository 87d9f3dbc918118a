//! Inspecting a store names everything that is wrong with it, of every kind of file, and nothing else.

use std::fs;
use std::path::{Path, PathBuf};

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{Fault, FaultKind, Inspected, Progress, StoreError, inspect};

use super::regions::windows;
use super::support::{Volume, at_most, downgrade, files_of, noise};

/// Regions, halos, two shards and a coarser level: a file of every kind.
fn store(dir: &Path) -> PathBuf {
    let path = dir.join("s");
    let halves = Volume::new([270, 9, 40], VoxelType::U16, |p| match p[0] {
        0..100 => 1000.0,
        112.. => 50_000.0,
        _ => f64::from(noise(p)),
    });
    halves.prepare(&path, &at_most(1, windows(32, 0.02))).unwrap();
    path
}

fn inspected(path: &Path) -> Inspected {
    let mut steps = Vec::<Progress>::new();
    let found = inspect(path, &mut |p| steps.push(p)).unwrap();
    assert!(steps.iter().all(|p| p.done <= p.total) && steps.is_sorted_by_key(|p| p.done));
    found
}

fn faults(path: &Path) -> Vec<(FaultKind, String)> {
    inspected(path).faults.into_iter().map(|f| (f.kind, f.file)).collect()
}

fn names(path: &Path) -> Vec<String> {
    let name = |file: PathBuf| file.strip_prefix(path).unwrap().to_str().unwrap().to_owned();
    files_of(path).into_iter().map(name).collect()
}

#[test]
fn a_whole_store_has_no_faults() {
    let dir = tempfile::tempdir().unwrap();
    let path = store(dir.path());
    let found = inspected(&path);
    assert_eq!(found.faults, []);
    let sizes = files_of(&path).iter().map(|f| f.metadata().unwrap().len()).sum::<u64>();
    assert_eq!((found.bytes, found.version, found.binds_chunks), (sizes, Some(10), true));
    downgrade(&path, 5);
    let found = inspected(&path);
    assert_eq!((found.faults, found.version, found.binds_chunks), (vec![], Some(5), false));
}

#[test]
fn a_flipped_bit_a_cut_and_a_lost_file_are_named_in_every_kind_of_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = store(dir.path());
    let all = names(&path);
    assert!(all.len() >= 40, "{all:?}");
    for name in all.iter().filter(|name| *name != "brickcast.json") {
        let file = path.join(name);
        let good = fs::read(&file).unwrap();
        let broken = vec![(FaultKind::Broken, name.clone())];
        for at in [0, good.len() / 2, good.len() - 1] {
            let mut bad = good.clone();
            bad[at] ^= 0x20;
            fs::write(&file, bad).unwrap();
            assert_eq!(faults(&path), broken, "byte {at} of {name}");
        }
        for cut in [&good[..good.len() - 1], &good[..0], &[&good[..], b"+"].concat()] {
            fs::write(&file, cut).unwrap();
            assert_eq!(faults(&path), broken, "{name} cut");
        }
        fs::remove_file(&file).unwrap();
        assert_eq!(faults(&path), [(FaultKind::Missing, name.clone())]);
        fs::write(&file, good).unwrap();
    }
    assert_eq!(faults(&path), []);
}

#[test]
fn every_fault_is_named_not_only_the_first() {
    let dir = tempfile::tempdir().unwrap();
    let path = store(dir.path());
    let edit = |name: &str, change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = fs::read(path.join(name)).unwrap();
        change(&mut bytes);
        fs::write(path.join(name), bytes).unwrap();
    };
    // Two chunks of a shard, two records of halos, and whole files.
    edit("0/c/0/0/1", &|bytes| {
        bytes[0] ^= 1;
        let end = bytes.len() - 4 * 4096 - 16 * 4096 - 4;
        bytes[end - 1] ^= 1;
    });
    edit("halos.bin", &|bytes| {
        bytes[0] ^= 1;
        let end = bytes.len();
        bytes[end - 1] ^= 1;
    });
    fs::remove_file(path.join("labels/regions/0/c/0/0/0")).unwrap();
    fs::write(path.join("distance_shards.bin"), b"").unwrap();
    fs::remove_file(path.join("distances/c/0/0/1")).unwrap();
    edit("1/c/0/0/0", &|bytes| bytes[0] ^= 1);
    fs::remove_file(path.join("levels/1/cells.bin")).unwrap();
    fs::write(path.join("levels/1/brickcast.json"), b"").unwrap();
    fs::create_dir(path.join("levels/2")).unwrap();
    fs::write(path.join("notes.txt"), b"").unwrap();
    fs::create_dir_all(path.join("0/c/0/0/9/mine")).unwrap();
    fs::create_dir(path.join("pictures")).unwrap();
    let mut found = faults(&path);
    found.sort_by(|a, b| a.1.cmp(&b.1));
    let want = [
        (FaultKind::Broken, "0/c/0/0/1"),
        (FaultKind::Broken, "0/c/0/0/1"),
        (FaultKind::Foreign, "0/c/0/0/9/"),
        (FaultKind::Broken, "1/c/0/0/0"),
        (FaultKind::Broken, "distance_shards.bin"),
        (FaultKind::Missing, "distances/c/0/0/1"),
        (FaultKind::Broken, "halos.bin"),
        (FaultKind::Broken, "halos.bin"),
        (FaultKind::Missing, "labels/regions/0/c/0/0/0"),
        (FaultKind::Foreign, "levels/1/brickcast.json"),
        (FaultKind::Missing, "levels/1/cells.bin"),
        (FaultKind::Foreign, "levels/2/"),
        (FaultKind::Foreign, "notes.txt"),
        (FaultKind::Foreign, "pictures/"),
    ];
    assert_eq!(found, want.map(|(kind, name)| (kind, name.to_owned())));
    let words: Vec<Fault> = inspected(&path).faults;
    let of = |name: &str| words.iter().filter(|f| f.file == name).map(|f| f.what.as_str()).collect::<Vec<_>>();
    assert!(of("0/c/0/0/1").iter().all(|what| what.contains("inner chunk") && what.contains("crc32c")));
    assert!(of("halos.bin").iter().all(|what| what.contains("brick") && what.contains("layer")));
}

#[test]
fn shards_in_each_others_place_and_of_another_store_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = store(dir.path());
    let (first, second) = ("labels/regions/0/c/0/0/0", "labels/regions/0/c/0/0/1");
    let (a, b) = (fs::read(path.join(first)).unwrap(), fs::read(path.join(second)).unwrap());
    fs::write(path.join(first), b).unwrap();
    fs::write(path.join(second), a).unwrap();
    assert_eq!(faults(&path), [first, second].map(|name| (FaultKind::Broken, name.to_owned())));
}

#[test]
fn a_broken_manifest_is_one_fault_and_none_is_no_store() {
    let dir = tempfile::tempdir().unwrap();
    let path = store(dir.path());
    fs::write(path.join("mine.txt"), b"").unwrap();
    fs::write(path.join("brickcast.json"), b"{}").unwrap();
    let found = inspected(&path);
    let kinds: Vec<_> = found.faults.iter().map(|f| (f.kind, f.file.as_str())).collect();
    assert_eq!(kinds, [(FaultKind::Broken, "brickcast.json"), (FaultKind::Foreign, "mine.txt")]);
    assert_eq!(found.version, None);
    fs::remove_file(path.join("brickcast.json")).unwrap();
    assert!(matches!(inspect(&path, &mut |_| {}), Err(StoreError::NotAStore { .. })));
}

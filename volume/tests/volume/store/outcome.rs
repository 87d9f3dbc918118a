//! What a prepare leaves behind: the same bytes each time, figures that are right, and nothing at all where it fails.

use std::fs;
use std::path::Path;

use brickcast_volume::format::{VolumeSource as _, VoxelType};
use brickcast_volume::ids::{BrickIndex, StoreHash};
use brickcast_volume::store::{ChunkCache, NotFinite, Phase, PrepareOptions, Store, StoreError, prepare, survey};

use super::support::{Volume, downgrade, files_of, noisy};

fn entries(dir: &Path) -> usize {
    fs::read_dir(dir).unwrap().count()
}

#[test]
fn the_same_input_gives_the_same_bytes_whatever_the_threads_and_the_place() {
    let volume = noisy([140, 70, 70], VoxelType::F32);
    let dir = tempfile::tempdir().unwrap();
    let options = |name: &str| PrepareOptions { source_name: Some(name.to_owned()), ..PrepareOptions::default() };
    let (a, b) = (dir.path().join("a"), dir.path().join("elsewhere"));
    let first = volume.prepare(&a, &options("/scans/part.nrrd")).unwrap();
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let second = one_thread.install(|| volume.prepare(&b, &options("C:\\scans\\part.nrrd"))).unwrap();
    assert_eq!(first.hash, second.hash);
    let (files_a, files_b) = (files_of(&a), files_of(&b));
    assert_eq!(files_a.len(), files_b.len());
    for (x, y) in files_a.iter().zip(&files_b) {
        assert_eq!(x.strip_prefix(&a).unwrap(), y.strip_prefix(&b).unwrap());
        assert!(fs::read(x).unwrap() == fs::read(y).unwrap(), "{x:?}");
    }
    let store = Store::open(&a).unwrap();
    assert_eq!(store.hash(), StoreHash::of(&fs::read(a.join("brickcast.json")).unwrap()));
    assert_eq!(store.manifest().source.name.as_deref(), Some("part.nrrd"));
    let bytes: u64 = files_a.iter().map(|f| fs::metadata(f).unwrap().len()).sum();
    assert_eq!(first.store_bytes, bytes);
    // One voxel more by one step is another store.
    let mut other = noisy([140, 70, 70], VoxelType::F32);
    other.values[5000] += 0.01;
    let hash = other.prepare(&dir.path().join("c"), &options("part.nrrd")).unwrap().hash;
    assert_ne!(hash, first.hash);
}

#[test]
fn statistics_are_those_of_all_voxels() {
    // 1000 voxels: 0 to 999, twice each 500 apart.
    let volume = Volume::new([10, 10, 10], VoxelType::I16, |[x, y, z]| f64::from(x + 10 * y + 100 * z) - 500.0);
    let dir = tempfile::tempdir().unwrap();
    let m = volume.prepare(&dir.path().join("s"), &PrepareOptions::default()).unwrap().manifest;
    assert_eq!((m.min, m.max, m.mean, m.range), (-500.0, 499.0, -0.5, (-500.0, 499.0)));
    // The n-th smallest of 1000 voxels has the cumulative share n / 1000.
    assert_eq!(m.quantiles, [-500.0, -491.0, -451.0, -251.0, -1.0, 249.0, 449.0, 489.0, 498.0]);
    assert_eq!(m.quantile_999, 498.0);
    // The between-class variance of a uniform distribution is largest where it is halved.
    assert_eq!(m.otsu, -1.0);
    assert_eq!(m.histogram.iter().sum::<u64>(), 1000);
    assert!(m.histogram.iter().all(|&n| (3..=5).contains(&n)), "{:?}", m.histogram);
    assert_eq!(m.space_unit.as_deref(), Some("mm"));
    assert_eq!((m.value_of_stored(-7), m.code_of_value(499.0), m.value_of_code(0)), (-7.0, 65535, -500.0));
}

#[test]
fn nan_and_infinite_voxels_are_counted_mapped_and_reported() {
    let special = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    let volume = Volume::new([6, 6, 6], VoxelType::F32, |[x, y, z]| match (x, y, z) {
        (x @ 0..3, 0, 0) => special[x as usize],
        (x, 1, 1) if x < 2 => f64::NAN,
        (x, y, z) => f64::from(x + y + z) / 7.0,
    });
    let dir = tempfile::tempdir().unwrap();
    let summary = volume.prepare(&dir.path().join("s"), &PrepareOptions::default()).unwrap();
    let m = &summary.manifest;
    assert_eq!(m.not_finite, NotFinite { nan: 3, negative_infinity: 1, positive_infinity: 1 });
    assert!(!m.lossless);
    assert_eq!((m.min, m.max), (f64::from(1.0f32 / 7.0), f64::from(15.0f32 / 7.0)));
    let notes = &summary.manifest.notes;
    assert!(notes.iter().any(|n| n.contains("3 voxels hold no data (NaN)")), "{notes:?}");
    assert!(notes.iter().any(|n| n.contains("1 -Inf voxels became the smallest")), "{notes:?}");
    assert!(notes.iter().any(|n| n.contains("two passes")), "{notes:?}");
    let nothing = Volume::new([3, 3, 3], VoxelType::F32, |_| f64::NAN);
    let error = nothing.prepare(&dir.path().join("nan"), &PrepareOptions::default()).unwrap_err().to_string();
    assert!(error.contains("none of the 27 voxels holds data (27 are NaN") && error.contains("--no-data"), "{error}");
    assert!(!dir.path().join("nan").exists());
}

#[test]
fn failures_leave_nothing_and_lose_nothing() {
    let volume = noisy([80, 20, 80], VoxelType::U8);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let force = PrepareOptions { force: true, ..PrepareOptions::default() };
    let short = |good_planes| {
        let mut source = volume.source();
        source.good_planes = good_planes;
        prepare(&mut source, &path, &force, &mut |_| {})
    };
    let error = short(70).unwrap_err();
    assert!(matches!(error, StoreError::SourceLength { plane: 70, got: 1599, want: 1600 }), "{error}");
    assert_eq!(entries(dir.path()), 0, "neither a store nor a working directory");

    let hash = volume.prepare(&path, &PrepareOptions::default()).unwrap().hash;
    assert!(matches!(volume.prepare(&path, &PrepareOptions::default()), Err(StoreError::Exists { .. })));
    assert!(short(3).is_err());
    assert_eq!(Store::open(&path).unwrap().hash(), hash, "the old store outlives a failed replacement");
    let small = noisy([9, 9, 9], VoxelType::U8).prepare(&path, &force).unwrap();
    assert_eq!(Store::open(&path).unwrap().hash(), small.hash);
    assert_eq!(entries(dir.path()), 1);
}

#[test]
fn options_that_do_not_fit_are_refused_before_anything_is_written() {
    let volume = noisy([9, 9, 9], VoxelType::U8);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    for brick_size in [0, 7, 48, 1024, u32::MAX] {
        let options = PrepareOptions { brick_size, ..PrepareOptions::default() };
        assert!(matches!(volume.prepare(&path, &options), Err(StoreError::Grid(_))), "{brick_size}");
    }
    for range in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY), (0.0, 1e-320)] {
        let options = PrepareOptions { range: Some(range), ..PrepareOptions::default() };
        assert!(matches!(volume.prepare(&path, &options), Err(StoreError::Range { .. })), "{range:?}");
    }
    assert_eq!(entries(dir.path()), 0);
}

#[test]
fn progress_runs_through_the_voxels_of_each_pass() {
    let volume = noisy([9, 9, 40], VoxelType::I32);
    let dir = tempfile::tempdir().unwrap();
    let mut seen = Vec::new();
    let options = PrepareOptions::default();
    prepare(&mut volume.source(), &dir.path().join("s"), &options, &mut |p| seen.push(p)).unwrap();
    let count = |phase| seen.iter().filter(|p| p.phase == phase).count();
    // Planes, layers of inner chunks, beginning and end.
    assert_eq!((count(Phase::Scan), count(Phase::Write), count(Phase::Finish)), (40, 3, 2));
    assert_eq!(count(Phase::Levels), 0, "one brick");
    assert!(seen.iter().all(|p| p.done <= p.total && p.total == 9 * 9 * 40));
    assert!(seen.is_sorted_by_key(|p| (p.phase != Phase::Scan, p.phase == Phase::Finish, p.done)));
}

/// What a foreign header says reaches terminals and other machines: harmless, and in the store itself.
#[test]
fn notes_are_kept_in_the_store_and_read_back() {
    let dir = tempfile::tempdir().unwrap();
    let volume = noisy([9, 9, 9], VoxelType::F32);
    let mut source = volume.source();
    source.header.notes = vec!["byte order not said".into(), "foreign \x1b[31m text".into()];
    let path = dir.path().join("s");
    let made = prepare(&mut source, &path, &PrepareOptions::default(), &mut |_| {}).unwrap();
    let notes = Store::open(&path).unwrap().manifest().notes.clone();
    assert_eq!(made.manifest.notes, notes);
    assert_eq!(notes[..2], ["byte order not said", "foreign \\u{1b}[31m text"]);
    assert!(notes[2].contains("mapped from 32 to 16 bits"), "{notes:?}");
    source.rewind().unwrap();
    assert_eq!(survey(&mut source, &mut |_| {}).unwrap().notes, notes);
}

/// Stores that older releases made: 4 has no notes, and neither has checksums at the end of its shards.
#[test]
fn stores_of_versions_4_and_5_are_read_and_others_are_not() {
    for version in [4, 5] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s");
        noisy([270, 9, 9], VoxelType::U8).prepare(&path, &PrepareOptions::default()).unwrap();
        let brick = |store: &Store| store.read_brick(BrickIndex([4, 0, 0]), 4, &ChunkCache::new(1 << 20)).unwrap();
        let before = brick(&Store::open(&path).unwrap());
        downgrade(&path, version);
        let store = Store::open(&path).unwrap();
        assert_eq!((store.manifest().version, store.manifest().notes.len()), (version, 0));
        assert_eq!(store.manifest().to_bytes().unwrap(), store.manifest_bytes(), "the version is kept");
        store.verify(&mut |_| {}).unwrap();
        assert_eq!(brick(&store), before);
        let text = std::fs::read_to_string(path.join("brickcast.json")).unwrap();
        for other in ["3", "11"] {
            let changed = text.replacen(&format!("\"version\": {version}"), &format!("\"version\": {other}"), 1);
            std::fs::write(path.join("brickcast.json"), changed).unwrap();
            assert!(Store::open(&path).unwrap_err().to_string().contains(&format!("version {other}")));
        }
    }
}

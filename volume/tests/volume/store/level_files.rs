//! The files of levels: what older stores lack, what is refused, what is named, what is removed.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{
    ContentHash, FaultKind, Manifest, MemoryObjects, PrepareOptions, Store, StoreError, inspect, remove_store,
};

use super::levels::{bricks, prepared};
use super::regions::windows;
use super::support::{Volume, at_most, codes_of, downgrade, files_of, in_memory, levels_of, noisy};

/// A store without levels says nothing of them, and is a store of version 8 but for the number.
#[test]
fn older_stores_are_one_level() {
    for version in [4, 6, 8] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s");
        let volume = noisy([70, 20, 40], VoxelType::U8);
        let before = prepared(&volume, dir.path(), &bricks(16), &[]);
        let codes = codes_of(&before);
        downgrade(&path, version);
        let store = Store::open(&path).unwrap();
        assert_eq!((store.manifest().version, store.level_count(), store.manifest().levels.len()), (version, 1, 0));
        assert!(codes_of(&store) == codes);
        assert_eq!(inspect(&path, &mut |_| {}).unwrap().faults, []);
        // No older version has levels.
        let mut manifest = store.manifest().clone();
        manifest.levels.clone_from(&before.manifest().levels);
        let error = Manifest::from_bytes(&manifest.to_bytes().unwrap()).unwrap_err().to_string();
        assert!(error.contains("`level, levels`") && error.contains(&format!("version {version} has not")), "{error}");
    }
    let dir = tempfile::tempdir().unwrap();
    let store = prepared(&noisy([70, 20, 40], VoxelType::U8), dir.path(), &at_most(0, bricks(16)), &[]);
    assert!(!String::from_utf8_lossy(store.manifest_bytes()).contains("level"));
}

/// They have levels that say what their voxels are, but not cell by cell.
#[test]
fn stores_of_version_9_have_no_means() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let before = prepared(&noisy([70, 20, 40], VoxelType::U8), dir.path(), &at_most(2, bricks(16)), &[]);
    assert!(levels_of(&before).all(|level| level.mean_ranges().is_some()));
    downgrade(&path, 9);
    let store = Store::open(&path).unwrap();
    assert_eq!((store.manifest().version, store.level_count()), (9, 3));
    for (level, was) in levels_of(&store).zip(levels_of(&before)) {
        assert!(level.mean_ranges().is_none() && level.cell_ranges() == was.cell_ranges());
    }
    assert_eq!(inspect(&path, &mut |_| {}).unwrap().faults, []);
    // Neither without what its version has, nor with what it has not.
    for (version, words) in
        [(10, "means.bin is missing, which version 10 has"), (9, "means.bin, which version 9 has not")]
    {
        let mut manifest = store.manifest().clone();
        manifest.version = version;
        manifest.files.means = (version == 9).then_some(manifest.files.ranges);
        let error = Manifest::from_bytes(&manifest.to_bytes().unwrap()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

/// A store of three levels with regions, in memory.
fn good(dir: &Path) -> MemoryObjects {
    let halves = Volume::new([70, 20, 40], VoxelType::U16, |[x, _, _]| if x < 30 { 100.0 } else { 50_000.0 });
    halves.prepare(&dir.join("s"), &at_most(2, windows(16, 0.1))).unwrap();
    in_memory(&dir.join("s"))
}

fn opened(objects: &MemoryObjects) -> Result<Store, StoreError> {
    Store::open_objects(Arc::new(objects.clone()))
}

/// The manifest of level 1, changed, with the hash that its store promises: a hash says who wrote it, not that it makes
/// sense.
fn with_level(good: &MemoryObjects, change: impl Fn(&mut Manifest, &mut String)) -> Result<Store, StoreError> {
    let store = opened(good).unwrap();
    let (mut whole, mut level) = (store.manifest().clone(), store.level(1).unwrap().manifest().clone());
    let mut text = String::new();
    change(&mut level, &mut text);
    let bytes = if text.is_empty() { level.to_bytes().unwrap() } else { text.into_bytes() };
    whole.levels[0].hash = ContentHash::of(&bytes);
    let mut objects = good.clone();
    objects.put("levels/1/level.json", bytes);
    objects.put("brickcast.json", whole.to_bytes().unwrap());
    opened(&objects)
}

#[test]
fn a_manifest_of_a_level_that_lies_is_refused_by_file_and_field() {
    let dir = tempfile::tempdir().unwrap();
    let good = good(dir.path());
    with_level(&good, |_, _| {}).unwrap();
    let store = opened(&good).unwrap();
    let (whole, second) = (store.manifest().clone(), store.level(2).unwrap().manifest().clone());
    type Lie<'a> = (&'a str, &'a dyn Fn(&mut Manifest));
    let lies: [Lie<'_>; 9] = [
        ("`level`", &|m| m.level = 2),
        ("`dims, spacing, origin, directions`", &|m| m.geometry = whole.geometry.at_level(2).unwrap()),
        ("`range`", &|m| m.data_range.1 += 1.0),
        ("`scale, offset`", &|m| m.offset = 1.0),
        ("`min, max, mean, otsu, quantiles, noise`", &|m| m.otsu -= 1.0),
        ("`source`", &|m| m.source.name = Some("other".into())),
        ("`files`", &|m| m.files.group = ContentHash(1)),
        ("`version, writer`", &|m| m.writer = "other".into()),
        ("`levels`: a level, 1, has no levels", &|m| m.levels.clone_from(&whole.levels)),
    ];
    for (says, lie) in lies {
        let error = with_level(&good, |m, _| {
            lie(m);
            // The counts must fit the dims, else they are refused before.
            if m.geometry != whole.geometry.at_level(1).unwrap() {
                (m.histogram, m.grid) = (second.histogram.clone(), second.grid);
                m.regions.clone_from(&second.regions);
            }
        });
        let error = error.unwrap_err().to_string();
        for word in ["level 1: levels/1/level.json: ", says, "prepare the store again"] {
            assert!(error.contains(word), "{says}: {error}");
        }
    }
    // The manifest of a store, and what is none.
    let error = with_level(&good, |_, text| *text = String::from_utf8(whole.to_bytes().unwrap()).unwrap()).unwrap_err();
    assert!(error.to_string().contains("level 1: levels/1/level.json: `level`"), "{error}");
    assert!(
        with_level(&good, |_, text| *text = "{".into()).unwrap_err().to_string().contains("levels/1/level.json: EOF")
    );
}

#[test]
fn a_store_that_lies_of_its_levels_is_refused_by_field() {
    let dir = tempfile::tempdir().unwrap();
    let good = good(dir.path());
    let whole = opened(&good).unwrap().manifest().clone();
    let refused = |change: &dyn Fn(&mut Manifest)| {
        let mut m = whole.clone();
        change(&mut m);
        Manifest::from_bytes(&m.to_bytes().unwrap()).unwrap_err().to_string()
    };
    let more = refused(&|m| m.levels.extend(vec![m.levels[0]; 2]));
    assert!(more.contains("4 levels, at most 3 until the volume is one brick"), "{more}");
    let other = refused(&|m| m.levels[1].dims.x += 1);
    assert!(other.contains("[19, 5, 10] voxels where one of [18, 5, 10] is due"), "{other}");
    let swapped = refused(&|m| m.levels.swap(0, 1));
    assert!(swapped.contains("[18, 5, 10] voxels where one of [35, 10, 20]"), "{swapped}");
    let of_level = refused(&|m| (m.level, m.levels) = (1, Vec::new()));
    assert!(of_level.contains("this is level 1 of a store; open the store itself"), "{of_level}");
    let far = refused(&|m| (m.level, m.levels) = (200, Vec::new()));
    assert!(far.contains("200: must be from 1 to 17"), "{far}");
    // Another level's manifest in the place of one.
    let mut swapped = good.clone();
    let second = swapped.remove("levels/2/level.json").unwrap();
    swapped.put("levels/1/level.json", second);
    let error = opened(&swapped).unwrap_err().to_string();
    assert!(error.contains("level 1: levels/1/level.json: hash"), "{error}");
}

#[test]
fn broken_files_of_a_level_are_named_with_it() {
    let dir = tempfile::tempdir().unwrap();
    let good = good(dir.path());
    let keys: Vec<String> = good.iter().map(|(key, _)| key.to_owned()).collect();
    let level_2 = |key: &&String| ["2/", "levels/2/", "labels/regions/2/"].iter().any(|start| key.starts_with(start));
    let of_level: Vec<_> = keys.iter().filter(level_2).collect();
    assert_eq!(of_level.len(), 19, "{of_level:?}");
    for key in of_level {
        let mut bad = good.clone();
        let content = bad.remove(key).unwrap();
        // Large files are told of where they are read, and before.
        let is_large = key.contains("/c/") || key.ends_with("halos.bin");
        let told = |bad: &MemoryObjects| match opened(bad) {
            Ok(store) if is_large => {
                let (level, error) = store.lacking().unwrap();
                assert_eq!(level, 2);
                error.to_string()
            }
            Ok(_) => panic!("{key}: nothing is found"),
            Err(error) => {
                let error = error.to_string();
                assert!(error.starts_with("level 2: ") && !is_large, "{error}");
                error
            }
        };
        assert!(told(&bad).contains(key.as_str()), "{key} missing");
        bad.put(key, content.slice(1..));
        assert!(told(&bad).contains(key.as_str()), "{key} cut");
    }
    // A shard's content is read later.
    let path = dir.path().join("s");
    for shard in ["2/c/0/0/0", "labels/regions/2/c/0/0/0", "levels/2/distances/c/0/0/0"] {
        let content = fs::read(path.join(shard)).unwrap();
        let mut bad = content.clone();
        bad[3] ^= 8;
        fs::write(path.join(shard), bad).unwrap();
        let error = Store::open(&path).unwrap().verify(&mut |_| {}).unwrap_err().to_string();
        assert!(error.contains(&format!("shard {shard} (")) && error.contains("inner chunk"), "{error}");
        let faults = inspect(&path, &mut |_| {}).unwrap().faults;
        assert_eq!(faults.iter().map(|f| (f.kind, f.file.as_str())).collect::<Vec<_>>(), [(FaultKind::Broken, shard)]);
        fs::write(path.join(shard), content).unwrap();
    }
    assert_eq!(inspect(&path, &mut |_| {}).unwrap().faults, []);
}

/// What a store with more levels had goes with it, and nothing is taken for the store's that it has not.
#[test]
fn stores_with_levels_are_replaced_and_removed_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let volume = noisy([70, 20, 40], VoxelType::U16);
    let force = |levels| PrepareOptions { force: true, ..at_most(levels, windows(16, 0.1)) };
    for levels in [3, 0, 2] {
        volume.prepare(&path, &force(levels)).unwrap();
        assert_eq!(Store::open(&path).unwrap().level_count(), levels + 1);
        let found = inspect(&path, &mut |_| {}).unwrap();
        let sizes = files_of(&path).iter().map(|f| f.metadata().unwrap().len()).sum::<u64>();
        assert_eq!((found.faults, found.bytes), (vec![], sizes));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "no working directory");
    }
    // A level that this store has not is somebody else's.
    fs::create_dir(path.join("3")).unwrap();
    assert!(matches!(volume.prepare(&path, &force(2)), Err(StoreError::Foreign { what, .. }) if what == "3/"));
    assert!(matches!(remove_store(&path), Err(StoreError::Foreign { what, .. }) if what == "3/"));
    fs::remove_dir(path.join("3")).unwrap();
    remove_store(&path).unwrap();
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}

//! Stores that were changed, cut or mixed up: found, named, never a panic.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{
    ChunkCache, ChunkFault, IndexFault, Levels, MemoryObjects, PrepareOptions, ShardIndex, Store, StoreError,
};

use super::regions::windows;
use super::support::{INDEX_BYTES, SUM_BYTES, Volume, at_most, downgrade, in_memory, lacking, levels_of, noisy};

/// A store of two levels, the finer of two shards, the first with absent inner chunks.
fn store_in(dir: &Path) -> PathBuf {
    let path = dir.join("s");
    let options = PrepareOptions { brick_size: 32, levels: Levels::AtMost(1), ..PrepareOptions::default() };
    noisy([270, 9, 40], VoxelType::U8).prepare(&path, &options).unwrap();
    path
}

/// A store with regions: two halves with noise between them, in two shards.
fn store_with_regions(dir: &Path) -> PathBuf {
    let path = dir.join("r");
    let halves = Volume::new([270, 9, 40], VoxelType::U16, |p| match p[0] {
        0..100 => 1000.0,
        112.. => 50_000.0,
        _ => f64::from(super::support::noise(p)),
    });
    halves.prepare(&path, &at_most(1, windows(32, 0.02))).unwrap();
    path
}

/// Opens the store and reads all of it.
fn read_all(path: &Path) -> Result<(), StoreError> {
    levels_of(&Store::open(path)?).try_for_each(read_bricks)
}

/// Reads all of a level as bricks: once from their neighbours, and once from their halos.
fn read_bricks(store: &Store) -> Result<(), StoreError> {
    let cache = ChunkCache::new(1 << 20);
    store.manifest().grid.bricks().try_for_each(|b| {
        // 6 layers are more than halos hold; 3 of voxels, and 5 of labels and distances, are all that they do.
        for (ghost, margin) in [(6, 6), (3, 5)] {
            store.read_brick(b, ghost, &cache)?;
            if store.region_table().is_some() {
                store.read_brick_regions(b, margin, &cache)?;
            }
        }
        Ok(())
    })
}

#[test]
fn a_flipped_bit_anywhere_is_found() {
    let dir = tempfile::tempdir().unwrap();
    for path in [store_in(dir.path()), store_with_regions(dir.path())] {
        read_all(&path).unwrap();
        flip_bits(&in_memory(&path));
    }
}

fn flip_bits(good: &MemoryObjects) {
    let open = |objects: &MemoryObjects| Store::open_objects(Arc::new(objects.clone()));
    let read = |store: Store| levels_of(&store).try_for_each(read_bricks);
    read(open(good).unwrap()).unwrap();
    for (key, content) in good.iter() {
        let array = key.split_once("/c/").map(|(array, _)| array);
        let (is_shard, length) = (array.is_some(), content.len());
        // Every part of the file, at odd places.
        let step = [1, 7, 211][usize::from(length > 100) + usize::from(length > 4000)];
        for at in (0..length).step_by(step) {
            let mut bytes = content.to_vec();
            bytes[at] ^= 1 << (at % 8);
            let mut bad = good.clone();
            bad.put(key, bytes.clone());
            let opened = open(&bad);
            if key == "brickcast.json" {
                // The hash by which the store is known changes, so it is at most another store.
                assert!(opened.is_err() || opened.unwrap().manifest_bytes() == bytes);
                continue;
            }
            let Err(error) = opened.and_then(read) else { panic!("{key} byte {at}: not found") };
            match error {
                StoreError::Chunk { array: a, start, end, fault: ChunkFault::Crc { .. }, .. } => {
                    assert_eq!(Some(a.to_string().as_str()), array);
                    assert!(is_shard && (start..end).contains(&(at as u64)), "{key} byte {at}");
                }
                StoreError::ShardIndex { .. } => {
                    assert!(is_shard && at >= length - INDEX_BYTES - SUM_BYTES, "{key} byte {at}")
                }
                _ => assert!(!is_shard, "{key} byte {at}: {error}"),
            }
        }
    }
}

#[test]
fn damaged_regions_are_named_by_array_and_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = store_with_regions(dir.path());
    for (shard, array) in [("labels/regions/0/c/0/0/1", "labels/regions/0"), ("distances/c/0/0/1", "distances")] {
        let good = fs::read(path.join(shard)).unwrap();
        let mut bad = good.clone();
        bad[10] ^= 4;
        fs::write(path.join(shard), &bad).unwrap();
        let text = read_all(&path).unwrap_err().to_string();
        for part in [&format!("shard {array}/c/0/0/1"), "inner chunk", "crc32c", "prepare it again"] {
            assert!(text.contains(part), "{text}");
        }
        assert_eq!(Store::open(&path).unwrap().verify(&mut |_| {}).unwrap_err().to_string(), text);
        fs::write(path.join(shard), &good[1..]).unwrap();
        assert!(lacking(&path).contains(shard) && read_all(&path).unwrap_err().to_string() == lacking(&path));
        fs::remove_file(path.join(shard)).unwrap();
        assert!(lacking(&path).contains("is missing") && lacking(&path).contains(shard));
        assert!(matches!(read_all(&path), Err(StoreError::ShardMissing { .. })));
        fs::write(path.join(shard), good).unwrap();
    }
    let small = [
        "labels/zarr.json",
        "labels/regions/zarr.json",
        "labels/regions/0/zarr.json",
        "distances/zarr.json",
        "regions.bin",
        "region_bricks.bin",
        "label_shards.bin",
        "distance_shards.bin",
        "region_halo_index.bin",
    ];
    for name in small {
        let good = fs::read(path.join(name)).unwrap();
        for bad in [&good[1..], &[&good[..], &[0]].concat()] {
            fs::write(path.join(name), bad).unwrap();
            assert!(Store::open(&path).unwrap_err().to_string().contains(name), "{name}");
        }
        fs::remove_file(path.join(name)).unwrap();
        assert!(Store::open(&path).unwrap_err().to_string().contains(name));
        fs::write(path.join(name), good).unwrap();
    }
    read_all(&path).unwrap();
}

#[test]
fn the_error_names_shard_chunk_and_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let path = store_in(dir.path());
    let shard = path.join("0/c/0/0/1");
    let mut bytes = fs::read(&shard).unwrap();
    bytes[10] ^= 4;
    fs::write(&shard, bytes).unwrap();
    let text = read_all(&path).unwrap_err().to_string();
    for part in ["shard 0/c/0/0/1", "inner chunk (16, 0, 0)", "bytes 0..", "crc32c", "prepare it again"] {
        assert!(text.contains(part), "{text}");
    }
    let verify = Store::open(&path).unwrap().verify(&mut |_| {}).unwrap_err().to_string();
    assert_eq!(verify, text);
}

#[test]
fn cut_grown_missing_and_forged_shards_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = store_in(dir.path());
    let second = path.join("0/c/0/0/1");
    let good = fs::read(&second).unwrap();
    let index = ShardIndex([1, 0, 0]);
    for length in [0, 1, INDEX_BYTES - 1, INDEX_BYTES + SUM_BYTES - 1, good.len() - 1] {
        fs::write(&second, &good[..length]).unwrap();
        let store = Store::open(&path).unwrap();
        let (level, error) = store.lacking().unwrap();
        assert_eq!(level, 0);
        let (want, got) = (good.len() as u64, length as u64);
        assert!(
            matches!(&error, StoreError::ShardLength { shard, got: g, want: w, .. }
            if *shard == index && (*g, *w) == (got, want)),
            "{error}"
        );
        assert_eq!(read_all(&path).unwrap_err().to_string(), error.to_string());
    }
    let told = || {
        let error = read_all(&path).unwrap_err();
        assert_eq!(lacking(&path), error.to_string());
        error
    };
    fs::write(&second, [&good[..], &[0]].concat()).unwrap();
    assert!(matches!(told(), StoreError::ShardLength { .. }));
    fs::remove_file(&second).unwrap();
    assert!(matches!(told(), StoreError::ShardMissing { shard, .. } if shard == index));
    fs::create_dir(&second).unwrap();
    assert!(matches!(told(), StoreError::ShardMissing { .. }));
    fs::remove_dir(&second).unwrap();

    // An index whose own checksum is right, but that leads to other chunks.
    let mut forged = good.clone();
    let start = forged.len() - INDEX_BYTES;
    forged[start..].rotate_left(16);
    let end = forged.len();
    let crc = crc32c::crc32c(&forged[start..end - 4]).to_le_bytes();
    forged[end - 4..].copy_from_slice(&crc);
    fs::write(&second, &forged).unwrap();
    let error = read_all(&path).unwrap_err();
    assert!(
        matches!(&error, StoreError::ShardIndex { shard, fault: IndexFault::Hash { .. }, .. } if *shard == index),
        "{error}"
    );
}

/// Two volumes of noise that does not compress: all chunks of one length, so that the shards' indices are the same
/// bytes.
fn twins(dir: &Path) -> [PathBuf; 2] {
    [0, 0x5A].map(|flip| {
        let path = dir.join(format!("twin{flip}"));
        let noise = Volume::new([48, 48, 48], VoxelType::U8, |p| {
            f64::from(super::support::noise(p.map(|v| v + 50)) >> 8 ^ flip)
        });
        noise.prepare(&path, &PrepareOptions { brick_size: 32, ..PrepareOptions::default() }).unwrap();
        path
    })
}

const ONLY: &str = "0/c/0/0/0";

#[test]
fn a_shard_of_another_store_with_the_same_index_is_named_at_the_first_read() {
    let dir = tempfile::tempdir().unwrap();
    let [own, other] = twins(dir.path());
    let (good, swapped) = (fs::read(own.join(ONLY)).unwrap(), fs::read(other.join(ONLY)).unwrap());
    let index = good.len() - INDEX_BYTES;
    assert!(good[index..] == swapped[index..] && good != swapped, "the premise: equal indices");
    fs::write(own.join(ONLY), &swapped).unwrap();
    let error = read_all(&own).unwrap_err();
    assert!(matches!(error, StoreError::ShardIndex { fault: IndexFault::Hash { .. }, .. }), "{error}");
    for word in ["shard 0/c/0/0/0", "another store's", "prepare it again"] {
        assert!(error.to_string().contains(word), "{error}");
    }
    // The chunks alone, with the own end behind them: each of them is whole.
    let sums = index - SUM_BYTES;
    fs::write(own.join(ONLY), [&swapped[..sums], &good[sums..]].concat()).unwrap();
    let error = read_all(&own).unwrap_err();
    assert!(matches!(error, StoreError::Chunk { fault: ChunkFault::Foreign { .. }, .. }), "{error}");
    assert!(error.to_string().contains("it is another store's"), "{error}");
    fs::write(own.join(ONLY), good).unwrap();
    read_all(&own).unwrap();
}

/// What docs/reference/store-format.md says of versions before 6.
#[test]
fn in_stores_before_version_6_only_verify_finds_a_swapped_shard() {
    let dir = tempfile::tempdir().unwrap();
    let [own, other] = twins(dir.path());
    downgrade(&own, 5);
    downgrade(&other, 5);
    read_all(&own).unwrap();
    fs::copy(other.join(ONLY), own.join(ONLY)).unwrap();
    read_all(&own).unwrap();
    let error = Store::open(&own).unwrap().verify(&mut |_| {}).unwrap_err();
    assert!(matches!(error, StoreError::FileHash { .. }), "{error}");
}

#[test]
fn a_shard_that_vanishes_after_opening_is_an_error_not_a_panic() {
    let dir = tempfile::tempdir().unwrap();
    let path = store_in(dir.path());
    let store = Store::open(&path).unwrap();
    fs::write(path.join("0/c/0/0/1"), b"cut").unwrap();
    let cache = ChunkCache::new(1 << 20);
    let brick = store.manifest().grid.bricks().nth(8).unwrap();
    assert!(matches!(store.read_brick(brick, 0, &cache), Err(StoreError::ShardLength { .. })));
}

#[test]
fn what_is_no_finished_store_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    assert!(matches!(Store::open(&dir.path().join("absent")), Err(StoreError::NotAStore { .. })));
    assert!(matches!(Store::open(dir.path()), Err(StoreError::NotAStore { .. })));
    let file = dir.path().join("file");
    fs::write(&file, b"").unwrap();
    assert!(matches!(Store::open(&file), Err(StoreError::NotAStore { .. })));
    let path = store_in(dir.path());
    let manifest = fs::read_to_string(path.join("brickcast.json")).unwrap();
    let changed = [
        ("\"version\": 10", "\"version\": 3", "this brickcast knows 10"),
        ("\"version\": 10", "\"version\": 3", "prepare the store again"),
        ("brickcast-store", "someone-elses", "is not a brickcast store's"),
        ("\"brick_size\": 32", "\"brick_size\": 33", "power of two"),
        ("\"uint8\"", "\"uint9\"", "uint9"),
        ("\"lossless\": true", "\"lossless\": true, \"extra\": 1", "extra"),
    ];
    for (from, to, says) in changed {
        assert!(manifest.contains(from));
        fs::write(path.join("brickcast.json"), manifest.replace(from, to)).unwrap();
        let text = Store::open(&path).unwrap_err().to_string();
        assert!(text.contains(says), "{text}");
    }
    fs::write(path.join("brickcast.json"), &manifest).unwrap();
    for name in ["zarr.json", "0/zarr.json", "bricks.bin", "cells.bin", "means.bin", "shards.bin", "halo_index.bin"] {
        let good = fs::read(path.join(name)).unwrap();
        fs::remove_file(path.join(name)).unwrap();
        let text = Store::open(&path).unwrap_err().to_string();
        assert!(text.contains(name), "{text}");
        fs::write(path.join(name), &good[1..]).unwrap();
        let text = Store::open(&path).unwrap_err().to_string();
        assert!(text.contains(name), "{text}");
        fs::write(path.join(name), good).unwrap();
    }
    read_all(&path).unwrap();
}

#[test]
fn reads_outside_the_grid_and_beyond_the_ghost_limit_are_errors() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(&store_in(dir.path())).unwrap();
    let cache = ChunkCache::new(1 << 20);
    let inside = store.manifest().grid.bricks().next().unwrap();
    for brick in [[9, 0, 0], [0, 1, 0], [0, 0, 2], [u32::MAX; 3]] {
        let brick = brickcast_volume::ids::BrickIndex(brick);
        assert!(matches!(store.read_brick(brick, 1, &cache), Err(StoreError::BrickOutside { .. })));
        assert_eq!(store.value_range(brick), None);
    }
    assert!(matches!(store.read_brick(inside, u32::MAX, &cache), Err(StoreError::Ghost { .. })));
    assert!(store.read_brick(inside, 64, &cache).is_ok());
}

//! Planes prepared in tiles: the same store, whatever their size and however the input can be read.

use std::path::Path;

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{Phase, PrepareOptions, Progress, Store, prepare};

use super::regions::windows;
use super::support::{Volume, files_of, noisy};

/// Prepares in tiles of single shards, or of bricks where these are larger.
fn prepared(volume: &Volume, out: &Path, seekable: bool, options: &PrepareOptions) -> Vec<Progress> {
    let (mut source, mut seen) = (volume.source(), Vec::new());
    source.seekable = seekable;
    prepare(&mut source, out, options, &mut |p| seen.push(p)).unwrap();
    seen
}

/// Every file, with its content.
fn content(store: &Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let relative = |file: &Path| file.strip_prefix(store).unwrap().to_path_buf();
    files_of(store).into_iter().map(|file| (relative(&file), std::fs::read(&file).unwrap())).collect()
}

fn check(volume: &Volume, options: &PrepareOptions) {
    let dir = tempfile::tempdir().unwrap();
    let what = format!("{:?} {} {options:?}", volume.dims, volume.voxel_type);
    let whole = dir.path().join("whole");
    prepared(volume, &whole, false, options);
    let whole = content(&whole);
    for (name, seekable) in [("anywhere", true), ("in order", false)] {
        let tiled = dir.path().join(name);
        let seen = prepared(volume, &tiled, seekable, &PrepareOptions { tile_voxels: 1, ..options.clone() });
        let unpacked = seen.iter().any(|p| p.phase == Phase::Unpack);
        assert_eq!(unpacked, !seekable, "{what}");
        let tiled_content = content(&tiled);
        assert_eq!(tiled_content.len(), whole.len(), "{what}");
        for (got, want) in tiled_content.iter().zip(&whole) {
            assert!(got == want, "{what}, read {name}: {} differs from {}", got.0.display(), want.0.display());
        }
        Store::open(&tiled).unwrap().verify(&mut |_| {}).unwrap();
    }
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 3, "no scratch files: {left:?}");
}

fn bricks(brick_size: u32) -> PrepareOptions {
    PrepareOptions { brick_size, ..PrepareOptions::default() }
}

/// Halos reach over the borders of tiles, on all sides and at corners; ranges do, too.
#[test]
fn tiles_of_single_shards_make_the_store_that_whole_planes_make() {
    let volume = noisy([530, 300, 35], VoxelType::I16);
    for brick_size in [16, 64] {
        check(&volume, &bricks(brick_size));
    }
    check(&noisy([257, 513, 19], VoxelType::U8), &bricks(32));
}

#[test]
fn tiles_hold_bricks_larger_than_shards_and_smaller_than_chunks() {
    check(&noisy([530, 300, 20], VoxelType::U16), &bricks(512));
    check(&noisy([300, 270, 20], VoxelType::I8), &bricks(8));
}

/// The bounds of 32-bit voxels are found in a pass of its own.
#[test]
fn tiles_of_mapped_voxels_are_those_of_whole_planes() {
    check(&noisy([260, 300, 18], VoxelType::F32), &bricks(64));
}

/// A voxel of levels 9 and 10 is of two tiles or more.
#[test]
fn the_coarsest_levels_are_those_of_whole_planes() {
    check(&noisy([4200, 300, 3], VoxelType::U8), &bricks(8));
}

/// A shard that ends beyond another in z.
#[test]
fn tiles_reach_through_all_shards_of_a_column() {
    check(&noisy([270, 30, 270], VoxelType::U8), &bricks(128));
}

#[test]
fn regions_of_tiled_voxels_are_the_same() {
    let volume =
        Volume::new(
            [270, 300, 40],
            VoxelType::U16,
            |[x, y, z]| if (x / 70 + y / 90 + z / 20) % 2 == 0 { 500.0 } else { 60_000.0 },
        );
    check(&volume, &windows(64, 0.03));
}

#[test]
fn progress_counts_voxels_and_moves_within_planes() {
    let volume = noisy([600, 300, 3], VoxelType::I32);
    let dir = tempfile::tempdir().unwrap();
    let total: u64 = volume.dims.iter().map(|n| u64::from(*n)).product();
    let seen = prepared(&volume, &dir.path().join("s"), true, &PrepareOptions { tile_voxels: 1, ..bricks(64) });
    for phase in [Phase::Scan, Phase::Write] {
        let done: Vec<u64> = seen.iter().filter(|p| p.phase == phase).map(|p| p.done).collect();
        assert!(done.len() >= 3 && done.is_sorted() && *done.last().unwrap() <= total, "{phase:?}: {done:?}");
    }
    // Three by two tiles of a volume of three planes.
    assert_eq!(seen.iter().filter(|p| p.phase == Phase::Write).count(), 6);
    let finest = |p: &&Progress| p.phase != Phase::Levels;
    assert!(seen.iter().all(|p| p.done <= p.total) && seen.iter().filter(finest).all(|p| p.total == total));
}

//! Regions that are not components of windows: label volumes taken as they are, and the paper's flood fill.

use std::fs;
use std::path::Path;

use brickcast_volume::format::{Opener, RawHints, VoxelType};
use brickcast_volume::regions::{density_of_code, window_width};
use brickcast_volume::store::{
    ChunkCache, PrepareOptions, RegionOptions, RegionsError, Segmentation, Store, StoreError,
};

use super::regions::windows;
use super::support::{Volume, at_most, files_of, noise};

fn with(segmentation: Segmentation, min_region: u64) -> PrepareOptions {
    let regions = Some(RegionOptions { segmentation, min_region });
    PrepareOptions { brick_size: 32, regions, range: Some((0.0, 65535.0)), ..PrepareOptions::default() }
}

fn labels_of(path: &Path) -> PrepareOptions {
    with(Segmentation::Labels { path: path.to_path_buf(), hints: RawHints::default(), opener: Opener::default() }, 0)
}

/// Blobs of few values on noise.
fn blobs(dims: [u32; 3]) -> Volume {
    Volume::new(dims, VoxelType::U16, |[x, y, z]| {
        let blob = (x / 13 + y / 11 + z / 17) % 3;
        if blob == 0 { f64::from(noise([x, y, z])) } else { f64::from(blob * 20_000 + noise([z, x, y]) % 500) }
    })
}

/// All labels of a store that is one brick.
fn labels(store: &Store) -> Vec<u32> {
    let brick = store.manifest().grid.bricks().next().unwrap();
    assert_eq!(store.manifest().grid.brick_count(), 1);
    store.read_brick_regions(brick, 0, &ChunkCache::new(1 << 24)).unwrap().labels
}

/// The labels that one store found, given to another: the same regions, distances and statistics, byte by byte.
#[test]
fn given_back_its_own_labels_a_store_says_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let volume = blobs([61, 40, 64]);
    let found = dir.path().join("found");
    volume.prepare(&found, &PrepareOptions { brick_size: 64, ..at_most(0, windows(64, 0.03)) }).unwrap();
    let labels = labels(&Store::open(&found).unwrap());
    assert!(labels.contains(&0) && labels.iter().max() > Some(&5));
    // Values in another order, far apart: only the regions' first voxels count.
    let file = dir.path().join("l_61x40x64_uint32.raw");
    let renamed = |l: &u32| if *l == 0 { 0 } else { u32::MAX - 7 * l };
    fs::write(&file, labels.iter().map(renamed).flat_map(u32::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    let given = dir.path().join("given");
    let manifest = volume.prepare(&given, &at_most(0, labels_of(&file))).unwrap().manifest;
    assert_eq!(manifest.regions.unwrap().segmentation_range, None);
    super::halos::check(&Store::open(&given).unwrap(), false);
    let mut compared = 0;
    for path in files_of(&found) {
        let name = path.strip_prefix(&found).unwrap();
        if name.starts_with("labels") || name.starts_with("distances") || name.starts_with("regions.bin") {
            assert!(fs::read(&path).unwrap() == fs::read(given.join(name)).unwrap(), "{name:?}");
            compared += 1;
        }
    }
    assert_eq!(compared, 7);
}

/// A label of two separate parts stays one region, whatever its values; thin ones and small ones go.
#[test]
fn given_labels_are_taken_as_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("l_30x9x9_int8.raw");
    let label = |x: u32| match x {
        0..6 | 20..26 => -3i8,
        8 | 9 => 1,
        11..18 => 2,
        _ => 0,
    };
    fs::write(&file, (0..30 * 81).map(|i| label(i % 30) as u8).collect::<Vec<u8>>()).unwrap();
    let volume = Volume::new([30, 9, 9], VoxelType::U16, |[x, _, _]| f64::from(x * 2000));
    volume.prepare(&dir.path().join("s"), &labels_of(&file)).unwrap();
    let store = Store::open(&dir.path().join("s")).unwrap();
    let regions = &store.region_table().unwrap().0;
    assert_eq!(regions.iter().map(|r| (r.root, r.voxels)).collect::<Vec<_>>(), [(0, 12 * 81), (11, 7 * 81)]);
    let x = |x: u32| density_of_code((x * 2000) as u16);
    assert_eq!((regions[0].min, regions[0].max), (x(0), x(25)));
    assert_eq!(regions[0].sum, 81 * (0..6).chain(20..26).map(|v| u64::from(x(v))).sum::<u64>());
    let want = [1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 2, 2, 2, 2, 2, 2, 2, 0, 0, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0];
    assert!(labels(&store).chunks_exact(30).all(|row| row == want));
    let PrepareOptions { regions, .. } = labels_of(&file);
    let regions = regions.map(|r| RegionOptions { min_region: 600, ..r });
    volume.prepare(&dir.path().join("t"), &PrepareOptions { regions, ..labels_of(&file) }).unwrap();
    assert_eq!(Store::open(&dir.path().join("t")).unwrap().region_table().unwrap().0.len(), 1);
}

#[test]
fn label_volumes_that_do_not_fit_are_refused_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let volume = blobs([9, 8, 7]);
    let out = dir.path().join("s");
    for (name, bytes, says) in [
        ("l_9x8x8_uint8.raw", 9 * 8 * 8, "[9, 8, 8] voxels, the volume [9, 8, 7]"),
        ("l_9x8x7_float32.raw", 9 * 8 * 7 * 4, "float32"),
        ("l_9x8x7_uint16.raw", 9, "bytes"),
    ] {
        let file = dir.path().join(name);
        fs::write(&file, vec![1; bytes]).unwrap();
        let error = volume.prepare(&out, &labels_of(&file)).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
        assert!(!out.exists());
    }
    let missing = labels_of(&dir.path().join("absent_9x8x7_uint8.raw"));
    assert!(matches!(volume.prepare(&out, &missing), Err(StoreError::Source(_))));
    for range in [0.0, -0.1, 1.5, f64::NAN] {
        let refused = volume.prepare(&out, &windows(8, range)).unwrap_err();
        assert!(matches!(refused, StoreError::Regions(RegionsError::SegmentationRange(_))), "{refused}");
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 3);
}

/// A staircase: each seed takes steps as long as they stay within the range of what it has.
#[test]
fn the_flood_fill_grows_from_seeds_in_raster_order_within_the_range() {
    let step = 1000.0;
    let volume = Volume::new([60, 7, 7], VoxelType::U16, |[x, _, _]| f64::from(x / 6) * step);
    let dir = tempfile::tempdir().unwrap();
    // Two and a half steps: three stairs a region.
    let range = 2.5 * step / 65535.0;
    volume.prepare(&dir.path().join("s"), &with(Segmentation::Flood { range }, 0)).unwrap();
    let store = Store::open(&dir.path().join("s")).unwrap();
    let regions = &store.region_table().unwrap().0;
    assert_eq!(regions.iter().map(|r| r.voxels / 49).collect::<Vec<_>>(), [18, 18, 18, 6]);
    assert!(regions.iter().all(|r| r.max - r.min <= window_width(range)));

    // On clear values flood and windows find the same regions.
    let volume = Volume::new([50, 40, 40], VoxelType::U16, |[x, y, z]| f64::from((x / 13 + y / 11 + z / 17) % 3) * 9e3);
    let (a, b) = (dir.path().join("a"), dir.path().join("b"));
    volume.prepare(&a, &with(Segmentation::Flood { range: 0.03 }, 0)).unwrap();
    volume.prepare(&b, &with(Segmentation::Windows { range: 0.03 }, 0)).unwrap();
    for name in ["regions.bin", "labels/regions/0/c/0/0/0", "distances/c/0/0/0", "region_bricks.bin"] {
        assert!(fs::read(a.join(name)).unwrap() == fs::read(b.join(name)).unwrap(), "{name}");
    }
    // On noise nothing may leap, and no region is wider than the range.
    let noisy = blobs([50, 20, 40]);
    noisy.prepare(&dir.path().join("n"), &with(Segmentation::Flood { range: 0.03 }, 0)).unwrap();
    let store = Store::open(&dir.path().join("n")).unwrap();
    let regions = &store.region_table().unwrap().0;
    assert!(!regions.is_empty() && regions.iter().all(|r| r.max - r.min <= window_width(0.03)));
}

//! Voxels without data: NaN and declared fill values are code 0 and nothing else is, no statistic counts them, no
//! region has them.

use brickcast_volume::format::{Opener, RawHints, VoxelType};
use brickcast_volume::store::{
    BrickRanges, ChunkCache, NO_DATA_CODE, NoData, PrepareOptions, RegionOptions, Segmentation, Store,
};

use super::regions::windows;
use super::support::{Volume, noise};

const DIMS: [u32; 3] = [40, 24, 33];

/// A ball, single voxels, a layer at a brick's face, and one brick of 8 with all that its margin meets.
fn is_hole([x, y, z]: [u32; 3]) -> bool {
    let away = |a: u32, b: i32| (a as i32 - b).pow(2);
    let ball = away(x, 22) + away(y, 9) + away(z, 20) < 30;
    let brick = (22..36).contains(&x) && y >= 14 && (14..28).contains(&z);
    ball || brick || z == 16 || (x * 7 + y * 13 + z * 29).is_multiple_of(61)
}

/// Values that 16 bits or a float hold; `fill` in the holes.
fn holed(voxel_type: VoxelType, fill: f64) -> Volume {
    Volume::new(DIMS, voxel_type, |p| {
        let value = f64::from(noise([p[0] + 40, p[1] + 40, p[2] + 40]) % 250) + 1.0;
        let value = if voxel_type == VoxelType::F32 { value * 0.013 - 1.0 } else { value };
        if is_hole(p) { fill } else { value }
    })
}

fn places() -> impl Iterator<Item = [u32; 3]> {
    let [nx, ny, nz] = DIMS;
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
}

/// Every voxel of a store's bricks and their ghosts against the volume, the ranges and the flags with them; returns how
/// many bricks meet no data at all.
fn check_bricks(volume: &Volume, store: &Store) -> usize {
    let (manifest, cache) = (store.manifest(), ChunkCache::new(8 << 20));
    let (lo, hi) = manifest.data_range;
    let (mut met, mut empty) = (0, 0);
    for (linear, brick) in manifest.grid.bricks().enumerate() {
        let read = store.read_brick(brick, 2, &cache).unwrap();
        let mut codes = read.codes.iter();
        let (mut range, mut holes) = (BrickRanges::NONE, false);
        for z in read.stored.lo.z..read.stored.hi.z {
            for y in read.stored.lo.y..read.stored.hi.y {
                for x in read.stored.lo.x..read.stored.hi.x {
                    let inside = |v: i32, n: u32| v.clamp(0, n as i32 - 1) as u32;
                    let p = [inside(x, DIMS[0]), inside(y, DIMS[1]), inside(z, DIMS[2])];
                    let code = *codes.next().unwrap();
                    assert_eq!(code == NO_DATA_CODE, is_hole(p), "{p:?} of brick {brick}");
                    met += usize::from(code == NO_DATA_CODE);
                    holes |= code == NO_DATA_CODE;
                    if code != NO_DATA_CODE {
                        range = [range[0].min(code), range[1].max(code)];
                        let value = manifest.value_of_code(code);
                        assert!((value - volume.at(p)).abs() <= (hi - lo) / 65_000.0, "{value} at {p:?}");
                    }
                }
            }
        }
        assert_eq!((read.has_holes, store.brick_ranges().0[linear]), (holes, range), "brick {brick}");
        assert_eq!(store.value_range(brick).is_none(), range == BrickRanges::NONE);
        empty += usize::from(range == BrickRanges::NONE);
    }
    assert!(met > 1000);
    store.verify(&mut |_| {}).unwrap();
    empty
}

#[test]
fn holes_alone_have_code_0_and_count_in_no_statistic() {
    let cases = [
        (VoxelType::F32, f64::NAN, vec![]),
        (VoxelType::F32, -9999.9, vec![-9999.9]),
        (VoxelType::U8, 0.0, vec![0.0]),
        (VoxelType::U8, 255.0, vec![255.0]),
        (VoxelType::I8, -128.0, vec![-128.0]),
        (VoxelType::I16, -32768.0, vec![-32768.0]),
        (VoxelType::U16, 65_535.0, vec![65_535.0, 7e9]),
        (VoxelType::I32, -2e9, vec![-2e9]),
        (VoxelType::U32, 0.0, vec![0.0]),
    ];
    for (voxel_type, fill, declared) in cases {
        let volume = holed(voxel_type, fill);
        let mut data: Vec<f64> = places().filter(|p| !is_hole(*p)).map(|p| volume.at(p)).collect();
        data.sort_by(f64::total_cmp);
        let (count, holes) = (data.len() as u64, places().filter(|p| is_hole(*p)).count() as u64);
        for brick_size in [8, 64] {
            let dir = tempfile::tempdir().unwrap();
            let options = PrepareOptions { brick_size, ..PrepareOptions::default() };
            let summary = volume.prepare_filled(&dir.path().join("s"), &options, &declared).unwrap();
            let store = Store::open(&dir.path().join("s")).unwrap();
            let m = store.manifest();
            assert_eq!(&summary.manifest, m);
            let what = format!("{voxel_type}, fill {fill}, bricks of {brick_size}");
            let no_data = m.no_data.as_ref().unwrap();
            assert_eq!((no_data.voxels, &no_data.fill), (holes, &declared), "{what}");
            let near = |a: f64, b: f64| (a - b).abs() <= (data[data.len() - 1] - data[0]) / 65_000.0;
            assert_eq!((m.min, m.max), (data[0], data[data.len() - 1]), "{what}");
            assert!(near(m.mean, data.iter().sum::<f64>() / count as f64), "{what}: mean {}", m.mean);
            assert!(near(m.quantiles[4], data[data.len().div_ceil(2) - 1]), "{what}: median {}", m.quantiles[4]);
            assert_eq!(m.histogram.iter().sum::<u64>(), count, "{what}");
            assert!(m.otsu > m.min && m.otsu < m.max, "{what}");
            assert_eq!(
                (m.code_of_value(m.min), m.code_of_value(m.max), m.code_of_value(-1e30)),
                (1, 65_535, 1),
                "{what}"
            );
            let stored = m.value_of_stored(no_data.stored);
            assert!(voxel_type.bytes() == 4 || stored == fill, "{what}: files keep the fill value, not {stored}");
            assert!(
                summary.manifest.notes.iter().any(|n| n.starts_with(&format!("{holes} voxels hold no data"))),
                "{what}"
            );
            let empty = check_bricks(&volume, &store);
            assert_eq!(empty > 0, brick_size == 8, "{what}: {empty} bricks without data");
        }
    }
}

/// Constant data between holes that are strewn like noise has none; the same voxels are noise where they are data.
#[test]
fn holes_are_not_taken_for_noise() {
    let dir = tempfile::tempdir().unwrap();
    let strewn = Volume::new([48, 40, 32], VoxelType::U16, |p| f64::from(100 + noise(p.map(|n| n + 40)) % 2));
    let noise_of = |name: &str, fill: &[f64]| {
        strewn.prepare_filled(&dir.path().join(name), &PrepareOptions::default(), fill).unwrap().manifest.noise
    };
    let as_data = noise_of("data", &[]).unwrap();
    assert!((0.3..0.7).contains(&as_data), "{as_data}");
    assert_eq!(noise_of("holes", &[101.0]), None);
}

/// Two fill values of one file become one stored number; one that no voxel has changes no byte.
#[test]
fn several_fill_values_are_one_and_one_that_is_nowhere_is_none() {
    let dir = tempfile::tempdir().unwrap();
    let two = Volume::new(DIMS, VoxelType::I16, |p| match p {
        [3, _, _] => -5.0,
        [4, 7, _] => 900.0,
        [x, y, z] => f64::from(x + y + z),
    });
    let summary = two.prepare_filled(&dir.path().join("two"), &PrepareOptions::default(), &[900.0, -5.0]).unwrap();
    let voxels = u64::from(DIMS[1] * DIMS[2] + DIMS[2]);
    assert_eq!(summary.manifest.no_data, Some(NoData { stored: 900, voxels, fill: vec![900.0, -5.0] }));
    assert_eq!((summary.manifest.min, summary.manifest.max), (0.0, 94.0));
    let store = Store::open(&dir.path().join("two")).unwrap();
    let brick = store.manifest().grid.bricks().next().unwrap();
    let codes = store.read_brick(brick, 0, &ChunkCache::new(1 << 20)).unwrap().codes;
    assert_eq!(codes.iter().filter(|code| **code == NO_DATA_CODE).count() as u64, voxels);
    let plain = two.prepare(&dir.path().join("a"), &PrepareOptions::default()).unwrap();
    let nowhere = two.prepare_filled(&dir.path().join("b"), &PrepareOptions::default(), &[-6.0, 0.5]).unwrap();
    assert_eq!(plain.hash, nowhere.hash);
}

/// Values as low as can be beside the holes: in a region of their own, never in one with the holes, which belong to
/// none.
#[test]
fn no_region_reaches_into_a_hole() {
    let dims = [48, 40, 36];
    let hole = |[x, y, z]: [u32; 3]| (10..22).contains(&x) && (8..30).contains(&y) && z > 6;
    // Right of the plane x = 30 another value; the lowest datum surrounds the hole.
    let value = |p: [u32; 3]| if p[0] >= 30 { 900.0 } else { f64::from(p[2] % 2) };
    let volume = Volume::new(dims, VoxelType::F32, |p| if hole(p) { f64::NAN } else { value(p) });
    let dir = tempfile::tempdir().unwrap();
    let labels_file = dir.path().join("labels_48x40x36_uint8.raw");
    // Labels that know nothing of the hole.
    let labels: Vec<u8> = (0..48 * 40 * 36).map(|i| if i % 48 >= 30 { 2 } else { 1 }).collect();
    std::fs::write(&labels_file, labels).unwrap();
    let range = 0.1;
    let ways = [
        Segmentation::Windows { range },
        Segmentation::Flood { range },
        Segmentation::Labels { path: labels_file, hints: RawHints::default(), opener: Opener::default() },
    ];
    for (i, segmentation) in ways.into_iter().enumerate() {
        for brick_size in [8, 64] {
            let what = format!("{segmentation:?}, bricks of {brick_size}");
            let path = dir.path().join(format!("{i}-{brick_size}"));
            let regions = Some(RegionOptions { segmentation: segmentation.clone(), min_region: 0 });
            let options = PrepareOptions { range: None, regions, ..windows(brick_size, range) };
            let m = volume.prepare(&path, &options).unwrap().manifest;
            let store = Store::open(&path).unwrap();
            assert_eq!(m.regions.as_ref().unwrap().count, 2, "{what}");
            let table = store.region_table().unwrap();
            let data = (0..48 * 40 * 36).filter(|i| !hole([i % 48, i / 48 % 40, i / 48 / 40])).count() as u64;
            assert_eq!(table.0.iter().map(|r| r.voxels).sum::<u64>(), data, "{what}");
            let cache = ChunkCache::new(8 << 20);
            let mut beside = 0;
            for brick in m.grid.bricks() {
                let owned = m.grid.owned_box(brick);
                let read = store.read_brick_regions(brick, 0, &cache).unwrap();
                let d = owned.dims();
                for (j, (label, distance)) in (0..).zip(read.labels.iter().zip(&read.distances)) {
                    let p = [owned.lo.x + j % d.x, owned.lo.y + j / d.x % d.y, owned.lo.z + j / d.x / d.y];
                    if hole(p) {
                        assert_eq!((*label, *distance), (0, 0), "{what}: {p:?}");
                        continue;
                    }
                    assert_eq!(*label, if p[0] >= 30 { 2 } else { 1 }, "{what}: {p:?}");
                    let touches = p[0] == 22 && (8..30).contains(&p[1]) && p[2] > 6;
                    assert!(!touches || *distance == 1, "{what}: {p:?} is {distance} from the hole");
                    beside += u32::from(touches);
                }
            }
            assert!(beside > 500, "{what}");
            let facts = store.brick_facts().unwrap();
            let inner = m.grid.bricks().position(|b| {
                let owned = m.grid.owned_box(b);
                (0..2).all(|corner| {
                    let grown = |v: u32, most: u32| if corner == 0 { v.saturating_sub(2) } else { (v + 1).min(most) };
                    let at = if corner == 0 { owned.lo } else { owned.hi };
                    hole([grown(at.x, 47), grown(at.y, 39), grown(at.z, 35)])
                })
            });
            if let Some(linear) = inner {
                let f = facts[linear];
                assert!([f.min, f.max] == BrickRanges::NONE && !f.has_regions, "{what}: {f:?}");
            }
        }
    }
}

/// What a manifest says of no data must fit the rest of it.
#[test]
fn manifests_that_contradict_themselves_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    holed(VoxelType::U8, 0.0).prepare_filled(&dir.path().join("s"), &PrepareOptions::default(), &[0.0]).unwrap();
    let store = Store::open(&dir.path().join("s")).unwrap();
    let text = String::from_utf8(store.manifest_bytes().to_vec()).unwrap();
    let voxels = store.manifest().no_data.as_ref().unwrap().voxels;
    let stored = "\"stored\": 0";
    assert!(text.contains(stored));
    for (from, to) in [
        (stored.to_owned(), "\"stored\": 256".to_owned()),
        (stored.to_owned(), "\"stored\": -1".to_owned()),
        (format!("\"voxels\": {voxels}"), format!("\"voxels\": {}", voxels + 1)),
        (format!("\"voxels\": {voxels}"), "\"voxels\": 0".to_owned()),
    ] {
        let bad = text.replace(&from, &to);
        assert_ne!(bad, text);
        let error = brickcast_volume::store::Manifest::from_bytes(bad.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("no_data") || error.contains("histogram"), "{error}");
    }
}

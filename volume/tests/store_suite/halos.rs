//! Halos say what the neighbours say, decode no more than a brick holds, and are named where they are damaged.

use std::fs;
use std::path::Path;

use brickcast_volume::brick::StoredBox;
use brickcast_volume::format::VoxelType;
use brickcast_volume::ids::BrickIndex;
use brickcast_volume::store::{ChunkCache, ChunkFault, HaloFault, PrepareOptions, Store, StoreError};
use proptest::prelude::*;

use crate::regions::windows;
use crate::support::{Volume, noise, noisy};

/// Halos of one voxel, and of two for labels and distances.
const LAYERS: u32 = 1;
const REGION_LAYERS: u32 = 2;

fn bricks(brick_size: u32) -> PrepareOptions {
    PrepareOptions { brick_size, ..PrepareOptions::default() }
}

/// The elements of `inner`, of those of `outer`, which is larger by one voxel on every side.
fn without_rim<T: Copy>(outer: StoredBox, elements: &[T], inner: StoredBox) -> Vec<T> {
    assert_eq!((outer.lo + 1, outer.hi - 1), (inner.lo, inner.hi));
    let [nx, ny, nz] = outer.dims().to_array().map(|n| n as usize);
    let row = |y: usize, z: usize| &elements[(z * ny + y) * nx..][1..nx - 1];
    (1..nz - 1).flat_map(|z| (1..ny - 1).flat_map(move |y| row(y, z).iter().copied())).collect()
}

/// Reads each brick from its halo and, a voxel wider than that reaches, from its neighbours. Both must say the same, for every
/// margin that the halo serves, and the first must decode just the voxels of the grown box where none is the fill value.
pub(crate) fn check(store: &Store, dense: bool) {
    let manifest = store.manifest();
    let (dims, voxel_bytes) = (manifest.grid.volume_dims().as_ivec3(), manifest.stored_type.bytes() as u64);
    for brick in manifest.grid.bricks() {
        let (alone, neighbours) = (ChunkCache::new(0), ChunkCache::new(8 << 20));
        let narrow = store.read_brick(brick, LAYERS, &alone).unwrap();
        let wide = store.read_brick(brick, LAYERS + 1, &neighbours).unwrap();
        assert_eq!(without_rim(wide.stored, &wide.codes, narrow.stored), narrow.codes, "brick {brick}");
        let grown = (narrow.stored.hi.min(dims) - narrow.stored.lo.max(glam::IVec3::ZERO)).as_u64vec3();
        let held = grown.element_product() * voxel_bytes;
        assert!(alone.decoded_bytes() <= held, "brick {brick}: {} of {held} bytes", alone.decoded_bytes());
        assert!(!dense || alone.decoded_bytes() == held, "brick {brick}: {} of {held} bytes", alone.decoded_bytes());
        if store.region_table().is_none() {
            continue;
        }
        let mut wide = store.read_brick_regions(brick, REGION_LAYERS + 1, &neighbours).unwrap();
        for margin in (0..=REGION_LAYERS).rev() {
            let narrow = store.read_brick_regions(brick, margin, &alone).unwrap();
            let labels = without_rim(wide.covered, &wide.labels, narrow.covered);
            assert_eq!(labels, narrow.labels, "labels of brick {brick}, margin {margin}");
            let distances = without_rim(wide.covered, &wide.distances, narrow.covered);
            assert_eq!(distances, narrow.distances, "distances of brick {brick}, margin {margin}");
            wide = narrow;
        }
    }
    store.verify(&mut |_| {}).unwrap();
}

fn prepared(volume: &Volume, path: &Path, options: &PrepareOptions) -> Store {
    volume.prepare(path, options).unwrap();
    Store::open(path).unwrap()
}

/// Noise that is nowhere 0, so that every voxel is decoded.
fn dense(dims: [u32; 3], voxel_type: VoxelType) -> Volume {
    Volume::new(dims, voxel_type, |p| f64::from(noise(p) % 100 + 1))
}

/// Layers of constant value, and thin walls of noise: several regions a brick, some beyond its faces only.
fn layered(dims: [u32; 3]) -> Volume {
    Volume::new(dims, VoxelType::U16, |p| match (p[0] % 19, p[2] % 23) {
        (18, _) | (_, 22) => f64::from(noise(p)),
        _ => f64::from(3000 * (1 + p[0] / 19 + p[2] / 23)),
    })
}

#[test]
fn a_halo_says_what_the_neighbours_say() {
    let dir = tempfile::tempdir().unwrap();
    for (nth, voxel_type) in [VoxelType::U8, VoxelType::I8, VoxelType::U16, VoxelType::I16].into_iter().enumerate() {
        for brick_size in [16, 32, 64, 512] {
            let path = dir.path().join(format!("{nth}-{brick_size}"));
            check(&prepared(&dense([71, 45, 67], voxel_type), &path, &bricks(brick_size)), true);
        }
    }
    // Across the faces of shards.
    check(&prepared(&dense([259, 18, 261], VoxelType::U16), &dir.path().join("wide"), &bricks(64)), true);
}

#[test]
fn a_halo_says_of_regions_what_the_neighbours_say() {
    let dir = tempfile::tempdir().unwrap();
    for brick_size in [16, 32, 64] {
        let store =
            prepared(&layered([71, 45, 67]), &dir.path().join(brick_size.to_string()), &windows(brick_size, 0.02));
        assert!(store.region_table().unwrap().0.len() > 4);
        check(&store, true);
    }
}

/// Bricks that are empty on one side, in the middle or all over; nothing is stored of a halo of zeros.
#[test]
fn empty_neighbours_and_empty_bricks() {
    let dir = tempfile::tempdir().unwrap();
    let half = Volume::new([80, 40, 40], VoxelType::U8, |p| if p[0] < 31 { f64::from(noise(p) % 9) } else { 0.0 });
    check(&prepared(&half, &dir.path().join("half"), &bricks(16)), false);
    let kernel =
        Volume::new([48, 48, 48], VoxelType::U16, |p| f64::from(u8::from(p.iter().all(|v| (18..30).contains(v)))));
    let store = prepared(&kernel, &dir.path().join("kernel"), &windows(16, 0.02));
    check(&store, false);
    assert_eq!(fs::metadata(dir.path().join("kernel/halos.bin")).unwrap().len(), 0);
    let cache = ChunkCache::new(0);
    store.read_brick(BrickIndex([0, 0, 0]), LAYERS, &cache).unwrap();
    assert_eq!(cache.decoded_bytes(), 0);
}

/// Bricks smaller than inner chunks have no halos: their neighbours are mostly in the chunks that they need anyway.
#[test]
fn bricks_smaller_than_chunks_have_none() {
    let dir = tempfile::tempdir().unwrap();
    let store = prepared(&noisy([30, 20, 10], VoxelType::U8), &dir.path().join("s"), &bricks(8));
    assert_eq!(store.manifest().halo, None);
    assert!(!dir.path().join("s/halos.bin").exists() && !dir.path().join("s/halo_index.bin").exists());
    let halo = prepared(&noisy([30, 20, 10], VoxelType::U8), &dir.path().join("t"), &bricks(16)).manifest().halo;
    assert_eq!(halo.map(|h| (h.layers, h.regions)), Some((LAYERS, None)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Any size of volume: borders, partly padded chunks, bricks without a core.
    #[test]
    fn halos_of_random_grids(dims in prop::array::uniform3(1_u32..75), size in 4_u32..7, regions in any::<bool>()) {
        let dir = tempfile::tempdir().unwrap();
        let options = if regions { windows(1 << size, 0.02) } else { bricks(1 << size) };
        check(&prepared(&layered(dims), &dir.path().join("s"), &options), true);
    }
}

/// A store of two bricks with regions.
fn two_bricks(dir: &Path) -> Store {
    let path = dir.join("s");
    let halves = Volume::new([32, 16, 16], VoxelType::U16, |p| match p[0] {
        0..10 => 1000.0,
        20.. => 50_000.0,
        _ => f64::from(noise(p) | 1),
    });
    prepared(&halves, &path, &windows(16, 0.02))
}

#[test]
fn damaged_halos_are_named_by_file_and_brick() {
    let dir = tempfile::tempdir().unwrap();
    let store = two_bricks(dir.path());
    let cache = ChunkCache::new(1 << 20);
    for (name, of_regions) in [("halos.bin", false), ("region_halos.bin", true)] {
        let read = |brick| match of_regions {
            false => store.read_brick(brick, LAYERS, &cache).map(drop),
            true => store.read_brick_regions(brick, REGION_LAYERS, &cache).map(drop),
        };
        let path = store.path().join(name);
        let good = fs::read(&path).unwrap();
        let (first, second) = (BrickIndex([0, 0, 0]), BrickIndex([1, 0, 0]));
        // The last byte is the second brick's.
        let mut bad = good.clone();
        *bad.last_mut().unwrap() ^= 1;
        fs::write(&path, &bad).unwrap();
        read(first).unwrap();
        let error = read(second).unwrap_err();
        assert!(
            matches!(&error, StoreError::Halo { brick, fault: HaloFault::Frame(ChunkFault::Crc { .. }), .. } if *brick == second),
            "{error}"
        );
        let text = error.to_string();
        for part in [name, "halo of brick (1, 0, 0)", "crc32c", "prepare it again"] {
            assert!(text.contains(part), "{text}");
        }
        assert_eq!(Store::open(&store.path()).unwrap().verify(&mut |_| {}).unwrap_err().to_string(), text);

        fs::write(&path, &good[..good.len() - 1]).unwrap();
        let error = read(second).unwrap_err();
        assert!(matches!(&error, StoreError::Halo { brick, fault: HaloFault::Cut, .. } if *brick == second), "{error}");
        assert!(!error.is_retryable());
        let error = Store::open(&store.path()).unwrap_err();
        assert!(matches!(&error, StoreError::HaloCut { brick, .. } if *brick == second), "{error}");
        assert!(error.to_string().contains(name), "{error}");
        fs::write(&path, &good[..3]).unwrap();
        let error = Store::open(&store.path()).unwrap_err();
        assert!(matches!(&error, StoreError::HaloCut { brick, .. } if *brick == first), "{error}");
        fs::remove_file(&path).unwrap();
        assert!(read(first).unwrap_err().to_string().contains(name));
        fs::write(&path, &good).unwrap();
        read(second).unwrap();
    }
}

/// The manifest says whether there are halos: a store whose entry was taken out is not read without them.
#[test]
fn halos_are_there_exactly_where_they_must_be() {
    let dir = tempfile::tempdir().unwrap();
    let store = two_bricks(dir.path());
    let manifest: serde_json::Value = serde_json::from_slice(store.manifest_bytes()).unwrap();
    let refused = |change: &dyn Fn(&mut serde_json::Value), says: &str| {
        let mut changed = manifest.clone();
        change(&mut changed);
        fs::write(store.path().join("brickcast.json"), changed.to_string()).unwrap();
        let text = Store::open(&store.path()).unwrap_err().to_string();
        assert!(text.contains(says), "{text}");
    };
    refused(&|m| drop(m.as_object_mut().unwrap().remove("halo")), "bricks of this size have one");
    refused(&|m| drop(m["halo"].as_object_mut().unwrap().remove("region_files")), "exactly where regions are");
    refused(&|m| m["halo"]["layers"] = 0.into(), "halo.layers");
    refused(&|m| m["halo"]["layers"] = 64.into(), "halo.layers");
    refused(&|m| m["halo"]["files"]["halo_index.bin"] = "0".repeat(32).into(), "halo_index.bin");

    refused(&|m| m["brick_size"] = 8.into(), "bricks of this size have none");
}

//! Halos say what the neighbours say, decode no more than a brick holds, and are named where they are damaged.

use std::fs;
use std::ops::{Range, RangeInclusive};
use std::path::Path;

use brickcast_volume::brick::StoredBox;
use brickcast_volume::format::VoxelType;
use brickcast_volume::ids::BrickIndex;
use brickcast_volume::store::{CHUNK_EDGE, ChunkCache, ChunkFault, HaloFault, PrepareOptions, Store, StoreError};
use glam::IVec3;
use proptest::prelude::*;

use super::regions::windows;
use super::support::{Volume, lacking, noise, noisy};

/// Layers of halos, a record each.
const LAYERS: u32 = 3;
/// The same of labels and distances; their first record holds two.
const REGION_LAYERS: u32 = 5;
/// What neither reaches: such reads go through the neighbours.
const BEYOND: u32 = 6;

fn bricks(brick_size: u32) -> PrepareOptions {
    PrepareOptions { brick_size, ..PrepareOptions::default() }
}

/// The elements of `inner`, of those of `outer`, which holds it.
fn cropped<T: Copy>(outer: StoredBox, elements: &[T], inner: StoredBox) -> Vec<T> {
    let [nx, ny, _] = outer.dims().to_array().map(|n| n as usize);
    let [x0, y0, z0] = (inner.lo - outer.lo).to_array().map(|n| n as usize);
    let [width, height, depth] = inner.dims().to_array().map(|n| n as usize);
    let row = |y: usize, z: usize| &elements[((z0 + z) * ny + y0 + y) * nx + x0..][..width];
    (0..depth).flat_map(|z| (0..height).flat_map(move |y| row(y, z).iter().copied())).collect()
}

/// Voxels of a box that are inside the volume.
fn inside(store: &Store, stored: StoredBox) -> u64 {
    let dims = store.manifest().grid.volume_dims().as_ivec3();
    (stored.hi.min(dims) - stored.lo.max(IVec3::ZERO)).as_u64vec3().element_product()
}

/// Voxels of the inner chunks that lie in the brick with all of their voxels.
fn core_voxels(store: &Store, brick: BrickIndex) -> u64 {
    let owned = store.manifest().grid.owned_box(brick);
    (owned.hi / CHUNK_EDGE * CHUNK_EDGE).saturating_sub(owned.lo).as_u64vec3().element_product()
}

/// Reads each brick in every width that its halo serves and beyond, and plainly from the inner chunks of its
/// neighbourhood. Both must say the same, and the first must decode the brick's own inner chunks and just the shells up
/// to that width, where none is the fill value: each voxel of the grown box once.
pub(crate) fn check(store: &Store, dense: bool) {
    let manifest = store.manifest();
    let voxel_bytes = manifest.stored_type.bytes() as u64;
    let has_halos = manifest.halo.is_some();
    for brick in manifest.grid.bricks() {
        let neighbours = ChunkCache::new(8 << 20);
        let wide = store.read_brick(brick, BEYOND, &neighbours).unwrap();
        for ghost in 0..BEYOND {
            let what = format!("brick {brick}, ghost {ghost}");
            let alone = ChunkCache::new(0);
            let read = store.read_brick(brick, ghost, &alone).unwrap();
            assert_eq!(cropped(wide.stored, &wide.codes, read.stored), read.codes, "{what}");
            if has_halos && (1..=LAYERS).contains(&ghost) {
                let (held, decoded) = (inside(store, read.stored) * voxel_bytes, alone.decoded_bytes());
                assert!(if dense { decoded == held } else { decoded <= held }, "{what}: {decoded} of {held} bytes");
            }
        }
        let Some(regions) = store.region_table() else { continue };
        let wide = store.read_brick_regions(brick, BEYOND, &neighbours).unwrap();
        for margin in 0..BEYOND {
            let what = format!("regions of brick {brick}, margin {margin}");
            let alone = ChunkCache::new(0);
            let read = store.read_brick_regions(brick, margin, &alone).unwrap();
            assert_eq!(cropped(wide.covered, &wide.labels, read.covered), read.labels, "{what}");
            assert_eq!(cropped(wide.covered, &wide.distances, read.covered), read.distances, "{what}");
            if has_halos && (2..=REGION_LAYERS).contains(&margin) && regions.0.len() < 256 {
                let (core, records) = (core_voxels(store, brick), u64::from(margin) - 1);
                // A palette and, for each voxel, its label's place and its distance.
                let palettes = records * 4 * (2 + regions.0.len() as u64);
                let held = 5 * core + 2 * (inside(store, read.covered) - core) + palettes;
                assert!(alone.decoded_bytes() <= held, "{what}: {} of {held} bytes", alone.decoded_bytes());
            }
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

/// Nowhere 0: layers of constant value, and thin walls of noise: several regions a brick, some beyond its faces only.
fn layered(dims: [u32; 3]) -> Volume {
    Volume::new(dims, VoxelType::U16, |p| match (p[0] % 19, p[2] % 23) {
        (18, _) | (_, 22) => f64::from(noise(p) | 1),
        _ => f64::from(3000 * (1 + p[0] / 19 + p[2] / 23)),
    })
}

#[test]
fn a_halo_says_what_the_neighbours_say() {
    let dir = tempfile::tempdir().unwrap();
    for (nth, voxel_type) in [VoxelType::U8, VoxelType::I8, VoxelType::U16, VoxelType::I16].into_iter().enumerate() {
        for brick_size in [8, 16, 32, 64, 512] {
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
    for brick_size in [8, 16, 32, 64] {
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
        Volume::new([48, 48, 48], VoxelType::U16, |p| f64::from(u8::from(p.iter().all(|v| (20..28).contains(v)))));
    let store = prepared(&kernel, &dir.path().join("kernel"), &windows(16, 0.02));
    check(&store, false);
    assert_eq!(fs::metadata(dir.path().join("kernel/halos.bin")).unwrap().len(), 0);
    let cache = ChunkCache::new(0);
    store.read_brick(BrickIndex([0, 0, 0]), 1, &cache).unwrap();
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
    assert_eq!(halo.map(|h| (h.layers, h.region_layers, h.regions)), Some((LAYERS, REGION_LAYERS, None)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Any size of volume: borders, partly padded chunks, bricks without a core, layers beyond the volume.
    #[test]
    fn halos_of_random_grids(dims in prop::array::uniform3(1_u32..75), size in 3_u32..7, regions in any::<bool>()) {
        let dir = tempfile::tempdir().unwrap();
        let options = if regions { windows(1 << size, 0.02) } else { bricks(1 << size) };
        check(&prepared(&layered(dims), &dir.path().join("s"), &options), true);
    }
}

/// A store of two bricks beside each other, whose every record holds voxels of both regions.
fn two_bricks(dir: &Path) -> Store {
    let path = dir.join("s");
    let halves = Volume::new([32, 16, 16], VoxelType::U16, |p| match p[1] {
        0..7 => 1000.0,
        9.. => 50_000.0,
        _ => f64::from(noise(p) | 1),
    });
    prepared(&halves, &path, &windows(16, 0.02))
}

/// Where each record of a file of halos lies, by its brick and its outermost layer.
fn records(store: &Store, index: &str, layers: RangeInclusive<u32>) -> Vec<(BrickIndex, u32, Range<usize>)> {
    let bytes = fs::read(store.path().join(index)).unwrap();
    let bricks = store.manifest().grid.bricks();
    let named: Vec<_> = bricks.flat_map(|brick| layers.clone().map(move |layer| (brick, layer))).collect();
    assert_eq!(bytes.len(), 8 * named.len(), "{index}");
    let mut end = 0;
    let lengths = bytes.chunks(8).map(|entry| u32::from_le_bytes(entry[..4].try_into().unwrap()) as usize);
    let ranges = lengths.map(|length| {
        end += length;
        end - length..end
    });
    named.into_iter().zip(ranges).map(|((brick, layer), range)| (brick, layer, range)).collect()
}

#[test]
fn damaged_halos_are_named_by_file_brick_and_layer() {
    let dir = tempfile::tempdir().unwrap();
    let store = two_bricks(dir.path());
    let cache = ChunkCache::new(1 << 20);
    let files = [
        ("halos.bin", "halo_index.bin", 1..=LAYERS, false),
        ("region_halos.bin", "region_halo_index.bin", 2..=REGION_LAYERS, true),
    ];
    for (name, index, layers, of_regions) in files {
        let read = |brick, margin| match of_regions {
            false => store.read_brick(brick, margin, &cache).map(drop),
            true => store.read_brick_regions(brick, margin, &cache).map(drop),
        };
        let path = store.path().join(name);
        let good = fs::read(&path).unwrap();
        for (brick, layer, range) in records(&store, index, layers.clone()) {
            assert!(!range.is_empty(), "{name}: brick {brick}, layer {layer}");
            // What reads nothing of the record knows nothing of its damage.
            let spared = |margin| {
                if layers.contains(&margin) {
                    read(brick, margin).unwrap()
                }
            };
            let at = format!("halo of brick {brick}, layer {layer}");
            for byte in range.clone() {
                let mut bad = good.clone();
                bad[byte] ^= 1 << (byte % 8);
                fs::write(&path, &bad).unwrap();
                let text = read(brick, layer).unwrap_err().to_string();
                let bytes = format!("bytes {}..{}", range.start, range.end);
                for part in [name, &at, &bytes, "crc32c", "prepare it again"] {
                    assert!(text.contains(part), "byte {byte}: {text}");
                }
                assert_eq!(read(brick, *layers.end()).unwrap_err().to_string(), text, "byte {byte}");
            }
            spared(layer - 1);
            let error = read(brick, layer).unwrap_err();
            let is_crc = matches!(&error, StoreError::Halo { fault: HaloFault::Frame(ChunkFault::Crc { .. }), .. });
            assert!(is_crc && !error.is_retryable(), "{error}");
            let verified = Store::open(&store.path()).unwrap().verify(&mut |_| {});
            assert_eq!(verified.unwrap_err().to_string(), error.to_string());

            for end in [range.end - 1, range.start] {
                fs::write(&path, &good[..end]).unwrap();
                spared(layer - 1);
                for margin in [layer, *layers.end()] {
                    let error = read(brick, margin).unwrap_err();
                    let is_cut = matches!(&error, StoreError::Halo { fault: HaloFault::Cut, .. });
                    assert!(is_cut && !error.is_retryable() && error.to_string().contains(&at), "{error}");
                }
                let opened = Store::open(&store.path()).unwrap();
                let (_, error) = opened.lacking().unwrap();
                let text = error.to_string();
                assert!(
                    matches!(error, StoreError::HaloCut { .. }) && text.contains(name) && text.contains(&at),
                    "{text}"
                );
            }
            fs::write(&path, &good).unwrap();
        }
        fs::remove_file(&path).unwrap();
        let first = BrickIndex([0, 0, 0]);
        assert!(read(first, *layers.end()).unwrap_err().to_string().contains(name));
        fs::write(&path, [&good[..], &[0]].concat()).unwrap();
        assert!(lacking(&store.path()).contains(name));
        fs::write(&path, &good).unwrap();
        read(first, *layers.end()).unwrap();
    }
}

/// A brick with nothing about it has no records of outer layers; one at the volume's corner has those of what there is.
#[test]
fn layers_beyond_the_volume_have_no_records() {
    let dir = tempfile::tempdir().unwrap();
    let alone = prepared(&dense([16, 16, 16], VoxelType::U8), &dir.path().join("alone"), &windows(16, 0.5));
    for (index, file, layers) in
        [("halo_index.bin", "halos.bin", 1..=LAYERS), ("region_halo_index.bin", "region_halos.bin", 2..=REGION_LAYERS)]
    {
        assert!(records(&alone, index, layers).iter().all(|(_, _, range)| range.is_empty()), "{index}");
        assert_eq!(fs::metadata(alone.path().join(file)).unwrap().len(), 0);
    }
    check(&alone, true);
    // The last brick is a voxel thick: its neighbour finds one layer there, and then the volume's end.
    let thin = prepared(&dense([17, 16, 16], VoxelType::U8), &dir.path().join("thin"), &bricks(16));
    let there: Vec<bool> = records(&thin, "halo_index.bin", 1..=LAYERS).iter().map(|(_, _, r)| !r.is_empty()).collect();
    assert_eq!(there, [true, false, false, true, true, true]);
    check(&thin, true);
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
    refused(&|m| m["halo"]["layers"] = 1.into(), "halo.layers");
    refused(&|m| m["halo"]["layers"] = 64.into(), "halo.layers");
    refused(&|m| m["halo"]["files"]["halo_index.bin"] = "0".repeat(32).into(), "halo_index.bin");

    refused(&|m| m["brick_size"] = 8.into(), "bricks of this size have none");
}

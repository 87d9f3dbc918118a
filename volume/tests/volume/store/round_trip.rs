//! Voxels that go in come out, for every type, brick size and ghost width, across chunk and shard faces.

use brickcast_volume::brick::RANGE_MARGIN;
use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{ChunkCache, PrepareOptions, Store};

use super::support::{Volume, noisy};

const ALL_TYPES: [VoxelType; 10] = [
    VoxelType::U8,
    VoxelType::I8,
    VoxelType::U16,
    VoxelType::I16,
    VoxelType::U32,
    VoxelType::I32,
    VoxelType::F32,
    VoxelType::U64,
    VoxelType::I64,
    VoxelType::F64,
];

/// Reads every brick of the volume's store and compares each code with the definition. `slack` codes may differ: 0
/// where voxels are kept as they are; where they are mapped to 16 bits, half a step there and half a code here.
fn check(volume: &Volume, options: &PrepareOptions, ghost: u32, slack: u16) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let summary = volume.prepare(&path, options).unwrap();
    let store = Store::open(&path).unwrap();
    assert_eq!((store.hash(), store.manifest()), (summary.hash, &summary.manifest));
    let cache = ChunkCache::new(8 << 20);
    let (lo, hi) = store.manifest().range;
    let code = |v: f64| (((v - lo) / (hi - lo)).clamp(0.0, 1.0) * 65535.0).round() as u16;
    let clamped =
        |p: [i32; 3]| -> [u32; 3] { std::array::from_fn(|a| p[a].clamp(0, volume.dims[a] as i32 - 1) as u32) };
    for (linear, brick) in store.manifest().grid.bricks().enumerate() {
        let read = store.read_brick(brick, ghost, &cache).unwrap();
        assert_eq!(read.stored, store.manifest().grid.owned_box(brick).stored(ghost));
        let mut codes = read.codes.iter();
        for z in read.stored.lo.z..read.stored.hi.z {
            for y in read.stored.lo.y..read.stored.hi.y {
                for x in read.stored.lo.x..read.stored.hi.x {
                    let (got, want) = (*codes.next().unwrap(), code(volume.at(clamped([x, y, z]))));
                    assert!(got.abs_diff(want) <= slack, "{got} for {want} at {x} {y} {z} of brick {brick}");
                }
            }
        }
        assert!(codes.next().is_none());
        // The range table says of the codes over the margin what reading them says.
        let codes = store.read_brick(brick, RANGE_MARGIN, &cache).unwrap().codes;
        let want = [*codes.iter().min().unwrap(), *codes.iter().max().unwrap()];
        assert_eq!(store.brick_ranges().0[linear], want, "range of brick {brick}");
    }
    store.verify(&mut |_| {}).unwrap();
}

fn bricks(brick_size: u32) -> PrepareOptions {
    PrepareOptions { brick_size, ..PrepareOptions::default() }
}

#[test]
fn every_type_and_odd_sizes() {
    for voxel_type in ALL_TYPES {
        check(&noisy([71, 45, 67], voxel_type), &bricks(32), 1, if voxel_type.is_lossless() { 0 } else { 1 });
    }
}

#[test]
fn bricks_smaller_and_larger_than_inner_chunks_and_shards() {
    let volume = noisy([50, 37, 41], VoxelType::I16);
    for brick_size in [8, 16, 64, 512] {
        for ghost in [0, 1, 3] {
            check(&volume, &bricks(brick_size), ghost, 0);
        }
    }
}

#[test]
fn bricks_and_ghosts_across_shard_faces() {
    check(&noisy([261, 19, 259], VoxelType::U8), &bricks(64), 2, 0);
    check(&noisy([5, 300, 7], VoxelType::U16), &bricks(128), 2, 0);
}

#[test]
fn volumes_thinner_than_their_ghost_layers() {
    for dims in [[1, 1, 1], [1, 9, 1], [33, 1, 2], [2, 3, 65]] {
        check(&noisy(dims, VoxelType::U16), &bricks(8), 3, 0);
    }
}

#[test]
fn a_given_range_clamps() {
    let options = PrepareOptions { range: Some((-100.5, 2000.0)), ..bricks(16) };
    check(&noisy([40, 20, 35], VoxelType::I16), &options, 1, 0);
    // Mapped over the part of the data that the range leaves: still a code at most.
    let options = PrepareOptions { range: Some((0.0, 30.0)), ..bricks(16) };
    check(&noisy([40, 20, 35], VoxelType::F32), &options, 1, 1);
}

#[test]
fn constant_volumes() {
    for voxel_type in ALL_TYPES {
        for value in [0.0, 77.0, f64::from(f32::MAX)] {
            check(&Volume::new([40, 9, 9], voxel_type, |_| value), &bricks(8), 1, 0);
        }
    }
}

#[test]
fn whole_numbers_in_wide_types_survive_exactly() {
    for voxel_type in [VoxelType::I32, VoxelType::F32, VoxelType::I64, VoxelType::F64] {
        let volume = Volume::new([40, 40, 3], voxel_type, |[x, y, _]| f64::from(x * 40 + y) - 1024.0);
        let dir = tempfile::tempdir().unwrap();
        let manifest = volume.prepare(&dir.path().join("s"), &bricks(8)).unwrap().manifest;
        assert!(manifest.lossless);
        assert_eq!((manifest.scale, manifest.offset, manifest.min, manifest.max), (1.0, -1024.0, -1024.0, 575.0));
        check(&volume, &bricks(8), 1, 0);
    }
}

/// Neighbours' voxels come from halos, and what those do not reach through the cache, so ghost layers must not multiply
/// the decoding. The cache holds five layers of inner chunks, of the 32 that the volume has.
#[test]
fn decoded_bytes_stay_near_owned_bytes() {
    let volume = noisy([128, 128, 512], VoxelType::U8);
    let dir = tempfile::tempdir().unwrap();
    for (brick_size, ghost) in [(64, 4), (64, 3), (32, 2), (32, 1), (16, 1)] {
        let path = dir.path().join(format!("{brick_size}-{ghost}"));
        volume.prepare(&path, &bricks(brick_size)).unwrap();
        let store = Store::open(&path).unwrap();
        let layer = (128 * 128 * 16) + 64 * 256;
        let cache = ChunkCache::new(5 * layer);
        for brick in store.manifest().grid.bricks() {
            store.read_brick(brick, ghost, &cache).unwrap();
            assert!(cache.resident_bytes() <= 5 * layer);
        }
        let ratio = cache.decoded_bytes() as f64 / (128 * 128 * 512) as f64;
        assert!(ratio <= 1.5, "bricks of {brick_size}: {ratio}");
        assert!(cache.decoded_bytes() > 0);
    }
}

#[test]
fn many_threads_read_one_store_and_decode_each_chunk_once() {
    let volume = noisy([100, 100, 100], VoxelType::U16);
    let dir = tempfile::tempdir().unwrap();
    volume.prepare(&dir.path().join("s"), &bricks(32)).unwrap();
    let store = Store::open(&dir.path().join("s")).unwrap();
    let cache = ChunkCache::new(64 << 20);
    let alone = ChunkCache::new(64 << 20);
    let want: Vec<_> = store.manifest().grid.bricks().map(|b| store.read_brick(b, 4, &alone).unwrap()).collect();
    // Four ghost layers come from the neighbours.
    std::thread::scope(|scope| {
        for _ in 0..6 {
            scope.spawn(|| {
                for (brick, want) in store.manifest().grid.bricks().zip(&want) {
                    assert_eq!(store.read_brick(brick, 4, &cache).unwrap(), *want);
                }
            });
        }
    });
    assert_eq!(cache.decoded_bytes(), alone.decoded_bytes());
}

//! Regions: the definition in memory against what a store says, whatever bricks and threads.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs;

use brickcast_volume::deep_regions::deep_share;
use brickcast_volume::format::VoxelType;
use brickcast_volume::ids::BrickIndex;
use brickcast_volume::regions::code::{MAX_SLOTS, code_of_density};
use brickcast_volume::regions::{BrickFacts, Region, Windows, density_of_code, window_width};
use brickcast_volume::store::{
    ChunkCache, HISTOGRAM_BINS, PrepareOptions, RegionOptions, RegionsError, Segmentation, Store, StoreError,
};
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use proptest::prelude::*;

use super::support::{Volume, at_most, files_of, levels_of};

pub(crate) fn windows(brick_size: u32, range: f64) -> PrepareOptions {
    let regions = RegionOptions { segmentation: Segmentation::Windows { range }, min_region: 0 };
    PrepareOptions { brick_size, regions: Some(regions), range: Some((0.0, 65535.0)), ..PrepareOptions::default() }
}

/// All codes, labels and distances of a store, x fastest, put together from bricks.
struct Whole {
    codes: Vec<u16>,
    labels: Vec<u32>,
    distances: Vec<u8>,
}

fn read_whole(store: &Store) -> Whole {
    let grid = store.manifest().grid;
    let n = grid.volume_dims();
    let voxels = n.as_u64vec3().element_product() as usize;
    let mut whole = Whole { codes: vec![0; voxels], labels: vec![0; voxels], distances: vec![0; voxels] };
    let cache = ChunkCache::new(8 << 20);
    for brick in grid.bricks() {
        let owned = grid.owned_box(brick);
        let codes = store.read_brick(brick, 0, &cache).unwrap().codes;
        let regions = store.read_brick_regions(brick, 0, &cache).unwrap();
        let mut from = 0;
        for z in owned.lo.z..owned.hi.z {
            for y in owned.lo.y..owned.hi.y {
                for x in owned.lo.x..owned.hi.x {
                    let to = (x + n.x * (y + n.y * z)) as usize;
                    whole.codes[to] = codes[from];
                    whole.labels[to] = regions.labels[from];
                    whole.distances[to] = regions.distances[from];
                    from += 1;
                }
            }
        }
    }
    whole
}

fn neighbours(i: usize, dims: [usize; 3]) -> impl Iterator<Item = usize> {
    let strides = [1, dims[0], dims[0] * dims[1]];
    (0..3).flat_map(move |a| {
        let at = i / strides[a] % dims[a];
        [(at > 0).then(|| i - strides[a]), (at + 1 < dims[a]).then(|| i + strides[a])].into_iter().flatten()
    })
}

/// Components of equal window by plain flood, distances by search; regions without a voxel of distance 3 or
/// with fewer voxels than `min_region` dropped.
fn by_definition(codes: &[u16], dims: [usize; 3], range: f64, min_region: u64) -> (Vec<u32>, Vec<u8>, Vec<Region>) {
    let mut histogram = vec![0; 16384];
    codes.iter().for_each(|c| histogram[usize::from(density_of_code(*c))] += 1);
    let windows = Windows::new(&histogram, window_width(range));
    let window: Vec<u16> = codes.iter().map(|c| windows.of(density_of_code(*c))).collect();
    let distances = distances_of(&window, dims);
    let (mut labels, mut regions) = (vec![u32::MAX; codes.len()], Vec::new());
    for root in 0..codes.len() {
        if labels[root] != u32::MAX {
            continue;
        }
        let mut found = vec![root];
        labels[root] = 0;
        let mut next = 0;
        while next < found.len() {
            for n in neighbours(found[next], dims) {
                if labels[n] == u32::MAX && window[n] == window[root] {
                    labels[n] = 0;
                    found.push(n);
                }
            }
            next += 1;
        }
        if found.iter().all(|i| distances[*i] < 3) || (found.len() as u64) < min_region {
            continue;
        }
        let densities = || found.iter().map(|i| density_of_code(codes[*i]));
        regions.push(Region {
            root: root as u64,
            voxels: found.len() as u64,
            sum: densities().map(u64::from).sum(),
            min: densities().min().unwrap(),
            max: densities().max().unwrap(),
        });
        found.iter().for_each(|i| labels[*i] = regions.len() as u32);
    }
    let distances = distances.iter().zip(&labels).map(|(d, l)| if *l == 0 { 0 } else { *d }).collect();
    (labels, distances, regions)
}

/// Distances by breadth first search over the 26 neighbours, from the voxels beside another window (checked against the
/// definition itself in `regions/distance.rs`).
fn distances_of(window: &[u16], dims: [usize; 3]) -> Vec<u8> {
    let around = |i: usize| {
        let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        let [xs, ys, zs] = [0, 1, 2].map(|a| at[a].saturating_sub(1)..(at[a] + 2).min(dims[a]));
        zs.flat_map(move |z| {
            let xs = xs.clone();
            ys.clone().flat_map(move |y| xs.clone().map(move |x| (z * dims[1] + y) * dims[0] + x))
        })
    };
    let mut distances = vec![255; window.len()];
    let mut layer: Vec<usize> = (0..window.len()).filter(|i| around(*i).any(|n| window[n] != window[*i])).collect();
    for d in 1..255 {
        layer.iter().for_each(|i| distances[*i] = d);
        let mut next = Vec::new();
        for i in layer.iter().flat_map(|i| around(*i)) {
            if distances[i] == 255 {
                distances[i] = 254;
                next.push(i);
            }
        }
        layer = next;
    }
    distances
}

/// Facts of a brick by their definition.
fn facts_by_definition(whole: &Whole, regions: &[Region], store: &Store, brick: BrickIndex) -> BrickFacts {
    let grid = store.manifest().grid;
    let n = grid.volume_dims();
    let stored = grid.owned_box(brick).stored(2);
    let (lo, hi) = (stored.lo.max(glam::IVec3::ZERO).as_uvec3(), stored.hi.as_uvec3().min(n));
    let voxels = (lo.z..hi.z)
        .flat_map(|z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| (x + n.x * (y + n.y * z)) as usize)));
    let voxels: Vec<usize> = voxels.collect();
    let has_regions = voxels.iter().any(|i| whole.labels[*i] != 0);
    let flat = |i: usize| match whole.labels[i] {
        _ if !has_regions => whole.codes[i],
        0 => code_of_density(density_of_code(whole.codes[i])),
        label => code_of_density(regions[label as usize - 1].mean()),
    };
    let labels: HashSet<u32> = voxels.iter().map(|i| whole.labels[*i]).collect();
    BrickFacts {
        min: voxels.iter().map(|i| flat(*i)).min().unwrap(),
        max: voxels.iter().map(|i| flat(*i)).max().unwrap(),
        deviation: voxels.iter().map(|i| flat(*i).abs_diff(whole.codes[*i])).max().unwrap(),
        has_regions,
        has_leaps: voxels.iter().any(|i| whole.distances[*i] >= 3),
        only_region: if labels.len() == 1 { *labels.iter().next().unwrap() } else { 0 },
    }
}

/// Everything that each level of a store says of its regions, against the definitions.
fn check(volume: &Volume, options: &PrepareOptions, range: f64) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    volume.prepare(&path, options).unwrap();
    let store = Store::open(&path).unwrap();
    store.verify(&mut |_| {}).unwrap();
    assert_eq!(store.manifest().geometry.dims().to_array(), volume.dims);
    levels_of(&store).for_each(|level| check_level(level, range));
}

fn check_level(store: &Store, range: f64) {
    let whole = read_whole(store);
    let dims = store.manifest().geometry.dims().to_array().map(|n| n as usize);
    let min_region = store.manifest().regions.as_ref().unwrap().min_region;
    let (labels, distances, regions) = by_definition(&whole.codes, dims, range, min_region);
    assert_eq!(store.region_table().unwrap().0, regions);
    assert!(whole.labels == labels && whole.distances == distances, "{dims:?}");
    assert!(regions.iter().all(|r| r.max - r.min <= window_width(range)));
    for (facts, brick) in store.brick_facts().unwrap().iter().zip(store.manifest().grid.bricks()) {
        assert_eq!(*facts, facts_by_definition(&whole, &regions, store, brick), "brick {brick}");
    }
    let entry = store.manifest().regions.as_ref().unwrap();
    assert_eq!(entry.count as usize, regions.len());
    assert_eq!(entry.voxels, labels.iter().filter(|l| **l != 0).count() as u64);
    assert_eq!(entry.leap_voxels, distances.iter().filter(|d| **d >= 3).count() as u64);
    let mut bins = vec![0; HISTOGRAM_BINS];
    for (&label, _) in labels.iter().zip(&distances).filter(|(label, distance)| **label != 0 && **distance >= 3) {
        bins[usize::from(code_of_density(regions[label as usize - 1].mean())) * HISTOGRAM_BINS / 65536] += 1;
    }
    assert_eq!(entry.leap_histogram, Some(bins));
    assert_eq!(entry.largest, regions.iter().map(|r| r.voxels).max().unwrap_or(0));
}

/// A body of pipes and sheets on noise: `solid` voxels have nearly one value.
fn carved(dims: [u32; 3], solid: impl Fn([u32; 3]) -> bool) -> Volume {
    Volume::new(dims, VoxelType::U16, |p| {
        let noise = super::support::noise(p.map(|v| v + 40));
        if solid(p) { f64::from(30_000 + noise % 600) } else { f64::from(noise % 65_536) }
    })
}

/// What shows counts, and only where light passes; the same for all bricks.
#[test]
fn how_much_of_what_shows_lies_deep_in_regions() {
    let volume = carved([40; 3], |[x, _, _]| x >= 20);
    let share = |brick: u32, lo: f64, hi: f64, opacity: f64| {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s");
        volume.prepare(&path, &windows(brick, 0.03)).unwrap();
        let function = TransferFunction::window(lo, hi, opacity, Colormap::Viridis).unwrap();
        deep_share(Store::open(&path).unwrap().manifest(), &function, 0.5).unwrap()
    };
    // 18 x 36 x 36 of the solid's 20 x 40 x 40 voxels are three from its border or deeper; noise shows beside it.
    let solid = share(16, 28_000.0, 29_000.0, 0.05);
    assert!((0.4..0.6).contains(&solid), "{solid}");
    assert_eq!(solid, share(32, 28_000.0, 29_000.0, 0.05));
    assert_eq!(share(16, 28_000.0, 29_000.0, 1.0), 0.0, "rays end at its border");
    assert_eq!(share(16, 40_000.0, 60_000.0, 0.05), 0.0, "it does not show");
}

#[test]
fn a_u_whose_arms_meet_only_at_the_bottom_is_one_region() {
    // The arms are four blocks long and end in a bridge of the last block.
    let arm = |x: u32| (5..13).contains(&x) || (50..58).contains(&x);
    check(&carved([70, 10, 140], |[x, _, z]| arm(x) || z >= 130 && (5..58).contains(&x)), &windows(16, 0.03), 0.03);
    // Upside down: one component at first, two arms later.
    check(&carved([70, 10, 140], |[x, _, z]| arm(x) || z < 8 && (5..58).contains(&x)), &windows(32, 0.03), 0.03);
}

#[test]
fn a_spiral_through_many_blocks_is_one_region() {
    let spiral = |[x, y, z]: [u32; 3]| {
        // A ramp that turns about the z axis, seven voxels wide.
        let side = (z / 9) % 4;
        let (u, v) = ((20..80).contains(&x), (20..80).contains(&y));
        match side {
            0 => u && (20..27).contains(&y),
            1 => v && (73..80).contains(&x),
            2 => u && (73..80).contains(&y),
            _ => v && (20..27).contains(&x),
        }
    };
    check(&carved([100, 100, 75], spiral), &windows(64, 0.03), 0.03);
}

#[test]
fn layers_blobs_and_noise_of_every_shape_of_volume() {
    let blobs = |[x, y, z]: [u32; 3]| (x / 9 + y / 7 + z / 11).is_multiple_of(2);
    for dims in [[97, 33, 65], [1, 90, 40], [40, 1, 90], [90, 40, 1], [1, 1, 1], [1, 1, 300], [64, 64, 64], [33, 2, 33]]
    {
        check(&carved(dims, blobs), &windows(16, 0.03), 0.03);
    }
    // Leap voxels are known two planes further down: slabs of one plane and of two, and none below.
    for depth in [2, 31, 32, 33, 34, 64, 65, 66, 97] {
        check(&carved([12, 11, depth], |[x, _, z]| x > 5 && z + 3 != depth), &windows(16, 0.03), 0.03);
    }
    check(&super::support::noisy([70, 40, 40], VoxelType::U16), &windows(8, 0.5), 0.5);
    check(&super::support::noisy([70, 40, 40], VoxelType::I8), &PrepareOptions { range: None, ..windows(8, 0.9) }, 0.9);
    check(&Volume::new([40, 40, 70], VoxelType::U16, |_| 7.0), &windows(8, 0.01), 0.01);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    /// Boxes of few values over each other, so that regions enclose, cut and touch one another across blocks.
    #[test]
    fn random_boxes_become_the_regions_of_the_definition(
        dims in [1..75u32, 1..75u32, 1..75u32],
        boxes in prop::collection::vec(([0..70u32, 0..70u32, 0..70u32], [1..60u32, 1..60u32, 1..60u32], 0..5u32), 0..9),
        specks in 0..4u32,
        min_region in prop_oneof![Just(0u64), 1..3000u64],
    ) {
        let volume = Volume::new(dims, VoxelType::U16, |p| {
            let over = boxes.iter().rev().find(|(lo, size, _)| (0..3).all(|a| p[a] >= lo[a] && p[a] < lo[a] + size[a]));
            let noise = super::support::noise(p);
            let speck = noise % 1000 < specks;
            f64::from(over.map_or(0, |(_, _, v)| v * 13_000) + noise % 500 + u32::from(speck) * 5000)
        });
        let mut options = windows(32, 0.05);
        options.regions.as_mut().unwrap().min_region = min_region;
        check(&volume, &options, 0.05);
    }
}

#[test]
fn files_do_not_depend_on_bricks_or_threads() {
    let blobs = |[x, y, z]: [u32; 3]| (x / 13 + y / 17 + z / 19).is_multiple_of(2);
    let volume = carved([100, 70, 90], blobs);
    let dir = tempfile::tempdir().unwrap();
    let mut seen: BTreeMap<String, HashMap<u32, Vec<u8>>> = BTreeMap::new();
    for (brick_size, threads) in [(16, 1), (32, 1), (64, 1), (16, 2), (32, 3), (64, 2)] {
        let path = dir.path().join(format!("{brick_size}-{threads}"));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        // How many levels there are follows from the bricks; what is on them does not.
        pool.install(|| volume.prepare(&path, &at_most(1, windows(brick_size, 0.03)))).unwrap();
        for file in files_of(&path) {
            let name = file.strip_prefix(&path).unwrap().to_str().unwrap().to_owned();
            let of_bricks =
                ["bricks.bin", "halo", "brickcast.json", "level.json"].iter().any(|part| name.contains(part));
            let key = if of_bricks { brick_size } else { 0 };
            let bytes = fs::read(&file).unwrap();
            let first = seen.entry(name.clone()).or_default().entry(key).or_insert_with(|| bytes.clone());
            assert!(*first == bytes, "{name}: bricks of {brick_size}, {threads} threads");
        }
    }
    let names: Vec<&str> = seen.keys().map(String::as_str).collect();
    for name in
        ["labels/regions/1/c/0/0/0", "levels/1/regions.bin", "distances/c/0/0/0", "regions.bin", "region_halos.bin"]
    {
        assert!(names.contains(&name), "{names:?}");
    }
}

/// A brick of 64 with a cube of 5^3 every 6 voxels would need a slot for each of them.
#[test]
fn where_a_brick_has_too_many_regions_small_ones_go_everywhere() {
    // Cubes of 5^3, those of the lowest layers longer: 144 of 5 x 5 x 11 and 6 layers of 144 of 5^3.
    let cell = |v: u32| (v / 6, v % 6 < 5);
    let volume = Volume::new([80, 80, 60], VoxelType::U16, |[x, y, z]| {
        let (cx, in_x) = cell(x);
        let (cy, in_y) = cell(y);
        let in_z = if z < 12 { z < 11 } else { cell(z).1 };
        // Neighbouring cubes of other values; long ones in the first row grow by one voxel each.
        let grown = z < 11 && y % 6 == 5 && cy == 0 && in_x && x % 6 <= cx % 5;
        if in_x && in_y && in_z || grown { f64::from(10_000 + 300 * ((cx + cy) % 2)) } else { 60_000.0 }
    });
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let summary = volume.prepare(&path, &windows(64, 0.03)).unwrap();
    let entry = summary.manifest.regions.clone().unwrap();
    assert!(entry.min_region > entry.min_region_asked);
    let note = summary.manifest.notes.join("\n");
    assert!(note.contains(&entry.min_region.to_string()) && note.contains("0 was asked for"), "{note}");
    check(&volume, &windows(64, 0.03), 0.03);
    let leaping = |store: &Store| -> usize {
        let cache = ChunkCache::new(8 << 20);
        let bricks = store.manifest().grid.bricks().map(|b| {
            let regions = store.read_brick_regions(b, 2, &cache).unwrap();
            let found = regions.labels.iter().zip(&regions.distances).filter(|(_, d)| **d >= 3);
            found.map(|(l, _)| *l).collect::<HashSet<_>>().len()
        });
        bricks.max().unwrap()
    };
    let store = Store::open(&path).unwrap();
    assert!(leaping(&store) <= MAX_SLOTS);
    // Halos are those of the last attempt.
    super::halos::check(&store, true);
    // One voxel less, and some brick would have too many: the limit was raised no further than needed.
    let smaller = dir.path().join("smaller");
    let mut options = windows(64, 0.03);
    options.regions.as_mut().unwrap().min_region = entry.min_region - 1;
    let again = volume.prepare(&smaller, &options).unwrap().manifest.regions.unwrap();
    assert_eq!(again.min_region, entry.min_region);
    // Bricks of 32 hold few enough of them.
    let small_bricks = volume.prepare(&dir.path().join("b"), &windows(16, 0.03)).unwrap().manifest.regions.unwrap();
    assert_eq!(small_bricks.min_region, small_bricks.min_region_asked);
    assert!(small_bricks.count > entry.count);
}

#[test]
fn regions_are_clamped_at_the_edge_like_voxels_and_reads_are_checked() {
    let volume = carved([40, 20, 30], |[x, _, _]| x < 20);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    volume.prepare(&path, &windows(16, 0.03)).unwrap();
    let store = Store::open(&path).unwrap();
    let cache = ChunkCache::new(1 << 20);
    let whole = read_whole(&store);
    for brick in store.manifest().grid.bricks() {
        let read = store.read_brick_regions(brick, 3, &cache).unwrap();
        let (lo, d) = (read.covered.lo, read.covered.dims());
        assert_eq!(read.covered, store.read_brick(brick, 3, &cache).unwrap().stored);
        for i in 0..read.labels.len() as u32 {
            let p = lo + glam::UVec3::new(i % d.x, i / d.x % d.y, i / d.x / d.y).as_ivec3();
            let p = p.clamp(glam::IVec3::ZERO, glam::IVec3::new(39, 19, 29));
            let voxel = (p.x + 40 * (p.y + 20 * p.z)) as usize;
            assert_eq!(read.labels[i as usize], whole.labels[voxel]);
            assert_eq!(read.distances[i as usize], whole.distances[voxel]);
        }
    }
    let outside = BrickIndex([9, 0, 0]);
    assert!(matches!(store.read_brick_regions(outside, 1, &cache), Err(StoreError::BrickOutside { .. })));
    let brick = store.manifest().grid.bricks().next().unwrap();
    assert!(matches!(store.read_brick_regions(brick, 65, &cache), Err(StoreError::Ghost { .. })));
    let plain = dir.path().join("plain");
    volume.prepare(&plain, &PrepareOptions::default()).unwrap();
    let plain = Store::open(&plain).unwrap();
    assert!(plain.region_table().is_none() && plain.brick_facts().is_none());
    let error = plain.read_brick_regions(brick, 1, &cache).unwrap_err();
    assert!(matches!(error, StoreError::Regions(RegionsError::None)), "{error}");
}

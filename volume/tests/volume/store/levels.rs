//! Levels of detail against their definition.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::fs;
use std::path::Path;

use brickcast_volume::brick::RANGE_MARGIN;
use brickcast_volume::format::{Opener, RawHints, VoxelType};
use brickcast_volume::store::{
    BrickRanges, ChunkCache, Levels, Manifest, NO_DATA_CODE, PrepareOptions, RegionOptions, Segmentation, Store,
    prepare, stored_bytes,
};
use glam::UVec3;

use super::support::{Volume, codes_of, files_of, levels_of, noise, noisy};

pub(crate) fn bricks(brick_size: u32) -> PrepareOptions {
    PrepareOptions { brick_size, ..PrepareOptions::default() }
}

pub(crate) fn prepared(volume: &Volume, dir: &Path, options: &PrepareOptions, fill: &[f64]) -> Store {
    let path = dir.join("s");
    let summary = volume.prepare_filled(&path, options, fill).unwrap();
    let store = Store::open(&path).unwrap();
    assert_eq!((store.hash(), store.manifest()), (summary.hash, &summary.manifest));
    assert_eq!(summary.store_bytes, stored_bytes(&path));
    assert_eq!(summary.store_bytes, files_of(&path).iter().map(|f| f.metadata().unwrap().len()).sum::<u64>());
    store.verify(&mut |_| {}).unwrap();
    store
}

/// For each voxel of a level, the finest voxels under it.
fn under(dims: [u32; 3], level: u8) -> impl Iterator<Item = Vec<usize>> {
    let [nx, ny, nz] = dims.map(|n| n.div_ceil(1 << level));
    let part = move |at: u32, n: u32| at << level..((at + 1) << level).min(n);
    let place = move |x, y, z| (x + dims[0] * (y + dims[1] * z)) as usize;
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z]))).map(move |[x, y, z]| {
        let row = move |y, z| part(x, dims[0]).map(move |x| place(x, y, z));
        part(z, dims[2]).flat_map(|z| part(y, dims[1]).flat_map(move |y| row(y, z))).collect()
    })
}

/// Rounded half up.
fn mean(stored: impl Iterator<Item = i64> + Clone) -> i64 {
    let (sum, count) = (stored.clone().sum::<i64>(), stored.count() as i64);
    (2 * sum + count).div_euclid(2 * count)
}

/// Every voxel and every range of every level, against the numbers that are stored of the finest; `None` where there is
/// no data.
fn check(store: &Store, stored: &[Option<i64>]) {
    let (m, dims) = (store.manifest(), store.manifest().geometry.dims());
    let code = |v: i64| m.code_of_value(m.value_of_stored(v as i32));
    let finest: Vec<Option<u16>> = stored.iter().map(|v| v.map(code)).collect();
    for (level, of_level) in (0u8..).zip(levels_of(store)) {
        let what = format!("level {level} of {dims}");
        let n = of_level.manifest().geometry.dims();
        assert_eq!(n, dims.map(|n| n.div_ceil(1 << level)), "{what}");
        let codes = codes_of(of_level);
        for (i, (code_here, under)) in codes.iter().zip(under(dims.to_array(), level)).enumerate() {
            let data = under.iter().filter_map(|place| stored[*place]);
            let want = if data.clone().count() == 0 { NO_DATA_CODE } else { code(mean(data)) };
            assert_eq!(*code_here, want, "voxel {i} on {what}");
        }
        let grid = of_level.manifest().grid;
        for (range, brick) in of_level.brick_ranges().0.iter().zip(grid.bricks()) {
            let owned = grid.owned_box(brick);
            let (lo, hi) = (owned.lo << u32::from(level), owned.hi << u32::from(level));
            let want = range_of(&finest, dims, lo, hi, RANGE_MARGIN << level);
            assert_eq!(*range, want, "range of brick {brick} on {what}");
            for code in of_level.read_brick(brick, RANGE_MARGIN, &ChunkCache::new(1 << 20)).unwrap().codes {
                let is_hole = m.no_data.is_some() && code == NO_DATA_CODE;
                assert!(is_hole || (range[0]..=range[1]).contains(&code), "{code} beyond {range:?} on {what}");
            }
        }
        let edge = [4 >> level, 1][usize::from(level > 2)];
        let cells = n.map(|n| n.div_ceil(edge));
        let bytes = of_level.cell_ranges().unwrap().to_bytes();
        assert_eq!(bytes.len(), 4 * cells.element_product() as usize);
        for (i, cell) in bytes.as_chunks::<4>().0.iter().enumerate() {
            let i = i as u32;
            let lo = UVec3::new(i % cells.x, i / cells.x % cells.y, i / cells.x / cells.y) * edge;
            let want = range_of(&finest, dims, lo << u32::from(level), (lo + edge) << u32::from(level), 1 << level);
            let got = [u16::from_le_bytes([cell[0], cell[1]]), u16::from_le_bytes([cell[2], cell[3]])];
            assert_eq!(got, want, "cell {i} on {what}");
        }
        let means = of_level.mean_ranges().unwrap();
        assert_eq!((means.ranges().len(), means.cells().edge()), (bytes.len() / 4, edge), "{what}");
        // The codes of voxels without data are told from others by what is under them.
        let holds = |under: Vec<usize>| under.iter().any(|place| stored[*place].is_some());
        let of_data = codes.iter().zip(under(dims.to_array(), level));
        let of_data: Vec<Option<u16>> = of_data.map(|(code, under)| holds(under).then_some(*code)).collect();
        for (i, range) in means.ranges().iter().enumerate() {
            let cell = means.cells().voxels(i);
            assert_eq!(*range, range_of(&of_data, n, cell.lo, cell.hi, 0), "means of cell {i} on {what}");
        }
    }
}

/// Smallest and largest code of a box grown by a margin and cut to the volume.
fn range_of(codes: &[Option<u16>], dims: UVec3, lo: UVec3, hi: UVec3, margin: u32) -> [u16; 2] {
    let (lo, hi) = (lo.saturating_sub(UVec3::splat(margin)), (hi + margin).min(dims));
    let mut range = BrickRanges::NONE;
    for z in lo.z..hi.z {
        for y in lo.y..hi.y {
            let start = (lo.x + dims.x * (y + dims.y * z)) as usize;
            for code in codes[start..start + (hi.x - lo.x) as usize].iter().flatten() {
                range = [range[0].min(*code), range[1].max(*code)];
            }
        }
    }
    range
}

fn whole(volume: &Volume) -> Vec<Option<i64>> {
    volume.values.iter().map(|v| Some(*v as i64)).collect()
}

#[test]
fn every_voxel_is_the_mean_of_the_finest_and_ranges_are_theirs() {
    for voxel_type in [VoxelType::U8, VoxelType::I8, VoxelType::U16, VoxelType::I16] {
        for (dims, brick_size, levels) in [([71, 45, 67], 16, 4), ([33, 1, 2], 8, 4), ([5, 140, 7], 32, 4)] {
            let dir = tempfile::tempdir().unwrap();
            let volume = noisy(dims, voxel_type);
            let store = prepared(&volume, dir.path(), &bricks(brick_size), &[]);
            assert_eq!(store.level_count(), levels, "{dims:?}");
            check(&store, &whole(&volume));
        }
    }
}

/// Planes in tiles of single shards: the definition, not only what whole planes make.
#[test]
fn levels_of_several_tiles_are_those_of_the_definition() {
    let dir = tempfile::tempdir().unwrap();
    let volume = noisy([530, 260, 21], VoxelType::I16);
    let mut source = volume.source();
    source.seekable = true;
    let options = PrepareOptions { tile_voxels: 1, ..bricks(64) };
    prepare(&mut source, &dir.path().join("s"), &options, &mut |_| {}).unwrap();
    let store = Store::open(&dir.path().join("s")).unwrap();
    for (level, of_level) in (0u8..).zip(levels_of(&store)) {
        let codes = codes_of(of_level);
        let m = store.manifest();
        for (code, under) in codes.iter().zip(under(volume.dims, level)) {
            let mean = mean(under.iter().map(|place| volume.values[*place] as i64));
            assert_eq!(*code, m.code_of_value(m.value_of_stored(mean as i32)), "level {level}");
        }
    }
}

/// Of what is mapped to 16 bits, the stored numbers count.
#[test]
fn levels_of_mapped_voxels_are_means_of_stored_numbers() {
    let dir = tempfile::tempdir().unwrap();
    let store = prepared(&noisy([45, 20, 33], VoxelType::F32), dir.path(), &bricks(16), &[]);
    // Mapped over all of the range: codes are the stored numbers.
    let finest: Vec<_> = codes_of(&store).into_iter().map(|code| Some(i64::from(code))).collect();
    assert_eq!(store.level_count(), 3);
    check(&store, &finest);
    let level = store.level(2).unwrap().manifest();
    assert!(!level.lossless);
    let said = |m: &Manifest| (m.range, m.min, m.max, m.mean, m.otsu, m.quantiles, m.noise);
    assert_eq!(said(level), said(store.manifest()));
    assert!(!store.manifest().notes.is_empty() && level.notes.is_empty());
    assert_eq!(level.histogram.iter().sum::<u64>(), level.geometry.voxel_count());
}

/// Fill values in the midst of the data, whose mean would often be a fill value.
#[test]
fn what_holds_no_data_counts_in_no_mean_and_no_mean_passes_for_it() {
    let fill = 3.0;
    let is_hole = |[x, y, z]: [u32; 3]| (8..14).contains(&x) && y >= 8 || (x * 7 + y * 13 + z * 29).is_multiple_of(11);
    for voxel_type in [VoxelType::U8, VoxelType::I16] {
        let volume = Volume::new([43, 24, 33], voxel_type, |p| {
            let value = f64::from(noise(p.map(|v| v + 50)) % 7);
            if is_hole(p) || value == fill { fill } else { value }
        });
        let dir = tempfile::tempdir().unwrap();
        let store = prepared(&volume, dir.path(), &bricks(8), &[fill]);
        let stored: Vec<_> = volume.values.iter().map(|v| (*v != fill).then_some(*v as i64)).collect();
        let (mut holes, mut moved) = (0, 0);
        let m = store.manifest();
        for (level, of_level) in (1u8..).zip(levels_of(&store).skip(1)) {
            for (code, under) in codes_of(of_level).into_iter().zip(under(volume.dims, level)) {
                let data = under.iter().filter_map(|place| stored[*place]);
                if data.clone().count() == 0 {
                    holes += 1;
                    assert_eq!(code, NO_DATA_CODE);
                    continue;
                }
                // The next larger number where the mean would be that of no data.
                let mean = mean(data);
                moved += u32::from(mean == fill as i64);
                let mean = if mean == fill as i64 { mean + 1 } else { mean };
                assert_eq!(code, m.code_of_value(f64::from(mean as i32)), "level {level}");
            }
            let said = of_level.manifest().no_data.as_ref().unwrap();
            assert_eq!((said.stored, &said.fill), (fill as i32, &vec![fill]));
        }
        assert!(holes > 10 && moved > 10, "{holes} holes, {moved} means");
        // Level 3 has data everywhere: it has the codes of a store with voxels without, and none of them.
        assert_eq!(store.level(3).unwrap().manifest().no_data.as_ref().unwrap().voxels, 0);
        assert_eq!(store.level(3).unwrap().manifest().range, m.range);
    }
}

/// What decides whether a brick shows anything must not lose a pore, however coarse the level.
#[test]
fn a_single_bright_voxel_is_in_the_ranges_of_every_level() {
    for at in [[0, 0, 0], [63, 32, 17], [99, 49, 69]] {
        let volume = Volume::new([100, 50, 70], VoxelType::U16, |p| if p == at { 60_000.0 } else { 100.0 });
        let dir = tempfile::tempdir().unwrap();
        let store = prepared(&volume, dir.path(), &bricks(16), &[]);
        assert_eq!(store.level_count(), 4);
        let shows = |[_, high]: [u16; 2]| high == u16::MAX;
        for (level, of_level) in (0u8..).zip(levels_of(&store)) {
            let grid = of_level.manifest().grid;
            let owner = grid.bricks().position(|brick| {
                let owned = grid.owned_box(brick);
                let p = UVec3::from(at) >> u32::from(level);
                p.cmpge(owned.lo).all() && p.cmplt(owned.hi).all()
            });
            assert_eq!(of_level.brick_ranges().0[owner.unwrap()][1], u16::MAX, "level {level}");
            let shown = of_level.cell_ranges().unwrap().box_of(shows).unwrap();
            let (lo, hi) = (shown.lo << u32::from(level), shown.hi << u32::from(level));
            assert!(UVec3::from(at).cmpge(lo).all() && UVec3::from(at).cmplt(hi).all(), "level {level}");
        }
        let coarsest = codes_of(store.level(3).unwrap());
        assert!(coarsest.iter().all(|code| *code < 5000), "its mean is nearly that of its neighbours");
    }
}

/// Windows on each level of its own voxels: `regions.rs` checks them; here, labels of a file.
#[test]
fn given_labels_are_the_most_frequent_of_the_finest() {
    let dims = [37, 20, 29];
    let is_hole = |[x, y, z]: [u32; 3]| z > 24 || [x, y, z].iter().all(|n| n.is_multiple_of(13));
    let volume = Volume::new(dims, VoxelType::U16, |p| if is_hole(p) { 0.0 } else { f64::from(noise(p) % 100 + 1) });
    let labels = Volume::new(dims, VoxelType::U16, |[x, _, z]| f64::from((x / 10 + z / 9) % 4 * 9));
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("l_37x20x29_uint16.raw");
    let bytes: Vec<u8> = labels.values.iter().flat_map(|v| (*v as u16).to_le_bytes()).collect();
    fs::write(&file, bytes).unwrap();
    let segmentation = Segmentation::Labels { path: file, hints: RawHints::default(), opener: Opener::default() };
    let regions = Some(RegionOptions { segmentation, min_region: 0 });
    let store = prepared(&volume, dir.path(), &PrepareOptions { regions, ..bricks(8) }, &[0.0]);
    assert_eq!(store.level_count(), 4);
    let hole: Vec<bool> = volume.values.iter().map(|v| *v == 0.0).collect();
    let mut met = 0;
    for (level, of_level) in (0u8..).zip(levels_of(&store)) {
        let grid = of_level.manifest().grid;
        let wanted: Vec<u32> = under(dims, level)
            .map(|under| {
                let mut here: Vec<u32> =
                    under.iter().filter(|p| !hole[**p]).map(|p| labels.values[*p] as u32).collect();
                here.sort_unstable();
                // The longest run; the first of equals.
                let runs = here.chunk_by(|a, b| a == b);
                runs.max_by_key(|run| (run.len(), Reverse(run[0]))).map_or(0, |run| run[0])
            })
            .collect();
        let n = grid.volume_dims();
        // Regions are numbered anew, and those without a leap voxel are left out.
        let mut numbers = HashMap::new();
        for brick in grid.bricks() {
            let read = of_level.read_brick_regions(brick, 0, &ChunkCache::new(1 << 20)).unwrap();
            let (lo, d) = (read.covered.lo.as_uvec3(), read.covered.dims());
            for (i, label) in (0u32..).zip(read.labels) {
                let p = lo + UVec3::new(i % d.x, i / d.x % d.y, i / d.x / d.y);
                let want = wanted[(p.x + n.x * (p.y + n.y * p.z)) as usize];
                let number = *numbers.entry(want).or_insert(label);
                assert_eq!(label, number, "label {want} at {p} of level {level}");
                met += u32::from(label > 0);
            }
        }
        assert_eq!(of_level.manifest().regions.as_ref().unwrap().method.name(), "labels");
    }
    assert!(met > 1000, "{met}");
}

#[test]
fn as_many_levels_as_asked_for_and_none_beyond_one_brick() {
    let volume = noisy([100, 30, 60], VoxelType::U8);
    let count = |levels| {
        let dir = tempfile::tempdir().unwrap();
        let store = prepared(&volume, dir.path(), &PrepareOptions { levels, ..bricks(16) }, &[]);
        let dims = store.manifest().levels.iter().map(|entry| entry.dims.to_array()).collect::<Vec<_>>();
        assert_eq!(dims.len(), usize::from(store.level_count()) - 1);
        assert!(store.level(store.level_count()).is_none() && store.level(u8::MAX).is_none());
        assert!(levels_of(&store).skip(1).all(|level| level.level_count() == 1 && level.level(1).is_none()));
        dims
    };
    let all = [[50, 15, 30], [25, 8, 15], [13, 4, 8]];
    assert_eq!(count(Levels::Auto), all);
    assert_eq!(count(Levels::AtMost(200)), all);
    assert_eq!(count(Levels::AtMost(2)), all[..2]);
    assert_eq!(count(Levels::AtMost(0)), [[0; 3]; 0]);
}

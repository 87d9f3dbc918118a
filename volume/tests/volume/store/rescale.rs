//! Inputs whose numbers mean other values.

use brickcast_volume::format::{Rescale, VoxelType};
use brickcast_volume::store::{ChunkCache, Manifest, PrepareOptions, PrepareSummary, Store, prepare, survey};

use super::support::{Volume, noisy};

/// From a volume with values `slope * number + intercept`, and nothing else.
fn prepared(volume: &Volume, rescale: Rescale, range: Option<(f64, f64)>) -> (PrepareSummary, Vec<u16>) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let mut source = volume.source();
    source.header.rescale = rescale;
    let options = PrepareOptions { brick_size: 16, range, ..PrepareOptions::default() };
    let summary = prepare(&mut source, &path, &options, &mut |_| {}).unwrap();
    let store = Store::open(&path).unwrap();
    assert_eq!(*store.manifest(), summary.manifest);
    if range.is_none() {
        let mut source = volume.source();
        source.header.rescale = rescale;
        let told = survey(&mut source, &mut |_| {}).unwrap();
        let of = |m: &Manifest| (m.range, m.mean, m.scale, m.offset);
        assert_eq!(of(&told), of(&summary.manifest));
    }
    let cache = ChunkCache::new(1 << 24);
    let bricks = store.manifest().grid.bricks();
    (summary, bricks.flat_map(|brick| store.read_brick(brick, 1, &cache).unwrap().codes).collect())
}

/// The codes are those of the numbers, since both ends of the range are mapped; what the manifest says in values is
/// mapped.
#[test]
fn a_mapped_input_has_the_codes_of_its_numbers_and_says_its_values() {
    let rescale = Rescale::new(0.25, -1024.0).unwrap();
    for voxel_type in [VoxelType::U8, VoxelType::I16, VoxelType::U16, VoxelType::I32, VoxelType::F32] {
        let volume = noisy([40, 20, 20], voxel_type);
        for range in [None, Some((3.0, 100.0))] {
            let (plain, codes) = prepared(&volume, Rescale::IDENTITY, range);
            let mapped_range = range.map(|(lo, hi)| (rescale.value(lo), rescale.value(hi)));
            let (mapped, mapped_codes) = prepared(&volume, rescale, mapped_range);
            assert_eq!(codes, mapped_codes, "{voxel_type}");
            let (plain, mapped) = (plain.manifest, mapped.manifest);
            let near = |number: f64, value: f64| {
                let want = rescale.value(number);
                assert!((want - value).abs() <= 1e-12 * want.abs().max(1024.0), "{voxel_type}: {value}, not {want}");
            };
            near(plain.min, mapped.min);
            near(plain.max, mapped.max);
            near(plain.range.0, mapped.range.0);
            near(plain.range.1, mapped.range.1);
            near(plain.otsu, mapped.otsu);
            near(plain.mean, mapped.mean);
            plain.quantiles.iter().zip(mapped.quantiles).for_each(|(number, value)| near(*number, value));
            for stored in [-7, 0, 100] {
                near(plain.value_of_stored(stored), mapped.value_of_stored(stored));
            }
            assert_eq!(plain.histogram, mapped.histogram);
            // Stored as they are, voxels survive; whole numbers of more bits would, but are mapped twice.
            assert_eq!(mapped.lossless, voxel_type.is_lossless(), "{voxel_type}");
        }
    }
}

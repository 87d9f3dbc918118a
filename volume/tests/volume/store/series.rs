//! Series of stores: one map for all steps, whole or not at all, and damage by its step.

use std::fs;
use std::path::Path;

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{
    FaultKind, PrepareOptions, Series, SeriesSummary, SeriesWriter, Store, StoreError, check_alike, inspect_series,
    prepare, remove_store, stored_bytes,
};

use super::support::Volume;

const DIMS: [u32; 3] = [37, 21, 18];

/// Values that rise from step to step.
fn step(voxel_type: VoxelType, step: u32) -> Volume {
    Volume::new(DIMS, voxel_type, |[x, y, z]| f64::from(x + 3 * y + 5 * z) * 0.37 + f64::from(step) * 10.5 - 4.0)
}

fn options() -> PrepareOptions {
    PrepareOptions { brick_size: 16, ..PrepareOptions::default() }
}

fn make(out: &Path, volumes: &[Volume], options: &PrepareOptions) -> Result<SeriesSummary, StoreError> {
    let mut writer = SeriesWriter::create(out, options, &[])?;
    for volume in volumes {
        writer.look_at(&mut volume.source(), &mut |_| {})?;
    }
    for (i, volume) in volumes.iter().enumerate() {
        writer.add(&mut volume.source(), (Some(format!("t{i}.nrrd")), None), &mut |_| {})?;
    }
    writer.finish(&[0.0, 0.5, 2.0][..volumes.len()], Some("second".to_owned()))
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn faults(series: &Path) -> Vec<(FaultKind, String)> {
    let objects = std::sync::Arc::new(brickcast_volume::store::StoreFolder::free(series));
    let found = inspect_series(objects, Some(series), &mut |_| {}).unwrap();
    found.faults.into_iter().map(|fault| (fault.kind, fault.file)).collect()
}

/// Without it a value would have another colour from step to step.
#[test]
fn all_steps_have_one_map_of_values_whatever_their_own_are() {
    let dir = tempfile::tempdir().unwrap();
    for voxel_type in [VoxelType::F32, VoxelType::U16, VoxelType::I64, VoxelType::I8] {
        let out = dir.path().join(voxel_type.name());
        let volumes: Vec<_> = (0..3).map(|i| step(voxel_type, i)).collect();
        let made = make(&out, &volumes, &options()).unwrap();
        let series = Series::find_in(&out).unwrap().unwrap();
        assert_eq!((series.hash(), series.manifest()), (made.hash, &made.manifest));
        let stores: Vec<Store> = (0..3).map(|i| series.open_step(i).unwrap()).collect();
        let all = |of: fn(f64, f64) -> f64| volumes.iter().flat_map(|v| v.values.iter().copied()).reduce(of).unwrap();
        let (lo, hi) = (all(f64::min), all(f64::max));
        let of_all = &series.manifest().statistics;
        assert_eq!((of_all.min, of_all.max), (lo, hi), "{voxel_type:?}");
        for (i, store) in stores.iter().enumerate() {
            let m = store.manifest();
            assert_eq!(m.data_range, (lo, hi), "{voxel_type:?}, step {i}");
            assert_eq!(m.value_map(), stores[0].manifest().value_map(), "{voxel_type:?}, step {i}");
            check_alike(i, m, stores[0].manifest()).unwrap();
            assert_eq!(m.source.name.as_deref(), Some(&*format!("t{i}.nrrd")));
            // What a look is chosen by is said of all.
            let looked_at = of_all.in_place_of(m);
            assert_eq!((looked_at.otsu, looked_at.files), (of_all.otsu, m.files));
            assert_eq!(series.step_of(store.hash()), Some(i));
        }
        let mean = volumes.iter().flat_map(|v| &v.values).sum::<f64>()
            / (3 * stores[0].manifest().geometry.voxel_count()) as f64;
        assert!((of_all.mean - mean).abs() < (hi - lo) * 1e-4, "{} for {mean}", of_all.mean);
        let counted: u64 = stores.iter().flat_map(|s| &s.manifest().histogram).sum();
        assert_eq!(of_all.histogram.iter().sum::<u64>(), counted);
        assert_eq!(
            series.manifest().steps.iter().map(|s| s.time).collect::<Vec<_>>(),
            [Some(0.0), Some(0.5), Some(2.0)]
        );
        assert_eq!(faults(&out), []);
    }
    // A store alone has a map of its own: the series is what keeps them together.
    let alone = dir.path().join("alone");
    let manifest = step(VoxelType::F32, 1).prepare(&alone, &options()).unwrap().manifest;
    let first = Series::find_in(&dir.path().join(VoxelType::F32.name())).unwrap().unwrap().open_step(0).unwrap();
    let error = check_alike(1, &manifest, first.manifest()).unwrap_err().to_string();
    assert!(error.contains("step 1 has another map of values"), "{error}");
}

#[test]
fn a_step_that_differs_is_refused_by_name_and_nothing_is_left() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s");
    let good = || step(VoxelType::U16, 0);
    let differs = |other: Volume, word: &str| {
        let error = make(&out, &[good(), other], &options()).unwrap_err().to_string();
        assert!(error.contains("step 1") && error.contains(word), "{error}");
        assert_eq!(names(dir.path()), Vec::<String>::new());
    };
    differs(Volume::new([37, 21, 19], VoxelType::U16, |_| 1.0), "dims than the first: [37, 21, 19], not [37, 21, 18]");
    differs(step(VoxelType::U8, 0), "voxel type");
    let mut writer = SeriesWriter::create(&out, &options(), &[]).unwrap();
    writer.look_at(&mut good().source(), &mut |_| {}).unwrap();
    writer.look_at(&mut good().source(), &mut |_| {}).unwrap();
    writer.add(&mut good().source(), (None, None), &mut |_| {}).unwrap();
    assert_eq!(names(dir.path()).len(), 1, "the working directory alone");
    drop(writer);
    assert_eq!(names(dir.path()), Vec::<String>::new());
    let mut writer = SeriesWriter::create(&out, &options(), &[]).unwrap();
    writer.look_at(&mut good().source(), &mut |_| {}).unwrap();
    writer.add(&mut good().source(), (None, None), &mut |_| {}).unwrap();
    let error = writer.finish(&[1.0, 1.0], None).unwrap_err().to_string();
    assert!(error.contains("2 times for 1 steps"), "{error}");
    let error = make(&out, &[], &options()).unwrap_err().to_string();
    assert!(error.contains("no steps"), "{error}");
    assert_eq!(names(dir.path()), Vec::<String>::new());
}

#[test]
fn force_replaces_a_series_or_a_store_and_nothing_that_neither_has() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s");
    let volumes = || vec![step(VoxelType::U8, 0), step(VoxelType::U8, 1)];
    let force = PrepareOptions { force: true, ..options() };
    make(&out, &volumes(), &options()).unwrap();
    assert!(matches!(make(&out, &volumes(), &options()), Err(StoreError::Exists { .. })));
    for foreign in ["notes.txt", "1/notes.txt", "OME/METADATA.ome.xml"] {
        fs::write(out.join(foreign), b"mine").unwrap();
        let error = make(&out, &volumes(), &force).unwrap_err();
        assert!(matches!(&error, StoreError::Foreign { what, .. } if what == foreign), "{error}");
        assert_eq!(faults(&out), [(FaultKind::Foreign, foreign.to_owned())]);
        fs::remove_file(out.join(foreign)).unwrap();
    }
    // A step more than there are is not its own.
    fs::create_dir(out.join("2")).unwrap();
    assert!(matches!(make(&out, &volumes(), &force), Err(StoreError::Foreign { .. })));
    fs::remove_dir(out.join("2")).unwrap();
    let made = make(&out, &volumes()[..1], &force).unwrap();
    assert_eq!(names(&out), ["0", "OME", "brickcast-series.json", "zarr.json"]);
    assert_eq!(stored_bytes(&out), made.store_bytes);
    // A store in place of the series, and the other way.
    prepare(&mut step(VoxelType::U8, 0).source(), &out, &force, &mut |_| {}).unwrap();
    assert!(Series::find_in(&out).unwrap().is_none() && Store::open(&out).is_ok());
    make(&out, &volumes(), &force).unwrap();
    assert!(matches!(Store::open(&out), Err(StoreError::NotAStore { .. })));
    assert_eq!(remove_store(&out).unwrap(), made_bytes(&volumes()));
    assert_eq!(names(dir.path()), Vec::<String>::new());
}

fn made_bytes(volumes: &[Volume]) -> u64 {
    let dir = tempfile::tempdir().unwrap();
    make(&dir.path().join("again"), volumes, &options()).unwrap().store_bytes
}

#[cfg(unix)]
#[test]
fn what_a_killed_writer_left_goes_with_the_next_one() {
    let dir = tempfile::tempdir().unwrap();
    let mut gone = std::process::Command::new("true").spawn().unwrap();
    gone.wait().unwrap();
    let dead = dir.path().join(format!(".s.brickcast-tmp-{}-0", gone.id()));
    for folder in ["store/0/0/c/0/0", "store/11/levels/1", "store/OME"] {
        fs::create_dir_all(dead.join(folder)).unwrap();
    }
    for file in ["lock", "halos.bin", "store/0/0/c/0/0/0", "store/11/levels/1/halos.bin", "store/OME/zarr.json"] {
        fs::write(dead.join(file), b"half").unwrap();
    }
    make(&dir.path().join("s"), &[step(VoxelType::U8, 0)], &options()).unwrap();
    assert_eq!(names(dir.path()), ["s"]);
}

#[test]
fn damage_is_named_by_its_step() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s");
    let volumes: Vec<_> = (0..3).map(|i| step(VoxelType::U16, i)).collect();
    make(&out, &volumes, &options()).unwrap();
    let shard = out.join("1/0/c/0/0/0");
    let bytes = fs::read(&shard).unwrap();
    let mut bad = bytes.clone();
    bad[100] ^= 1;
    fs::write(&shard, bad).unwrap();
    assert_eq!(faults(&out), [(FaultKind::Broken, "1/0/c/0/0/0".to_owned())]);
    fs::remove_file(&shard).unwrap();
    assert_eq!(faults(&out), [(FaultKind::Missing, "1/0/c/0/0/0".to_owned())]);
    let series = Series::find_in(&out).unwrap().unwrap();
    let store = series.open_step(1).unwrap();
    assert!(matches!(store.lacking(), Some((0, StoreError::ShardMissing { .. }))));
    series.open_step(0).unwrap();
    fs::write(&shard, &bytes).unwrap();
    // Another whole store in a step's place.
    fs::rename(out.join("1"), dir.path().join("1")).unwrap();
    assert_eq!(faults(&out), [(FaultKind::Missing, "1/brickcast.json".to_owned())]);
    step(VoxelType::U16, 1).prepare(&out.join("1"), &options()).unwrap();
    let error = series.open_step(1).unwrap_err().to_string();
    assert!(error.starts_with("step 1 is the store"), "{error}");
    let found = faults(&out);
    assert_eq!(
        found,
        [(FaultKind::Broken, "1/brickcast.json".to_owned()), (FaultKind::Broken, "1/brickcast.json".to_owned())]
    );
    fs::remove_dir_all(out.join("1")).unwrap();
    fs::rename(dir.path().join("1"), out.join("1")).unwrap();
    assert_eq!(faults(&out), []);
    // The series' own files.
    let list = fs::read(out.join("OME/zarr.json")).unwrap();
    fs::write(out.join("OME/zarr.json"), b"{}").unwrap();
    assert_eq!(faults(&out), [(FaultKind::Broken, "OME/zarr.json".to_owned())]);
    assert!(Series::find_in(&out).is_err());
    fs::write(out.join("OME/zarr.json"), list).unwrap();
    fs::write(out.join("brickcast-series.json"), b"{ \"format\": \"brickcast-series\", \"version\": 9 }").unwrap();
    assert_eq!(faults(&out), [(FaultKind::Broken, "brickcast-series.json".to_owned())]);
    let error = Series::find_in(&out).unwrap_err().to_string();
    assert!(error.contains("brickcast-series.json: format version 9"), "{error}");
}

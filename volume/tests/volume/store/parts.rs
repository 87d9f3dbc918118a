//! Stores prepared in parts: the bytes that one go makes, or a refusal that names what is wrong.

use std::fs;
use std::path::{Path, PathBuf};

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{
    Journal, PartFault, PartNumber, PartsError, PrepareOptions, PrepareSummary, Store, StoreError, merge_parts,
    parts_folder, prepare, prepare_part, resume, scan_part,
};

use super::regions::windows;
use super::support::{MemorySource, Volume, files_of, noisy};

fn bricks(brick_size: u32) -> PrepareOptions {
    PrepareOptions { brick_size, ..PrepareOptions::default() }
}

/// Every file, with its content.
fn content(store: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let relative = |file: &Path| file.strip_prefix(store).unwrap().to_path_buf();
    files_of(store).into_iter().map(|file| (relative(&file), fs::read(&file).unwrap())).collect()
}

fn check_same(got: &Path, want: &[(PathBuf, Vec<u8>)], what: &str) {
    let got = content(got);
    let names = |of: &[(PathBuf, Vec<u8>)]| of.iter().map(|file| file.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&got), names(want), "{what}");
    for (got, want) in got.iter().zip(want) {
        assert!(got == want, "{what}: {} differs", got.0.display());
    }
}

struct Scan<'a> {
    volume: &'a Volume,
    fill: &'a [f64],
    seekable: bool,
}

impl Scan<'_> {
    fn source(&self) -> MemorySource {
        let mut source = self.volume.source();
        (source.header.no_data, source.seekable) = (self.fill.to_vec(), self.seekable);
        source
    }

    fn part(&self, out: &Path, options: &PrepareOptions, part: &str) -> Result<bool, StoreError> {
        let part = part.parse().unwrap();
        prepare_part(&mut self.source(), out, options, part, &mut |_| {}).map(|made| made.was_there)
    }

    fn scan(&self, out: &Path, options: &PrepareOptions, part: PartNumber) -> Option<bool> {
        scan_part(&mut self.source(), out, options, part, &mut |_| {}).unwrap().map(|made| made.was_there)
    }

    fn merge(&self, out: &Path, options: &PrepareOptions) -> Result<PrepareSummary, StoreError> {
        merge_parts(&self.source(), out, options, &mut |_| {})
    }

    fn resume(&self, out: &Path, options: &PrepareOptions) -> Result<Journal, StoreError> {
        let mut found = None;
        resume(&mut self.source(), out, options, &mut |journal| found = Some(journal.clone()), &mut |_| {})?;
        Ok(found.unwrap())
    }
}

fn refusal(result: Result<impl std::fmt::Debug, StoreError>) -> PartsError {
    match result {
        Err(StoreError::Parts(error)) => error,
        other => panic!("{other:?}"),
    }
}

/// In one go, in parts of every division, and by going on with nothing.
fn check_filled(volume: &Volume, options: &PrepareOptions, fill: &[f64]) {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("parts");
    let layers = volume.dims[2].div_ceil(options.brick_size.max(256));
    let whole = dir.path().join("whole");
    let scan = Scan { volume, fill, seekable: true };
    let summary = prepare(&mut scan.source(), &whole, options, &mut |_| {}).unwrap();
    let want = content(&whole);
    let counts = (1..=layers).filter(|count| layers < 5 || [1, 3, layers].contains(count));
    for (count, seekable) in counts.flat_map(|count| [(count, true), (count, false)]) {
        let what = format!("{:?} {} {options:?} in {count} parts, {seekable}", volume.dims, volume.voxel_type);
        let scan = Scan { seekable, ..scan };
        let parts = || (0..count).rev().map(|index| PartNumber::new(index, count).unwrap());
        for part in parts() {
            let scanned = scan.scan(&out, options, part);
            assert_eq!(scanned, (!volume.voxel_type.is_lossless()).then_some(false), "{what}");
        }
        for part in parts() {
            assert!(!scan.part(&out, options, &part.to_string()).unwrap(), "{what}");
            assert!(scan.part(&out, options, &part.to_string()).unwrap(), "{what}: again");
        }
        let got = scan.merge(&out, options).unwrap();
        assert_eq!((got.hash, got.store_bytes), (summary.hash, summary.store_bytes), "{what}");
        check_same(&out, &want, &what);
        fs::remove_dir_all(&out).unwrap();
        assert!(!parts_folder(&out).exists(), "{what}");
    }
    for seekable in [true, false] {
        let found = Scan { seekable, ..scan }.resume(&out, options).unwrap();
        assert_eq!(found, Journal { found: 0, count: layers });
        check_same(&out, &want, "resumed");
        Store::open(&out).unwrap().verify(&mut |_| {}).unwrap();
        fs::remove_dir_all(&out).unwrap();
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "nothing is left");
}

fn check(volume: &Volume, options: &PrepareOptions) {
    check_filled(volume, options, &[]);
}

/// Halos, ranges and cubes of noise reach over the faces of parts; the last part is of another size.
#[test]
fn parts_make_the_store_that_one_go_makes() {
    check(&noisy([40, 30, 600], VoxelType::U16), &bricks(64));
    check(&noisy([33, 20, 513], VoxelType::I8), &bricks(8));
    check(&noisy([17, 9, 100], VoxelType::I16), &bricks(16));
    check(&noisy([20, 21, 1030], VoxelType::U8), &bricks(512));
}

/// A voxel of levels 9 and 10 lies above several parts.
#[test]
fn the_coarsest_levels_of_parts_are_joined() {
    check(&noisy([5, 3, 4200], VoxelType::U16), &bricks(8));
}

#[test]
fn voxels_without_data_in_some_parts_only_are_counted_as_in_one_go() {
    let hole = |[_, _, z]: [u32; 3]| if z > 250 { -7.0 } else { f64::from(z % 200) };
    check_filled(&Volume::new([20, 12, 700], VoxelType::I16, hole), &bricks(32), &[-7.0, -8.0]);
}

/// The bounds of all parts map the voxels of each; one holds nothing but NaN.
#[test]
fn mapped_voxels_are_those_of_one_go() {
    check(&noisy([20, 30, 520], VoxelType::F32), &bricks(64));
    check(&noisy([20, 30, 300], VoxelType::I64), &bricks(64));
    let nan = |[x, y, z]: [u32; 3]| if z >= 512 { f64::NAN } else { f64::from(x * y) + f64::from(z) * 0.1 };
    check(&Volume::new([20, 12, 530], VoxelType::F64, nan), &bricks(32));
}

#[test]
fn parts_in_tiles_are_those_of_whole_planes() {
    let options = PrepareOptions { tile_voxels: 1, ..bricks(64) };
    check(&noisy([300, 20, 520], VoxelType::U8), &options);
    check(&noisy([300, 20, 270], VoxelType::F32), &options);
}

#[test]
fn regions_of_parts_are_those_of_one_go() {
    let blocks = |[x, y, z]: [u32; 3]| if (x / 30 + y / 20 + z / 100) % 2 == 0 { 500.0 } else { 60_000.0 };
    check(&Volume::new([70, 50, 600], VoxelType::U16, blocks), &windows(64, 0.03));
}

#[test]
fn parts_that_do_not_belong_together_are_named_and_not_joined() {
    let volume = noisy([20, 12, 700], VoxelType::U16);
    let dir = tempfile::tempdir().unwrap();
    let (out, options) = (dir.path().join("s"), bricks(32));
    let scan = Scan { volume: &volume, fill: &[], seekable: true };
    assert!(matches!(refusal(scan.merge(&out, &options)), PartsError::None { .. }));
    let error = refusal(scan.part(&out, &options, "0/4"));
    assert!(matches!(error, PartsError::TooMany { count: 4, layers: 3, planes: 256 }), "{error}");
    scan.part(&out, &options, "1/3").unwrap();
    let error = refusal(scan.merge(&out, &options));
    assert!(matches!(&error, PartsError::Missing { missing, .. } if missing == "0, 2"), "{error}");
    // Of another division, before it and with it.
    let error = refusal(scan.part(&out, &options, "0/2"));
    assert!(error.to_string().contains("into 3, not 2"), "{error}");
    let folder = parts_folder(&out);
    for name in ["0-of-3", "2-of-3", "0-of-2"] {
        fs::create_dir_all(folder.join(name)).unwrap();
        fs::create_dir(folder.join(name).join("part")).unwrap();
        for file in files_of(&folder.join("1-of-3/part")) {
            let to = folder.join(name).join(file.strip_prefix(folder.join("1-of-3")).unwrap());
            fs::create_dir_all(to.parent().unwrap()).unwrap();
            fs::copy(file, to).unwrap();
        }
    }
    let error = refusal(scan.merge(&out, &options));
    assert!(matches!(&error, PartsError::Divisions { divisions, .. } if divisions == "into 2, 3"), "{error}");
    fs::remove_dir_all(folder.join("0-of-2")).unwrap();
    // A copy in another's place.
    let error = refusal(scan.merge(&out, &options)).to_string();
    assert!(error.contains("part 0/3 is damaged") && error.contains("says that it is part 1/3"), "{error}");
    for part in ["0/3", "2/3"] {
        assert!(!scan.part(&out, &options, part).unwrap(), "{part}");
    }
    // Other options, another volume.
    let other = noisy([20, 12, 700], VoxelType::I16);
    let others = Scan { volume: &other, ..scan };
    let error = refusal(scan.merge(&out, &bricks(64))).to_string();
    assert!(error.contains("the edge of bricks was 32, and is 64 here"), "{error}");
    for result in [others.merge(&out, &options).map(drop), others.part(&out, &options, "0/3").map(drop)] {
        let error = refusal(result).to_string();
        assert!(error.contains("the type of voxels was uint16, and is int16 here"), "{error}");
    }
    let error = refusal(others.resume(&out, &options)).to_string();
    assert!(error.contains("the type of voxels was uint16"), "{error}");
    assert!(!out.exists());
    // Allowed to replace them.
    let force = PrepareOptions { force: true, ..options.clone() };
    assert!(!others.part(&out, &force, "0/3").unwrap());
    assert!(others.part(&out, &force, "0/3").unwrap());
    let error = refusal(scan.merge(&out, &options)).to_string();
    assert!(error.contains("part 0/3") && error.contains("was int16, and is uint16 here"), "{error}");
    assert_eq!(others.resume(&out, &force).unwrap(), Journal { found: 1, count: 3 });
    let whole = dir.path().join("whole");
    prepare(&mut others.source(), &whole, &options, &mut |_| {}).unwrap();
    check_same(&out, &content(&whole), "replaced");
}

#[test]
fn parts_are_not_made_before_all_were_scanned() {
    let volume = noisy([20, 12, 300], VoxelType::F32);
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("s");
    let scan = Scan { volume: &volume, fill: &[], seekable: true };
    assert_eq!(scan.scan(&out, &bricks(32), "1/2".parse().unwrap()), Some(false));
    assert_eq!(scan.scan(&out, &bricks(32), "1/2".parse().unwrap()), Some(true));
    let error = refusal(scan.part(&out, &bricks(32), "1/2"));
    assert!(matches!(&error, PartsError::NotScanned { missing, .. } if missing == "0"), "{error}");
}

/// Every file of a part, cut, gone, or with a bit that flipped: never joined, and made again by whoever goes on.
#[test]
fn damaged_parts_are_named_and_made_again() {
    let volume = noisy([20, 12, 520], VoxelType::U16);
    let dir = tempfile::tempdir().unwrap();
    let (out, whole, options) = (dir.path().join("s"), dir.path().join("whole"), bricks(32));
    let scan = Scan { volume: &volume, fill: &[], seekable: true };
    prepare(&mut scan.source(), &whole, &options, &mut |_| {}).unwrap();
    let want = content(&whole);
    let all = ["0/3", "1/3", "2/3"];
    all.iter().for_each(|part| assert!(scan.part(&out, &options, part).is_ok()));
    let files = files_of(&parts_folder(&out).join("1-of-3/part"));
    assert!(files.len() >= 10, "{files:?}");
    for (i, file) in files.iter().enumerate() {
        let good = fs::read(file).unwrap();
        let mut flipped = good.clone();
        flipped[good.len() * (i % 3 + 1) / 4] ^= 1 << (i % 8);
        for bad in [Some(flipped), Some(good[..good.len() - 1].to_vec()), None] {
            match &bad {
                Some(bad) => fs::write(file, bad).unwrap(),
                None => fs::remove_file(file).unwrap(),
            }
            let error = refusal(scan.merge(&out, &options));
            let PartsError::Damaged { path, fault, .. } = &error else { panic!("{error}") };
            assert!(path == file && error.to_string().contains("run --shard 1/3 again"), "{error}");
            assert_eq!(*fault == PartFault::Missing, bad.is_none(), "{error}");
            assert!(!out.exists());
            fs::write(file, &good).unwrap();
        }
        fs::write(file, &good[..good.len() / 2]).unwrap();
        match i % 2 {
            0 => assert!(!scan.part(&out, &options, "1/3").unwrap()),
            _ => {
                assert_eq!(scan.resume(&out, &options).unwrap(), Journal { found: 2, count: 3 });
                check_same(&out, &want, &file.display().to_string());
                fs::remove_dir_all(&out).unwrap();
                all.iter().for_each(|part| assert!(scan.part(&out, &options, part).is_ok()));
            }
        }
        assert_eq!(fs::read(file).unwrap(), good, "{}", file.display());
    }
    scan.merge(&out, &options).unwrap();
    check_same(&out, &want, "merged");
}

/// Killed between the renaming of the store and the removal of its parts.
#[test]
fn a_store_that_was_finished_is_not_made_again() {
    let volume = noisy([20, 12, 300], VoxelType::U16);
    let dir = tempfile::tempdir().unwrap();
    let (out, options) = (dir.path().join("s"), bricks(32));
    let scan = Scan { volume: &volume, fill: &[], seekable: true };
    scan.part(&out, &options, "0/2").unwrap();
    scan.part(&out, &options, "1/2").unwrap();
    let kept = dir.path().join("kept");
    fs::rename(parts_folder(&out), &kept).unwrap();
    scan.resume(&out, &options).unwrap();
    let want = content(&out);
    fs::rename(&kept, parts_folder(&out)).unwrap();
    assert!(matches!(scan.resume(&out, &options), Err(StoreError::Exists { .. })), "parts of whatever it was");
    fs::write(parts_folder(&out).join("joined"), Store::open(&out).unwrap().hash().to_string()).unwrap();
    assert_eq!(scan.resume(&out, &options).unwrap(), Journal { found: 0, count: 0 });
    check_same(&out, &want, "it is as it was");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "its parts are gone");
}

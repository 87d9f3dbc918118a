//! Stores in a data root whose links are changed after they were opened.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{ChunkCache, Jail, PrepareOptions, Store, StoreError};

use super::regions::windows;
use super::support::{Volume, noisy};

/// Reads every brick, with nothing decoded before.
fn read_all(store: &Store) -> Result<(), StoreError> {
    let cache = ChunkCache::new(1 << 20);
    store.manifest().grid.bricks().try_for_each(|brick| {
        store.read_brick(brick, 1, &cache)?;
        if store.region_table().is_some() {
            store.read_brick_regions(brick, 2, &cache)?;
        }
        Ok(())
    })
}

fn copy(from: &Path, to: &Path) {
    if from.is_dir() {
        fs::create_dir(to).unwrap();
        for entry in fs::read_dir(from).unwrap().map(|e| e.unwrap()) {
            copy(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        fs::copy(from, to).unwrap();
    }
}

struct Site {
    root: tempfile::TempDir,
    outside: tempfile::TempDir,
    jail: Jail,
}

impl Site {
    /// Two stores in the folder `scans`: `plain`, and `regions`.
    fn new() -> Self {
        let root = tempfile::tempdir().unwrap();
        let scans = root.path().join("scans");
        fs::create_dir(&scans).unwrap();
        let options = PrepareOptions { brick_size: 32, ..PrepareOptions::default() };
        noisy([70, 40, 40], VoxelType::U8).prepare(&scans.join("plain"), &options).unwrap();
        let halves = Volume::new([40, 40, 40], VoxelType::U16, |p| if p[0] < 20 { 1000.0 } else { 50_000.0 });
        halves.prepare(&scans.join("regions"), &windows(32, 0.02)).unwrap();
        let jail = Jail::new(root.path()).unwrap();
        Self { root, outside: tempfile::tempdir().unwrap(), jail }
    }

    fn open(&self, store: &str) -> Result<Store, StoreError> {
        Store::open_in(&self.jail.folder(&Path::new("scans").join(store)))
    }

    /// Runs `check` while `swapped` is a link to the very same content at `to`.
    fn swapped(&self, swapped: &str, to: PathBuf, check: impl FnOnce()) {
        let at = self.root.path().join("scans").join(swapped);
        let kept = self.root.path().join("kept");
        copy(&at, &to);
        fs::rename(&at, &kept).unwrap();
        symlink(&to, &at).unwrap();
        check();
        fs::remove_file(&at).unwrap();
        fs::rename(&kept, &at).unwrap();
    }
}

/// What reads need, replaced after the store was opened: the file that was wanted is named, and once it is back all is
/// well.
#[test]
fn what_becomes_a_link_that_leads_out_after_opening_is_refused_by_name() {
    let site = Site::new();
    for (n, (store, swapped, named)) in [
        ("plain", "0/c/0/0/0", "0/c/0/0/0"),
        ("plain", "0/c/0", "0/c/0/0/0"),
        ("plain", "0", "0/c/0/0/0"),
        ("plain", "", "0/c/0/0/0"),
        ("plain", "halos.bin", "halos.bin"),
        ("regions", "region_halos.bin", "region_halos.bin"),
        ("regions", "labels", "labels/regions/0/c/0/0/0"),
        ("regions", "distances/c", "distances/c/0/0/0"),
    ]
    .into_iter()
    .enumerate()
    {
        let path = if swapped.is_empty() { store.to_owned() } else { format!("{store}/{swapped}") };
        let opened = site.open(store).unwrap();
        site.swapped(&path, site.outside.path().join(n.to_string()), || {
            let error = read_all(&opened).unwrap_err();
            assert!(matches!(&error, StoreError::Outside { file } if *file == *named), "{path}: {error}");
            assert!(error.to_string().starts_with(named), "{error}");
            assert!(matches!(opened.verify(&mut |_| {}), Err(StoreError::Outside { .. })), "{path}");
            assert!(matches!(site.open(store), Err(StoreError::Outside { .. })), "{path}");
            // Whoever names the folder itself is not in the jail.
            read_all(&Store::open(&site.root.path().join("scans").join(store)).unwrap()).unwrap();
        });
        read_all(&opened).unwrap();
        site.swapped(&path, site.root.path().join(n.to_string()), || {
            read_all(&opened).unwrap();
            read_all(&site.open(store).unwrap()).unwrap();
            opened.verify(&mut |_| {}).unwrap();
        });
    }
}

/// Every file that opening a store reads.
#[test]
fn a_store_with_any_file_outside_does_not_open() {
    let site = Site::new();
    let path = site.root.path().join("scans/regions");
    for (n, file) in super::support::files_of(&path).into_iter().enumerate() {
        let named = file.strip_prefix(&path).unwrap().to_str().unwrap();
        site.swapped(&format!("regions/{named}"), site.outside.path().join(n.to_string()), || {
            let error = site.open("regions").unwrap_err();
            assert!(matches!(&error, StoreError::Outside { file } if *file == *named), "{named}: {error}");
            if named == "brickcast.json" {
                let hash = site.jail.folder(Path::new("scans/regions")).manifest_hash();
                assert!(matches!(hash, Err(StoreError::Outside { .. })), "{hash:?}");
            }
        });
    }
    read_all(&site.open("regions").unwrap()).unwrap();
}

#[test]
fn fifos_in_place_of_files_do_not_hang() {
    let site = Site::new();
    let path = site.root.path().join("scans/plain");
    for name in ["brickcast.json", "bricks.bin", "halos.bin", "0/c/0/0/0"] {
        let good = fs::read(path.join(name)).unwrap();
        fs::remove_file(path.join(name)).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(path.join(name)).status().unwrap().success());
        for opened in [site.open("plain"), Store::open(&path)] {
            // Large files are opened where they are read.
            let error = opened.and_then(|store| read_all(&store)).unwrap_err();
            let named = matches!(error, StoreError::NotAFile { .. } | StoreError::ShardMissing { .. });
            assert!(named && error.to_string().contains(name), "{error}");
        }
        fs::remove_file(path.join(name)).unwrap();
        fs::write(path.join(name), good).unwrap();
    }
    read_all(&site.open("plain").unwrap()).unwrap();
}

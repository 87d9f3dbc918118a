//! Stores whose objects are no files: the same bricks, and few reads.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex};

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{ChunkCache, MemoryObjects, Object, Objects, PrepareOptions, Store, StoreError};
use bytes::Bytes;

use super::regions::windows;
use super::support::{Volume, in_memory, noise, noisy};

/// A store with regions, in two shards.
fn with_regions(path: &Path) -> Store {
    let halves = Volume::new([270, 40, 40], VoxelType::U16, |p| match p[0] {
        0..100 => 1000.0,
        112.. => 50_000.0,
        _ => f64::from(noise(p)),
    });
    halves.prepare(path, &windows(32, 0.02)).unwrap();
    Store::open(path).unwrap()
}

#[test]
fn a_store_in_memory_has_the_bricks_of_the_one_on_the_disk() {
    let dir = tempfile::tempdir().unwrap();
    let on_disk = with_regions(&dir.path().join("s"));
    let objects = in_memory(&on_disk.path());
    let in_memory = Store::open_objects(Arc::new(objects.clone())).unwrap();
    drop(dir);
    let again = tempfile::tempdir().unwrap();
    let on_disk = with_regions(&again.path().join("s"));
    assert_eq!((in_memory.hash(), in_memory.path().to_str()), (on_disk.hash(), Some("memory")));
    in_memory.verify(&mut |_| {}).unwrap();
    let (cache, other) = (ChunkCache::new(1 << 20), ChunkCache::new(1 << 20));
    for brick in on_disk.manifest().grid.bricks() {
        for ghost in [0, 3, 7] {
            let read = |store: &Store, cache| store.read_brick(brick, ghost, cache).unwrap();
            assert_eq!(read(&in_memory, &cache), read(&on_disk, &other), "{brick}, {ghost}");
            let read = |store: &Store, cache| store.read_brick_regions(brick, ghost, cache).unwrap();
            assert_eq!(read(&in_memory, &cache), read(&on_disk, &other), "{brick}, {ghost}");
        }
    }
    assert!(matches!(Store::open_objects(Arc::new(MemoryObjects::new(Path::new("none")))),
        Err(StoreError::NotAStore { path }) if path == Path::new("none")));
    let mut missing = objects;
    missing.remove("0/c/0/0/1").unwrap();
    let store = Store::open_objects(Arc::new(missing)).unwrap();
    assert!(matches!(store.lacking(), Some((0, StoreError::ShardMissing { .. }))));
}

/// Objects that write down what is read of them.
#[derive(Debug)]
struct Told {
    objects: MemoryObjects,
    reads: Arc<Mutex<Vec<(String, usize)>>>,
}

#[derive(Debug)]
struct ToldObject {
    key: String,
    object: Arc<dyn Object>,
    reads: Arc<Mutex<Vec<(String, usize)>>>,
}

impl Objects for Told {
    fn place(&self) -> &Path {
        self.objects.place()
    }

    fn open(&self, key: &str) -> Result<Arc<dyn Object>, StoreError> {
        let object = self.objects.open(key)?;
        Ok(Arc::new(ToldObject { key: key.to_owned(), object, reads: self.reads.clone() }))
    }
}

impl Object for ToldObject {
    fn size(&self) -> Result<u64, StoreError> {
        self.object.size()
    }

    fn read(&self, ranges: &[Range<u64>]) -> Result<Vec<Bytes>, StoreError> {
        self.reads.lock().unwrap().push((self.key.clone(), ranges.len()));
        self.object.read(ranges)
    }
}

#[test]
fn a_brick_is_one_read_of_its_halo_and_one_of_each_shard() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let options = PrepareOptions { brick_size: 64, ..PrepareOptions::default() };
    noisy([270, 64, 64], VoxelType::U16).prepare(&path, &options).unwrap();
    let reads = Arc::new(Mutex::default());
    let objects = Told { objects: in_memory(&path), reads: Arc::clone(&reads) };
    let store = Store::open_objects(Arc::new(objects)).unwrap();
    let read = |at: usize, ghost| {
        reads.lock().unwrap().clear();
        let cache = ChunkCache::new(1 << 24);
        store.read_brick(store.manifest().grid.bricks().nth(at).unwrap(), ghost, &cache).unwrap();
        let mut reads = reads.lock().unwrap().clone();
        reads.sort();
        reads
    };
    let (first, second) = ("0/c/0/0/0", "0/c/0/0/1");
    let of = |reads: &[(&str, usize)]| reads.iter().map(|(key, n)| ((*key).to_owned(), *n)).collect::<Vec<_>>();
    // Once for its end, then for 64 inner chunks.
    assert_eq!(read(1, 1), of(&[(first, 1), (first, 64), ("halos.bin", 1)]));
    assert_eq!(read(2, 1), of(&[(first, 64), ("halos.bin", 1)]));
    assert_eq!(read(2, 0), of(&[(first, 64)]));
    // Farther than the halo reaches: 5 x 4 x 4 inner chunks of the own shard, 1 x 4 x 4 of the next.
    assert_eq!(read(3, 4), of(&[(first, 80), (second, 1), (second, 16)]));
}

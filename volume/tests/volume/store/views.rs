//! Views: the store that `prepare` makes of the same voxels, whose finest ones stay where they lie.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use brickcast_volume::format::VoxelType;
use brickcast_volume::store::{
    BrickVoxels, ChunkCache, FinestVoxels, PrepareOptions, Store, StoreError, StoreFolder, VIEW_FILE, ViewFile,
    ViewInput, ViewObjects, inspect_objects, prepare,
};

use super::regions::windows;
use super::support::{INDEX_BYTES, SUM_BYTES, Volume, files_of, noisy};

/// An array in memory, which somebody else may change.
#[derive(Debug, Clone)]
struct Array {
    dims: [u32; 3],
    voxel_type: VoxelType,
    bytes: Arc<Mutex<Vec<u8>>>,
}

impl FinestVoxels for Array {
    fn voxel_type(&self) -> VoxelType {
        self.voxel_type
    }

    fn dims(&self) -> [u32; 3] {
        self.dims
    }

    fn is_far(&self) -> bool {
        false
    }

    fn read_box(&self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<(), StoreError> {
        let (bytes, d, size) = (self.bytes.lock().unwrap(), self.dims, self.voxel_type.bytes());
        voxels.clear();
        for z in lo[2]..hi[2] {
            for y in lo[1]..hi[1] {
                let [from, to] = [lo[0], hi[0]].map(|x| (x + d[0] * (y + d[1] * z)) as usize * size);
                voxels.extend_from_slice(&bytes[from..to]);
            }
        }
        Ok(())
    }
}

/// A view of a volume, beside the store that it is to be.
struct Rig {
    folder: tempfile::TempDir,
    array: Array,
    store: Store,
}

impl Rig {
    fn new(volume: &Volume, options: &PrepareOptions, fill: &[f64]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut source = volume.source();
        source.header.no_data = fill.to_vec();
        let bytes = Arc::new(Mutex::new(source.bytes().to_vec()));
        let array = Array { dims: volume.dims, voxel_type: volume.voxel_type, bytes };
        let made = volume.prepare_filled(&folder.path().join("store"), options, fill).unwrap();
        let input = ViewInput { place: "the array".to_owned(), channel: Some(3), time: None };
        let options = PrepareOptions { view: Some(input), ..options.clone() };
        let view = prepare(&mut source, &folder.path().join("view"), &options, &mut |_| {}).unwrap();
        assert_eq!(view.hash, made.hash);
        let on_disk: u64 = files_of(&folder.path().join("view")).iter().map(|f| f.metadata().unwrap().len()).sum();
        assert_eq!(on_disk - folder.path().join("view").join(VIEW_FILE).metadata().unwrap().len(), view.store_bytes);
        let store = Store::open(&folder.path().join("store")).unwrap();
        Self { folder, array, store }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("view")
    }

    fn objects_of(&self, array: Array) -> Result<ViewObjects, StoreError> {
        let kept = Arc::new(StoreFolder::free(&self.path()));
        let file = ViewFile::read(kept.as_ref())?.expect("it is a view");
        assert_eq!((file.input.place.as_str(), file.input.channel), ("the array", Some(3)));
        ViewObjects::new(kept, &file, Box::new(array))
    }

    fn open(&self) -> Result<Store, StoreError> {
        Store::open_objects(Arc::new(self.objects_of(self.array.clone())?))
    }

    fn faults(&self) -> Vec<(String, String)> {
        let objects = Arc::new(self.objects_of(self.array.clone()).unwrap());
        let found = inspect_objects(objects, Some(&self.path()), &mut |_| {}).unwrap();
        found.faults.into_iter().map(|fault| (fault.file, fault.what)).collect()
    }

    fn check(&self, what: &str) {
        let view = self.open().unwrap();
        assert_eq!(view.hash(), self.store.hash(), "{what}");
        for level in 0..view.level_count() {
            let [got, want] = [&view, &self.store].map(|store| all_bricks(store.level(level).unwrap()));
            assert!(got == want, "{what}: level {level}");
        }
        view.verify(&mut |_| {}).unwrap();
        assert_eq!(self.faults(), [], "{what}");
    }
}

fn bricks(brick_size: u32) -> PrepareOptions {
    PrepareOptions { brick_size, ..PrepareOptions::default() }
}

/// With two layers of their neighbours.
fn all_bricks(store: &Store) -> Vec<BrickVoxels> {
    let cache = ChunkCache::new(1 << 20);
    store.manifest().grid.bricks().map(|brick| store.read_brick(brick, 2, &cache).unwrap()).collect()
}

#[test]
fn a_view_is_the_store_of_the_same_voxels() {
    for voxel_type in [
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
    ] {
        let volume = noisy([61, 37, 50], voxel_type);
        Rig::new(&volume, &bricks(16), &[]).check(voxel_type.name());
    }
    // Several shards, and bricks without halos.
    Rig::new(&noisy([270, 20, 258], VoxelType::U8), &bricks(8), &[]).check("shards");
}

#[test]
fn what_holds_no_data_and_what_is_beyond_the_range_is_stored_alike() {
    let holes = |[x, y, z]: [u32; 3]| if (x + y + z).is_multiple_of(7) { -9.0 } else { f64::from(x * y) - 40.0 };
    let two = |p: [u32; 3]| if p[0] == 5 { 70.0 } else { holes(p) };
    Rig::new(&Volume::new([40, 33, 20], VoxelType::I16, two), &bricks(16), &[-9.0, 70.0]).check("fill values");
    let nan = |p: [u32; 3]| if p[1] == 3 { f64::NAN } else { holes(p) / 3.0 };
    let volume = Volume::new([40, 33, 20], VoxelType::F32, nan);
    let range = PrepareOptions { range: Some((-10.0, 200.0)), ..bricks(16) };
    Rig::new(&volume, &range, &[-3.0]).check("NaN, fill and a range");
}

/// They are found in the voxels, which must be there as long as they are looked for.
#[test]
fn views_have_regions() {
    let steps = |[x, y, _]: [u32; 3]| f64::from(x / 20 + 3 * (y / 15)) * 20.0;
    let options = PrepareOptions { range: None, ..windows(16, 0.1) };
    let rig = Rig::new(&Volume::new([70, 41, 33], VoxelType::U8, steps), &options, &[]);
    assert!(rig.store.manifest().regions.is_some());
    rig.check("regions");
}

#[test]
fn an_array_that_was_changed_is_named_by_the_chunk() {
    let rig = Rig::new(&noisy([61, 37, 50], VoxelType::U16), &bricks(16), &[]);
    let view = rig.open().unwrap();
    // Voxel (40, 20, 35).
    let at = (40 + 61 * (20 + 37 * 35)) * 2;
    rig.array.bytes.lock().unwrap()[at] ^= 1;
    let faults = rig.faults();
    assert!(faults.len() == 1 && faults[0].0 == "0/c/0/0/0", "{faults:?}");
    for words in ["inner chunk (2, 1, 2)", "a view of voxels at the array", "make the view again"] {
        assert!(faults[0].1.contains(words), "{words}: {faults:?}");
    }
    let cache = ChunkCache::new(1 << 20);
    let broken: Vec<_> =
        rig.store.manifest().grid.bricks().filter(|b| view.read_brick(*b, 0, &cache).is_err()).collect();
    assert_eq!(broken.iter().map(|brick| brick.0).collect::<Vec<_>>(), [[2, 1, 2]]);
    // Of another type, or shape.
    let other = Array { voxel_type: VoxelType::I16, ..rig.array.clone() };
    let error = rig.objects_of(other).unwrap_err().to_string();
    assert!(error.contains("the voxels at the array are int16, and were uint16 when"), "{error}");
    let small = Array { dims: [61, 37, 30], ..rig.array.clone() };
    let view = Store::open_objects(Arc::new(rig.objects_of(small).unwrap())).unwrap();
    assert!(matches!(view.verify(&mut |_| {}), Err(StoreError::ViewChanged { .. })));
}

/// What the view keeps is broken, cut or gone.
#[test]
fn damage_of_a_view_is_named() {
    let rig = Rig::new(&noisy([61, 37, 50], VoxelType::U16), &bricks(16), &[]);
    let shard = rig.path().join("0/c/0/0/0");
    let whole = fs::read(&shard).unwrap();
    assert_eq!(whole.len(), SUM_BYTES + INDEX_BYTES);
    let told = |content: Option<&[u8]>| {
        match content {
            Some(content) => fs::write(&shard, content).unwrap(),
            None => fs::remove_file(&shard).unwrap(),
        }
        let faults = rig.faults();
        assert!(!faults.is_empty() && faults.iter().all(|fault| fault.0 == "0/c/0/0/0"), "{faults:?}");
        faults[0].1.clone()
    };
    assert!(told(None).contains("is missing"));
    assert!(told(Some(&whole[1..])).contains("bytes, the manifest promises"));
    for at in [3, SUM_BYTES + 5, SUM_BYTES + INDEX_BYTES - 1] {
        let mut flipped = whole.clone();
        flipped[at] ^= 0x10;
        assert!(told(Some(&flipped)).contains("its index"), "{at}");
    }
    fs::write(&shard, &whole).unwrap();
    rig.check("as it was");
    let file = rig.path().join(VIEW_FILE);
    let text = fs::read_to_string(&file).unwrap();
    for (change, words) in [
        (text.replace("\"version\": 1", "\"version\": 2"), "it is of version 2, this program reads 1"),
        (text.replace("brickcast-view", "other"), "its format is \"other\""),
        (text[..40].to_owned(), "make the view again"),
    ] {
        fs::write(&file, change).unwrap();
        let error = rig.objects_of(rig.array.clone()).unwrap_err().to_string();
        assert!(error.contains(VIEW_FILE) && error.contains(words), "{error}");
    }
    // Without the file it is a store whose shards are cut.
    fs::remove_file(&file).unwrap();
    let store = Store::open(&rig.path()).unwrap();
    assert!(matches!(store.lacking(), Some((0, StoreError::ShardLength { .. }))));
}

/// Where a store of ours is replaced, a view is one.
#[test]
fn views_are_replaced_and_removed_as_stores_are() {
    let rig = Rig::new(&noisy([30, 20, 10], VoxelType::U8), &bricks(16), &[]);
    let volume = noisy([31, 20, 10], VoxelType::U8);
    let options = PrepareOptions { force: true, ..bricks(16) };
    let hash = volume.prepare(&rig.path(), &options).unwrap().hash;
    assert!(!rig.path().join(VIEW_FILE).exists());
    assert_eq!(Store::open(Path::new(&rig.path())).unwrap().hash(), hash);
}

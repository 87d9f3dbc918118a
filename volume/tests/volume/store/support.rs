//! Volumes in memory, and stores made of them.

use std::path::{Path, PathBuf};

use brickcast_volume::format::{FormatError, SourceHeader, VolumeSource, VoxelType};
use brickcast_volume::space::Geometry;
use brickcast_volume::store::{
    ChunkCache, ContentHash, Levels, MemoryObjects, PrepareOptions, PrepareSummary, Store, StoreError, prepare,
};

#[derive(Debug)]
pub(crate) struct MemorySource {
    pub(crate) header: SourceHeader,
    bytes: Vec<u8>,
    /// Bytes before the next voxel.
    next: usize,
    /// Gives pieces, from anywhere; else whole planes in order, as a source must at least.
    pub(crate) seekable: bool,
    /// The most bytes that one read gave.
    pub(crate) largest: usize,
    /// Planes beyond come short: a reader at fault.
    pub(crate) good_planes: usize,
}

impl MemorySource {
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn give(&mut self, most: usize, out: &mut Vec<u8>) {
        let end = (self.next + most).min(self.bytes.len());
        out.clear();
        out.extend_from_slice(&self.bytes[self.next..end]);
        self.largest = self.largest.max(out.len());
        self.next = end;
    }
}

impl VolumeSource for MemorySource {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.next = 0;
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        let plane = (d.x * d.y) as usize * self.header.voxel_type.bytes();
        self.give(plane * count as usize, planes);
        if self.next > self.good_planes.saturating_mul(plane) {
            planes.pop();
        }
        Ok(())
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        if !self.seekable {
            return self.read_planes(1, piece);
        }
        self.give(most, piece);
        Ok(())
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        if self.seekable {
            self.next = voxel as usize * self.header.voxel_type.bytes();
        }
        Ok(self.seekable)
    }
}

/// A volume whose voxels are known as numbers too.
pub(crate) struct Volume {
    pub(crate) dims: [u32; 3],
    pub(crate) voxel_type: VoxelType,
    pub(crate) values: Vec<f64>,
}

impl Volume {
    /// `value` of x, y, z, then cast (saturating) to the type.
    pub(crate) fn new(dims: [u32; 3], voxel_type: VoxelType, value: impl Fn([u32; 3]) -> f64) -> Self {
        let [nx, ny, nz] = dims;
        let mut values = Vec::with_capacity((nx * ny * nz) as usize);
        for z in 0..nz {
            for y in 0..ny {
                values.extend((0..nx).map(|x| cast(voxel_type, value([x, y, z])).0));
            }
        }
        Self { dims, voxel_type, values }
    }

    pub(crate) fn at(&self, p: [u32; 3]) -> f64 {
        self.values[(p[0] + self.dims[0] * (p[1] + self.dims[1] * p[2])) as usize]
    }

    pub(crate) fn source(&self) -> MemorySource {
        let geometry = Geometry::new(self.dims, [0.5, 1.0, 2.0], [-3.0, 4.0, 5.5]).unwrap();
        let header = SourceHeader::new("memory", geometry, self.voxel_type);
        let header = SourceHeader { space_unit: Some("mm".to_owned()), ..header };
        let bytes = self.values.iter().flat_map(|v| cast(self.voxel_type, *v).1).collect();
        MemorySource { header, bytes, next: 0, seekable: false, largest: 0, good_planes: usize::MAX }
    }

    pub(crate) fn prepare(&self, out: &Path, options: &PrepareOptions) -> Result<PrepareSummary, StoreError> {
        self.prepare_filled(out, options, &[])
    }

    /// With declared fill values.
    pub(crate) fn prepare_filled(
        &self,
        out: &Path,
        options: &PrepareOptions,
        fill: &[f64],
    ) -> Result<PrepareSummary, StoreError> {
        let mut source = self.source();
        source.header.no_data = fill.to_vec();
        prepare(&mut source, out, options, &mut |_| {})
    }
}

/// The value that the type makes of `v`, and its little-endian bytes.
fn cast(voxel_type: VoxelType, v: f64) -> (f64, Vec<u8>) {
    macro_rules! as_type {
        ($t:ty) => {
            ((v as $t) as f64, (v as $t).to_le_bytes().to_vec())
        };
    }
    match voxel_type {
        VoxelType::U8 => as_type!(u8),
        VoxelType::I8 => as_type!(i8),
        VoxelType::U16 => as_type!(u16),
        VoxelType::I16 => as_type!(i16),
        VoxelType::U32 => as_type!(u32),
        VoxelType::I32 => as_type!(i32),
        VoxelType::F32 => as_type!(f32),
        VoxelType::U64 => as_type!(u64),
        VoxelType::I64 => as_type!(i64),
        VoxelType::F64 => as_type!(f64),
    }
}

/// Noise over the whole range of 16 bits, zeros in a corner, so that some inner chunks are absent.
pub(crate) fn noise([x, y, z]: [u32; 3]) -> u32 {
    if x < 33 && y < 33 && z < 33 {
        return 0;
    }
    let mut h = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ z.wrapping_mul(0xC2B2_AE3D);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2C1B_3C6D);
    (h ^ (h >> 13)) & 0xFFFF
}

/// Noise that fills the type.
pub(crate) fn noisy(dims: [u32; 3], voxel_type: VoxelType) -> Volume {
    Volume::new(dims, voxel_type, |p| {
        let n = f64::from(noise(p));
        match voxel_type {
            VoxelType::U8 => (n / 256.0).floor(),
            VoxelType::I8 => (n / 256.0).floor() - 128.0,
            VoxelType::U16 => n,
            VoxelType::I16 => n - 32768.0,
            VoxelType::U32 => n * 65_537.0,
            VoxelType::I32 => (n - 32768.0) * 65_536.0,
            VoxelType::F32 => n * 1.7e-3 - 20.0,
            VoxelType::U64 => n * 281_479_271_743_489.0,
            VoxelType::I64 => (n - 32768.0) * 281_474_976_710_656.0,
            VoxelType::F64 => n * 1.7e300 - 20.0,
        }
    })
}

/// Bytes of the checksums before the index at a shard's end.
pub(crate) const SUM_BYTES: usize = 4 * 4096;
/// Offset and length of each of the 16^3 inner chunks of a shard, and a crc32c.
pub(crate) const INDEX_BYTES: usize = 16 * 4096 + 4;

/// Makes a store one of an older version: without means before 10, without levels before 9, without cells before 7,
/// without checksums of their chunks at the end of its shards before 6. Its `zarr.json` goes on to speak of levels,
/// which we never read.
pub(crate) fn downgrade(path: &Path, version: u64) {
    let manifest = path.join("brickcast.json");
    let mut text = std::fs::read_to_string(&manifest).unwrap();
    let older = |text: &str| {
        assert!(text.contains("\"version\": 10"));
        text.replacen("\"version\": 10", &format!("\"version\": {version}"), 1)
    };
    text = older(&text);
    let without = |text: &str, name: &str| {
        let key = format!(",\n    \"{name}\": ");
        let from = text.find(&key).unwrap();
        let ends = from + key.len() + text[from + key.len()..].find('\n').unwrap();
        format!("{}{}", &text[..from], &text[ends..])
    };
    text = without(&text, "means.bin");
    std::fs::remove_file(path.join("means.bin")).unwrap();
    if version == 9 {
        for level in 1.. {
            let folder = path.join(format!("levels/{level}"));
            let Ok(new) = std::fs::read_to_string(folder.join("level.json")) else { break };
            let old = older(&without(&new, "means.bin"));
            let hash = |text: &str| ContentHash::of(text.as_bytes()).to_string();
            text = text.replace(&hash(&new), &hash(&old));
            std::fs::write(folder.join("level.json"), old).unwrap();
            std::fs::remove_file(folder.join("means.bin")).unwrap();
        }
        return std::fs::write(manifest, text).unwrap();
    }
    if let Some(from) = text.find(",\n  \"levels\": [") {
        let ends = from + text[from..].find("\n  ]").unwrap() + "\n  ]".len();
        text.replace_range(from..ends, "");
    }
    for level in 1..20 {
        for folder in [format!("{level}"), format!("labels/regions/{level}"), "levels".to_owned()] {
            let _ = std::fs::remove_dir_all(path.join(folder));
        }
    }
    if version < 7 {
        text = without(&text, "cells.bin");
        std::fs::remove_file(path.join("cells.bin")).unwrap();
    }
    if version >= 6 {
        return std::fs::write(manifest, text).unwrap();
    }
    for (table, array) in
        [("shards.bin", "0"), ("label_shards.bin", "labels/regions/0"), ("distance_shards.bin", "distances")]
    {
        let Ok(mut records) = std::fs::read(path.join(table)) else { continue };
        let old = ContentHash::of(&records);
        for shard in files_of(&path.join(array).join("c")) {
            let whole = std::fs::read(&shard).unwrap();
            let (sums, index) = (whole.len() - INDEX_BYTES - SUM_BYTES, whole.len() - INDEX_BYTES);
            let bare = [&whole[..sums], &whole[index..]].concat();
            let hash = ContentHash::of(&whole).0.to_le_bytes();
            let record = records.chunks_exact_mut(40).find(|record| record[8..24] == hash).unwrap();
            record[..8].copy_from_slice(&(bare.len() as u64).to_le_bytes());
            record[8..24].copy_from_slice(&ContentHash::of(&bare).0.to_le_bytes());
            record[24..].copy_from_slice(&ContentHash::of(&bare[sums..]).0.to_le_bytes());
            std::fs::write(&shard, bare).unwrap();
        }
        text = text.replace(&old.to_string(), &ContentHash::of(&records).to_string());
        std::fs::write(path.join(table), records).unwrap();
    }
    std::fs::write(manifest, text).unwrap();
}

/// The options, with at most so many coarser levels.
pub(crate) fn at_most(levels: u8, options: PrepareOptions) -> PrepareOptions {
    PrepareOptions { levels: Levels::AtMost(levels), ..options }
}

/// Codes of all voxels of a store, x fastest.
pub(crate) fn codes_of(store: &Store) -> Vec<u16> {
    let (grid, cache) = (store.manifest().grid, ChunkCache::new(8 << 20));
    let n = grid.volume_dims();
    let mut codes = vec![0; n.element_product() as usize];
    for brick in grid.bricks() {
        let owned = grid.owned_box(brick);
        let read = store.read_brick(brick, 0, &cache).unwrap().codes;
        for (row, from) in read.chunks_exact(owned.dims().x as usize).enumerate() {
            let (y, z) = (owned.lo.y + row as u32 % owned.dims().y, owned.lo.z + row as u32 / owned.dims().y);
            codes[(owned.lo.x + n.x * (y + n.y * z)) as usize..][..from.len()].copy_from_slice(from);
        }
    }
    codes
}

/// What the store lacks of its large files, in words.
pub(crate) fn lacking(path: &Path) -> String {
    let store = Store::open(path).unwrap();
    store.lacking().map(|(_, error)| error.to_string()).unwrap()
}

/// All levels of a store, the finest first.
pub(crate) fn levels_of(store: &Store) -> impl Iterator<Item = &Store> {
    (0..store.level_count()).map(|level| store.level(level).unwrap())
}

/// The files of the store at `path`, as they are now, in memory.
pub(crate) fn in_memory(path: &Path) -> MemoryObjects {
    let mut objects = MemoryObjects::new(Path::new("memory"));
    for file in files_of(path) {
        let key = file.strip_prefix(path).unwrap().to_str().unwrap();
        objects.put(key, std::fs::read(&file).unwrap());
    }
    objects
}

pub(crate) fn files_of(root: &Path) -> Vec<PathBuf> {
    let (mut files, mut open) = (Vec::new(), vec![root.to_path_buf()]);
    while let Some(dir) = open.pop() {
        for entry in std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()) {
            if entry.is_dir() { open.push(entry) } else { files.push(entry) }
        }
    }
    files.sort();
    files
}

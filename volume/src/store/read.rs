//! An open store and its bricks.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{IVec3, UVec3};

use super::brick_ranges::BrickRanges;
use super::cache::{ChunkCache, Decoded};
use super::codec;
use super::error::StoreError;
use super::hash::ContentHash;
use super::manifest::Manifest;
use super::profile::{
    ARRAY_FILE, CHUNK_EDGE, CHUNK_VOXELS, GROUP_FILE, InnerChunk, MANIFEST_FILE, RANGES_FILE, SHARDS_FILE, ShardGrid,
};
use super::shard_read::Shards;
use super::shard_table;
use crate::brick::StoredBox;
use crate::ids::{BrickIndex, StoreHash};

/// The most ghost layers that a read may ask for.
pub const MAX_GHOST: u32 = 64;

/// Stretched codes of a stored box, x fastest: `round(65535 (v - lo) / (hi - lo))`, clamped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrickVoxels {
    pub stored: StoredBox,
    pub codes: Vec<u16>,
}

/// An open, finished store. Cheap to clone; reads from any number of threads.
#[derive(Debug, Clone)]
pub struct Store {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    path: PathBuf,
    hash: StoreHash,
    manifest: Manifest,
    manifest_bytes: Vec<u8>,
    ranges: BrickRanges,
    shards: Shards,
    /// Stretched code of every bit pattern of the stored type.
    codes: Vec<u16>,
}

impl Store {
    /// Opens a store after checking that it is finished: the manifest, the hashes of all small files, and that every shard
    /// is there in its full length. Contents of shards are checked as they are read, see [`Store::verify`].
    ///
    /// # Errors
    /// Not a finished store, unknown version, a file that is not the one that the manifest speaks of.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let manifest_path = path.join(MANIFEST_FILE);
        let manifest_bytes = match read_at_most(&manifest_path, Manifest::MAX_BYTES + 1) {
            Err(StoreError::Io { source, .. })
                if matches!(source.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) =>
            {
                return Err(StoreError::NotAStore { path: path.to_path_buf() });
            }
            read => read?,
        };
        let manifest = Manifest::from_bytes(&manifest_bytes)?;
        for (name, want) in [(GROUP_FILE, manifest.files.group), (ARRAY_FILE, manifest.files.array)] {
            let path = path.join(name);
            check_hash(&path, &read_at_most(&path, Manifest::MAX_BYTES)?, want)?;
        }
        let ranges = read_exactly(&path.join(RANGES_FILE), manifest.grid.brick_count() * 4)?;
        let ranges = BrickRanges::from_bytes(&manifest, &ranges)?;
        let grid = ShardGrid::new(manifest.geometry.dims())?;
        let table_path = path.join(SHARDS_FILE);
        let table = read_exactly(&table_path, shard_table::table_bytes(&grid))?;
        check_hash(&table_path, &table, manifest.files.shards)?;
        let voxel_bytes = manifest.stored_type.bytes();
        let table = shard_table::from_bytes(&grid, &table, codec::encoded_bound(CHUNK_VOXELS * voxel_bytes))?;
        let shards = Shards::new(path, grid, table, voxel_bytes);
        for linear in 0..shards.table.len() {
            shards.check_length(grid.at(linear))?;
        }
        let codes = manifest.value_map().code_of_bits_table();
        let hash = StoreHash::of(&manifest_bytes);
        let path = path.to_path_buf();
        Ok(Self { inner: Arc::new(Inner { path, hash, manifest, manifest_bytes, ranges, shards, codes }) })
    }

    #[must_use]
    pub fn path(&self) -> PathBuf {
        self.inner.path.clone()
    }

    #[must_use]
    pub fn hash(&self) -> StoreHash {
        self.inner.hash
    }

    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.inner.manifest
    }

    /// The very bytes that the hash is of.
    #[must_use]
    pub fn manifest_bytes(&self) -> &[u8] {
        &self.inner.manifest_bytes
    }

    #[must_use]
    pub fn brick_ranges(&self) -> &BrickRanges {
        &self.inner.ranges
    }

    /// Smallest and largest value that sampling the brick can meet, in the file's units, to half a code; clamped to the
    /// manifest's range. Nothing for a brick outside the grid.
    #[must_use]
    pub fn value_range(&self, brick: BrickIndex) -> Option<(f64, f64)> {
        let manifest = self.manifest();
        let [min, max] = manifest.grid.contains(brick).then(|| self.inner.ranges.0[manifest.grid.linear(brick)])?;
        Some((manifest.value_of_code(min), manifest.value_of_code(max)))
    }

    pub(super) fn shards(&self) -> &Shards {
        &self.inner.shards
    }

    /// The brick's owned box grown by `ghost`, clamped at the volume's edge; neighbours' voxels come through `cache`.
    ///
    /// Decodes in the calling thread: read several bricks at once for speed.
    ///
    /// # Errors
    /// A broken or missing chunk, by name.
    pub fn read_brick(&self, brick: BrickIndex, ghost: u32, cache: &ChunkCache) -> Result<BrickVoxels, StoreError> {
        let grid = &self.inner.manifest.grid;
        if !grid.contains(brick) {
            return Err(StoreError::BrickOutside { brick, dims: grid.dims().to_array() });
        }
        if ghost > MAX_GHOST {
            return Err(StoreError::Ghost { ghost, max: MAX_GHOST });
        }
        let stored = grid.owned_box(brick).stored(ghost);
        let mut window = Window::new(stored, grid.volume_dims());
        let (first, last) = (window.lo / CHUNK_EDGE, (window.hi - 1) / CHUNK_EDGE);
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in first.x..=last.x {
                    let chunk = InnerChunk([x, y, z]);
                    let load = || self.inner.shards.read_chunk(chunk);
                    let decoded = cache.get(self.inner.hash, chunk, load)?;
                    window.fill(chunk, &decoded, &self.inner.codes);
                }
            }
        }
        window.clamp_to_edge();
        Ok(BrickVoxels { stored, codes: window.codes })
    }
}

/// A stored box being filled.
struct Window {
    stored: StoredBox,
    /// Size of the stored box.
    dims: [usize; 3],
    /// The part of the stored box inside the volume, half-open.
    lo: UVec3,
    hi: UVec3,
    codes: Vec<u16>,
}

impl Window {
    fn new(stored: StoredBox, volume_dims: UVec3) -> Self {
        let lo = stored.lo.max(IVec3::ZERO).as_uvec3();
        let hi = stored.hi.min(volume_dims.as_ivec3()).as_uvec3();
        let dims = stored.dims().to_array().map(|n| n as usize);
        Self { stored, dims, lo, hi, codes: vec![0; dims.iter().product()] }
    }

    /// Copies the voxels of an inner chunk that are inside, row by row.
    fn fill(&mut self, chunk: InnerChunk, decoded: &Decoded, code_of_bits: &[u16]) {
        let origin = chunk.lo();
        let (lo, hi) = (self.lo.max(origin), self.hi.min(origin + CHUNK_EDGE));
        let from = (lo - origin).to_array().map(|v| v as usize);
        let to = (lo.as_ivec3() - self.stored.lo).to_array().map(|v| v as usize);
        let [width, height, depth] = (hi - lo).to_array().map(|v| v as usize);
        let edge = CHUNK_EDGE as usize;
        for z in 0..depth {
            for y in 0..height {
                let start = ((to[2] + z) * self.dims[1] + to[1] + y) * self.dims[0] + to[0];
                let row = &mut self.codes[start..][..width];
                let voxel = ((from[2] + z) * edge + from[1] + y) * edge + from[0];
                match decoded {
                    None => row.fill(code_of_bits[0]),
                    Some(bytes) if code_of_bits.len() == 256 => {
                        let bits = &bytes[voxel..][..width];
                        row.iter_mut().zip(bits).for_each(|(code, b)| *code = code_of_bits[usize::from(*b)]);
                    }
                    Some(bytes) => {
                        let bits = bytes[2 * voxel..][..2 * width].as_chunks::<2>().0;
                        row.iter_mut()
                            .zip(bits)
                            .for_each(|(code, b)| *code = code_of_bits[usize::from(u16::from_le_bytes(*b))]);
                    }
                }
            }
        }
    }

    /// Beyond the volume every voxel is the nearest one inside: along x, then whole rows, then whole planes.
    fn clamp_to_edge(&mut self) {
        let inside = |a: usize| {
            let lo = (self.lo[a] as i32 - self.stored.lo[a]) as usize;
            lo..(self.hi[a] as i32 - self.stored.lo[a]) as usize
        };
        let (xs, ys, zs) = (inside(0), inside(1), inside(2));
        let [width, height, depth] = self.dims;
        for z in zs.clone() {
            for y in ys.clone() {
                let row = &mut self.codes[(z * height + y) * width..][..width];
                let (first, last) = (row[xs.start], row[xs.end - 1]);
                row[..xs.start].fill(first);
                row[xs.end..].fill(last);
            }
            let plane = &mut self.codes[z * height * width..][..height * width];
            for y in (0..height).filter(|y| !ys.contains(y)) {
                let from = y.clamp(ys.start, ys.end - 1) * width;
                plane.copy_within(from..from + width, y * width);
            }
        }
        let plane = height * width;
        for z in (0..depth).filter(|z| !zs.contains(z)) {
            let from = z.clamp(zs.start, zs.end - 1) * plane;
            self.codes.copy_within(from..from + plane, z * plane);
        }
    }
}

fn read_at_most(path: &Path, max: u64) -> Result<Vec<u8>, StoreError> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(max).read_to_end(&mut bytes));
    read.map_err(StoreError::io("read", path))?;
    Ok(bytes)
}

/// Reads a file whose length is known beforehand.
fn read_exactly(path: &Path, want: u64) -> Result<Vec<u8>, StoreError> {
    let got = std::fs::metadata(path).map_err(StoreError::io("read", path))?.len();
    let bytes = if got == want { read_at_most(path, want)? } else { Vec::new() };
    match bytes.len() as u64 {
        n if n == want => Ok(bytes),
        _ => Err(StoreError::FileLength { path: path.to_path_buf(), got, want }),
    }
}

fn check_hash(path: &Path, bytes: &[u8], want: ContentHash) -> Result<(), StoreError> {
    match ContentHash::of(bytes) {
        got if got == want => Ok(()),
        got => Err(StoreError::FileHash { path: path.to_path_buf(), got, want }),
    }
}

//! The brick store.

use std::path::{Path, PathBuf};

use crate::brick::{BrickGrid, StoredBox};
use crate::ids::{BrickIndex, StoreHash};
use crate::space::Geometry;

/// What a store says of itself; parsed and validated from the bytes that the store's hash is of.
#[derive(Debug, Clone)]
pub struct Manifest {
    pub geometry: Geometry,
    pub grid: BrickGrid,
    /// Data values (file's units) that codes 0 and 65535 stand for; lo < hi.
    pub range: (f64, f64),
    /// Otsu's threshold of all voxels, data units.
    pub otsu: f64,
    /// The 99.9 % quantile of all voxels, data units.
    pub quantile_999: f64,
}

impl Manifest {
    /// # Errors
    /// Anything that is not a valid manifest of this version.
    pub fn from_bytes(_bytes: &[u8]) -> Result<Self, StoreError> {
        todo!()
    }
}

/// Per brick, in the grid's linear order: smallest and largest stretched code over the owned box grown by
/// [`crate::brick::RANGE_MARGIN`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrickRanges(pub Vec<[u16; 2]>);

/// Stretched codes of a stored box, x fastest: `round(65535 (v - lo) / (hi - lo))`, clamped.
#[derive(Debug, Clone)]
pub struct BrickVoxels {
    pub stored: StoredBox,
    pub codes: Vec<u16>,
}

#[derive(Debug, thiserror::Error)]
#[error("todo")]
pub struct StoreError;

/// A bounded cache of decoded inner chunks, shared by all reads of a process.
#[derive(Debug)]
pub struct ChunkCache;

impl ChunkCache {
    #[must_use]
    pub fn new(_max_bytes: u64) -> Self {
        todo!()
    }

    /// Bytes of voxels decoded so far (misses only).
    #[must_use]
    pub fn decoded_bytes(&self) -> u64 {
        todo!()
    }
}

/// An open, finished store.
#[derive(Debug, Clone)]
pub struct Store;

impl Store {
    /// # Errors
    /// Not a finished store, unknown version, broken manifest.
    pub fn open(_path: &Path) -> Result<Self, StoreError> {
        todo!()
    }

    #[must_use]
    pub fn path(&self) -> PathBuf {
        todo!()
    }

    #[must_use]
    pub fn hash(&self) -> StoreHash {
        todo!()
    }

    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        todo!()
    }

    /// The very bytes that the hash is of.
    #[must_use]
    pub fn manifest_bytes(&self) -> &[u8] {
        todo!()
    }

    #[must_use]
    pub fn brick_ranges(&self) -> &BrickRanges {
        todo!()
    }

    /// The brick's owned box grown by `ghost`, clamped at the volume's edge; neighbours' voxels come through `cache`.
    ///
    /// # Errors
    /// A broken or missing chunk, by name.
    pub fn read_brick(&self, _brick: BrickIndex, _ghost: u32, _cache: &ChunkCache) -> Result<BrickVoxels, StoreError> {
        todo!()
    }
}

//! Images whose voxels a store shows where they lie: see [`brickcast_volume::store::ViewObjects`].

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use brickcast_volume::format::{RawHints, VoxelType};
use brickcast_volume::store::{FinestVoxels, Objects, StoreError, ViewFile, ViewObjects};
use bytes::Bytes;

use crate::cut::{Cut, Place};
use crate::error::{OmeZarrError, failed};
use crate::source;

/// The store at `objects`, whatever it is: where it is a view, with the shards that it does not keep. `find` gives the
/// objects at a view's place; decoded chunks of its array are kept up to `room` bytes, or two of them.
///
/// # Errors
/// A view whose array is not there, is another one, or cannot be read; those of `find`.
pub fn whole(
    objects: Arc<dyn Objects>,
    find: impl FnOnce(&str) -> Result<Arc<dyn Objects>, StoreError>,
    room: u64,
) -> Result<Arc<dyn Objects>, StoreError> {
    let Some(file) = ViewFile::read(objects.as_ref())? else { return Ok(objects) };
    let array = find(&file.input.place)?;
    let hints = RawHints { channel: file.input.channel, time: file.input.time, ..RawHints::default() };
    let (cut, header) = source::found(array.clone(), &hints).map_err(|reason| lost(array.as_ref(), reason))?;
    let most = usize::try_from(room).unwrap_or(usize::MAX).max(2 * cut.array().chunk_bytes());
    let dims = header.geometry.dims().to_array();
    let voxels = ArrayVoxels { cut, dims, most, kept: Mutex::default() };
    Ok(Arc::new(ViewObjects::new(objects, &file, Box::new(voxels))?))
}

/// What the array's place says stays what it is; all else names the array.
fn lost(objects: &dyn Objects, reason: OmeZarrError) -> StoreError {
    match reason {
        OmeZarrError::Read(error) => error,
        reason => failed(objects, reason).into(),
    }
}

/// Voxels of an array, through chunks that stay decoded: each is decoded by one thread at a time, and whoever decodes
/// waits for nobody.
#[derive(Debug)]
struct ArrayVoxels {
    cut: Cut,
    dims: [u32; 3],
    /// Bytes of chunks that are kept; those in use come on top.
    most: usize,
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    chunks: HashMap<Place, Entry>,
    /// By their last use, the oldest first.
    by_use: BTreeMap<u64, Place>,
    clock: u64,
    bytes: usize,
}

#[derive(Debug, Default)]
struct Entry {
    chunk: Arc<Chunk>,
    used: u64,
    /// Nothing while it is being decoded.
    bytes: Option<usize>,
}

/// Nothing until it is decoded; then nothing again where the array has none there.
type Chunk = Mutex<Option<Option<Bytes>>>;

impl ArrayVoxels {
    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn chunk(&self, place: Place) -> Result<Option<Bytes>, OmeZarrError> {
        let chunk = self.kept().chunk(place);
        let mut decoded = chunk.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(decoded) = &*decoded {
            return Ok(decoded.clone());
        }
        let loaded = self.cut.chunks.load(&self.cut.chunk_at(&place));
        let mut kept = self.kept();
        match &loaded {
            Ok(loaded) => {
                *decoded = Some(loaded.clone());
                kept.count(place, &chunk, loaded.as_ref().map_or(0, Bytes::len), self.most);
            }
            Err(_) => kept.forget(place, &chunk),
        }
        loaded
    }
}

/// What an entry costs beside its voxels, bytes.
const ENTRY_BYTES: usize = 256;

impl Kept {
    fn chunk(&mut self, place: Place) -> Arc<Chunk> {
        self.clock += 1;
        let entry = self.chunks.entry(place).or_default();
        self.by_use.remove(&entry.used);
        entry.used = self.clock;
        self.by_use.insert(self.clock, place);
        entry.chunk.clone()
    }

    /// Counts a chunk that was just decoded, and lets go of those that were used longest ago.
    fn count(&mut self, place: Place, chunk: &Arc<Chunk>, bytes: usize, most: usize) {
        let own = self.chunks.get_mut(&place).filter(|entry| Arc::ptr_eq(&entry.chunk, chunk));
        let Some(own) = own else { return };
        own.bytes = Some(bytes + ENTRY_BYTES);
        self.bytes += bytes + ENTRY_BYTES;
        while self.bytes > most {
            let decoded = |place: &Place| self.chunks.get(place)?.bytes;
            let mut others = self.by_use.iter().filter(|(_, other)| **other != place);
            let Some((used, oldest, bytes)) = others.find_map(|(used, other)| Some((*used, *other, decoded(other)?)))
            else {
                return;
            };
            self.chunks.remove(&oldest);
            self.by_use.remove(&used);
            self.bytes -= bytes;
        }
    }

    /// One that could not be decoded: the next reader tries again.
    fn forget(&mut self, place: Place, chunk: &Arc<Chunk>) {
        if let Some(entry) = self.chunks.get(&place)
            && Arc::ptr_eq(&entry.chunk, chunk)
        {
            self.by_use.remove(&entry.used);
            self.chunks.remove(&place);
        }
    }
}

impl FinestVoxels for ArrayVoxels {
    fn voxel_type(&self) -> VoxelType {
        self.cut.array().voxel_type
    }

    fn dims(&self) -> [u32; 3] {
        self.dims
    }

    fn is_far(&self) -> bool {
        self.cut.chunks.objects.is_far()
    }

    fn read_box(&self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<(), StoreError> {
        let mut read = || {
            self.cut.clear(lo, hi, voxels)?;
            let [xs, ys, zs] = self.cut.chunks_of(lo, hi);
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        let chunk = self.chunk([x, y, z])?;
                        self.cut.copy([x, y, z], chunk.as_deref(), (lo, hi), voxels);
                    }
                }
            }
            Ok(())
        };
        read().map_err(|reason| lost(self.cut.chunks.objects.as_ref(), reason))
    }
}

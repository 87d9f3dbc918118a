//! Decoded inner chunks, shared by all reads of a process: bounded, least recently used out, and each chunk decoded by
//! one thread at a time.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::ids::StoreHash;
use crate::store::error::StoreError;
use crate::store::profile::{InnerChunk, StoreArray};

/// An inner chunk's elements as stored, x fastest, little endian; nothing where all are the fill value 0.
pub(crate) type Decoded = Option<Vec<u8>>;

/// What an entry costs beside its voxels, bytes.
const ENTRY_BYTES: u64 = 256;

/// A bounded cache of decoded inner chunks, shared by all reads of a process.
#[derive(Debug)]
pub struct ChunkCache {
    shared: Arc<Shared>,
    /// By this handle.
    decoded_bytes: AtomicU64,
}

/// What all handles hold together.
#[derive(Debug)]
struct Shared {
    max_bytes: u64,
    state: Mutex<State>,
}

type Key = (StoreHash, StoreArray, InnerChunk);

#[derive(Debug, Default)]
struct State {
    slots: HashMap<Key, Slot>,
    /// Keys of ready slots by their last use, oldest first.
    by_use: BTreeMap<u64, Key>,
    clock: u64,
    resident_bytes: u64,
}

#[derive(Debug)]
enum Slot {
    Ready {
        chunk: Arc<Decoded>,
        used: u64,
    },
    /// Some thread decodes it.
    Loading(Arc<Flight>),
}

/// A decoding that others may wait for.
#[derive(Debug, Default)]
struct Flight {
    /// The chunk, or nothing where decoding failed: whoever waited then tries for itself and gets its own error.
    landed: Mutex<Option<Option<Arc<Decoded>>>>,
    signal: Condvar,
}

impl ChunkCache {
    /// Holds at most `max_bytes` of decoded chunks; those in use by a read may come on top.
    #[must_use]
    pub fn new(max_bytes: u64) -> Self {
        Self { shared: Arc::new(Shared { max_bytes, state: Mutex::default() }), decoded_bytes: AtomicU64::new(0) }
    }

    /// Another handle to the same chunks, with a count of its own: several nodes of one process share what they decode,
    /// and each reports what it decoded itself.
    #[must_use]
    pub fn share(&self) -> Self {
        Self { shared: self.shared.clone(), decoded_bytes: AtomicU64::new(0) }
    }

    /// Bytes decoded through this handle so far: inner chunks (misses only) and halos.
    #[must_use]
    pub fn decoded_bytes(&self) -> u64 {
        self.decoded_bytes.load(Ordering::Relaxed)
    }

    /// Counts what a read decoded that is no inner chunk, and so not kept here.
    pub(crate) fn count_decoded(&self, bytes: u64) {
        self.decoded_bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Bytes held now, by all handles together.
    #[must_use]
    pub fn resident_bytes(&self) -> u64 {
        self.shared.lock().resident_bytes
    }

    /// The chunk from the cache, from the thread that decodes it just now, or from `load`.
    pub(crate) fn get(
        &self,
        store: StoreHash,
        array: StoreArray,
        chunk: InnerChunk,
        load: impl Fn() -> Result<Decoded, StoreError>,
    ) -> Result<Arc<Decoded>, StoreError> {
        let key = (store, array, chunk);
        loop {
            let mut state = self.shared.lock();
            let flight = match state.slots.get(&key) {
                Some(Slot::Ready { .. }) => {
                    if let Some(chunk) = state.touch(key) {
                        return Ok(chunk);
                    }
                    continue;
                }
                Some(Slot::Loading(flight)) => flight.clone(),
                None => {
                    let flight = Arc::new(Flight::default());
                    state.slots.insert(key, Slot::Loading(flight.clone()));
                    drop(state);
                    let mut landing = Landing { cache: &self.shared, key, flight, chunk: None };
                    let chunk = Arc::new(load()?);
                    let bytes = chunk.as_ref().as_ref().map_or(0, Vec::len) as u64;
                    self.decoded_bytes.fetch_add(bytes, Ordering::Relaxed);
                    landing.chunk = Some(chunk.clone());
                    return Ok(chunk);
                }
            };
            drop(state);
            if let Some(chunk) = flight.wait() {
                return Ok(chunk);
            }
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Flight {
    /// Ends when the decoding thread leaves `get`, by whatever way: see [`Landing`].
    fn wait(&self) -> Option<Arc<Decoded>> {
        let mut landed = self.landed.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if let Some(chunk) = landed.as_ref() {
                return chunk.clone();
            }
            landed = self.signal.wait(landed).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// Ends a flight when dropped, with a chunk or without: on return, error and unwinding alike.
struct Landing<'a> {
    cache: &'a Shared,
    key: Key,
    flight: Arc<Flight>,
    chunk: Option<Arc<Decoded>>,
}

impl Drop for Landing<'_> {
    fn drop(&mut self) {
        let chunk = self.chunk.take();
        let mut state = self.cache.lock();
        match &chunk {
            Some(chunk) => state.insert(self.key, chunk.clone(), self.cache.max_bytes),
            None => drop(state.slots.remove(&self.key)),
        }
        drop(state);
        *self.flight.landed.lock().unwrap_or_else(PoisonError::into_inner) = Some(chunk);
        self.flight.signal.notify_all();
    }
}

impl State {
    fn touch(&mut self, key: Key) -> Option<Arc<Decoded>> {
        self.clock += 1;
        let Some(Slot::Ready { chunk, used }) = self.slots.get_mut(&key) else { return None };
        self.by_use.remove(used);
        *used = self.clock;
        self.by_use.insert(self.clock, key);
        Some(chunk.clone())
    }

    fn insert(&mut self, key: Key, chunk: Arc<Decoded>, max_bytes: u64) {
        self.clock += 1;
        self.resident_bytes += cost(&chunk);
        self.slots.insert(key, Slot::Ready { chunk, used: self.clock });
        self.by_use.insert(self.clock, key);
        while self.resident_bytes > max_bytes {
            let Some((_, oldest)) = self.by_use.pop_first() else { return };
            if let Some(Slot::Ready { chunk, .. }) = self.slots.remove(&oldest) {
                self.resident_bytes -= cost(&chunk);
            }
        }
    }
}

fn cost(chunk: &Decoded) -> u64 {
    ENTRY_BYTES + chunk.as_ref().map_or(0, Vec::len) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const STORE: StoreHash = StoreHash(1);
    const VOXELS: StoreArray = StoreArray::Voxels;

    fn at(x: u32) -> InnerChunk {
        InnerChunk([x, 0, 0])
    }

    #[test]
    fn the_least_recently_used_leaves_and_memory_is_bounded() {
        let cache = ChunkCache::new(2 * (1000 + ENTRY_BYTES));
        let load = || Ok(Some(vec![0; 1000]));
        for x in [0, 1, 0, 2] {
            cache.get(STORE, VOXELS, at(x), load).unwrap();
        }
        assert!(cache.resident_bytes() <= 2 * (1000 + ENTRY_BYTES));
        assert_eq!(cache.decoded_bytes(), 3000);
        cache.get(STORE, VOXELS, at(0), || panic!("0 was used after 1")).unwrap();
        cache.get(STORE, VOXELS, at(1), load).unwrap();
        assert_eq!(cache.decoded_bytes(), 4000);
        // The same chunk of another store is another chunk.
        cache.get(StoreHash(2), VOXELS, at(1), load).unwrap();
        assert_eq!(cache.decoded_bytes(), 5000);
        // So is the chunk of another array.
        cache.get(StoreHash(2), StoreArray::Labels, at(1), load).unwrap();
        assert_eq!(cache.decoded_bytes(), 6000);
        // Chunks without voxels are bounded as well.
        (0..1000).for_each(|x| drop(cache.get(STORE, VOXELS, at(x), || Ok(None)).unwrap()));
        assert!(cache.resident_bytes() <= 2 * (1000 + ENTRY_BYTES));
    }

    #[test]
    fn handles_share_chunks_and_count_for_themselves() {
        let one = ChunkCache::new(1 << 20);
        let two = one.share();
        one.get(STORE, VOXELS, at(0), || Ok(Some(vec![0; 1000]))).unwrap();
        two.get(STORE, VOXELS, at(0), || panic!("the other handle has it")).unwrap();
        two.get(STORE, VOXELS, at(1), || Ok(Some(vec![0; 10]))).unwrap();
        assert_eq!((one.decoded_bytes(), two.decoded_bytes()), (1000, 10));
        assert_eq!(one.resident_bytes(), two.resident_bytes());
    }

    #[test]
    fn two_threads_never_decode_the_same_chunk() {
        for max_bytes in [0, 1 << 20] {
            let cache = ChunkCache::new(max_bytes);
            let (loading, most) = (AtomicU64::new(0), AtomicU64::new(0));
            std::thread::scope(|scope| {
                for _ in 0..8 {
                    scope.spawn(|| {
                        for _ in 0..5 {
                            let load = || {
                                most.fetch_max(loading.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                                std::thread::sleep(Duration::from_millis(2));
                                loading.fetch_sub(1, Ordering::SeqCst);
                                Ok(Some(vec![9; 10]))
                            };
                            assert_eq!(*cache.get(STORE, VOXELS, at(0), load).unwrap(), Some(vec![9; 10]));
                        }
                    });
                }
            });
            assert_eq!(most.load(Ordering::SeqCst), 1);
        }
    }

    #[test]
    fn waiters_outlive_a_failing_and_a_panicking_decoder() {
        let cache = ChunkCache::new(1 << 20);
        let calls = AtomicU64::new(0);
        let flaky = || {
            std::thread::sleep(Duration::from_millis(5));
            match calls.fetch_add(1, Ordering::SeqCst) {
                0 => Err(StoreError::TooManyShards { shards: 7 }),
                1 => panic!("decoder"),
                _ => Ok(None),
            }
        };
        let outcomes: Vec<_> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..6).map(|_| scope.spawn(|| cache.get(STORE, VOXELS, at(0), flaky))).collect();
            threads.into_iter().map(|t| t.join()).collect()
        });
        assert_eq!(outcomes.iter().filter(|o| o.is_err()).count(), 1);
        assert_eq!(outcomes.iter().filter(|o| matches!(o, Ok(Err(_)))).count(), 1);
        assert_eq!(outcomes.iter().filter(|o| matches!(o, Ok(Ok(_)))).count(), 4);
    }
}

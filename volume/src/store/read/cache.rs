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

    /// Gives `take` each of `chunks`, in any order: from the cache, from `load`, or from the thread that decodes it
    /// just now.
    ///
    /// `load` gets all that nobody has, to fetch them together, and decodes each as it is asked for the next. In this
    /// thread: others wait for it, so it must wait for none of them.
    pub(crate) fn get<L: Iterator<Item = Result<Decoded, StoreError>>>(
        &self,
        store: StoreHash,
        array: StoreArray,
        chunks: &[InnerChunk],
        load: impl Fn(&[InnerChunk]) -> Result<L, StoreError>,
        mut take: impl FnMut(InnerChunk, &Decoded),
    ) -> Result<(), StoreError> {
        let mut missing = chunks.to_vec();
        while !missing.is_empty() {
            let Sorted { ready, own, of_others } = self.sort(store, array, &missing);
            ready.iter().for_each(|(chunk, decoded)| take(*chunk, decoded));
            if !own.is_empty() {
                let wanted: Vec<_> = own.iter().map(|landing| landing.key.2).collect();
                for (mut landing, decoded) in own.into_iter().zip(load(&wanted)?) {
                    let decoded = Arc::new(decoded?);
                    self.count_decoded(decoded.as_ref().as_ref().map_or(0, Vec::len) as u64);
                    landing.chunk = Some(decoded.clone());
                    let chunk = landing.key.2;
                    drop(landing);
                    take(chunk, &decoded);
                }
            }
            missing.clear();
            for (chunk, flight) in of_others {
                match flight.wait() {
                    Some(decoded) => take(chunk, &decoded),
                    None => missing.push(chunk),
                }
            }
        }
        Ok(())
    }

    /// Where each of `chunks` comes from; what nobody has is the caller's to decode.
    fn sort(&self, store: StoreHash, array: StoreArray, chunks: &[InnerChunk]) -> Sorted<'_> {
        let mut sorted = Sorted { ready: Vec::new(), own: Vec::new(), of_others: Vec::new() };
        let mut state = self.shared.lock();
        for chunk in chunks {
            let key = (store, array, *chunk);
            if let Some(decoded) = state.touch(key) {
                sorted.ready.push((*chunk, decoded));
            } else if let Some(Slot::Loading(flight)) = state.slots.get(&key) {
                sorted.of_others.push((*chunk, flight.clone()));
            } else {
                let flight = Arc::new(Flight::default());
                state.slots.insert(key, Slot::Loading(flight.clone()));
                sorted.own.push(Landing { cache: &self.shared, key, flight, chunk: None });
            }
        }
        sorted
    }
}

/// The chunks of a read by where they come from.
struct Sorted<'a> {
    ready: Vec<(InnerChunk, Arc<Decoded>)>,
    own: Vec<Landing<'a>>,
    of_others: Vec<(InnerChunk, Arc<Flight>)>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Flight {
    /// Ends when the decoding thread has the chunk, or leaves `get` without, by whatever way: see [`Landing`].
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

    fn get(
        cache: &ChunkCache,
        store: StoreHash,
        array: StoreArray,
        x: u32,
        load: impl Fn() -> Result<Decoded, StoreError>,
    ) -> Result<Decoded, StoreError> {
        let mut got = Vec::new();
        let load = |wanted: &[InnerChunk]| {
            assert_eq!(wanted, [at(x)]);
            Ok(std::iter::once(load()))
        };
        cache.get(store, array, &[at(x)], load, |_, decoded| got.push(decoded.clone()))?;
        assert_eq!(got.len(), 1);
        Ok(got.remove(0))
    }

    #[test]
    fn the_least_recently_used_leaves_and_memory_is_bounded() {
        let cache = ChunkCache::new(2 * (1000 + ENTRY_BYTES));
        let load = || Ok(Some(vec![0; 1000]));
        for x in [0, 1, 0, 2] {
            get(&cache, STORE, VOXELS, x, load).unwrap();
        }
        assert!(cache.resident_bytes() <= 2 * (1000 + ENTRY_BYTES));
        assert_eq!(cache.decoded_bytes(), 3000);
        get(&cache, STORE, VOXELS, 0, || panic!("0 was used after 1")).unwrap();
        get(&cache, STORE, VOXELS, 1, load).unwrap();
        assert_eq!(cache.decoded_bytes(), 4000);
        // The same chunk of another store is another chunk.
        get(&cache, StoreHash(2), VOXELS, 1, load).unwrap();
        assert_eq!(cache.decoded_bytes(), 5000);
        // So is the chunk of another array.
        get(&cache, StoreHash(2), StoreArray::Labels, 1, load).unwrap();
        assert_eq!(cache.decoded_bytes(), 6000);
        // Chunks without voxels are bounded as well.
        (0..1000).for_each(|x| drop(get(&cache, STORE, VOXELS, x, || Ok(None)).unwrap()));
        assert!(cache.resident_bytes() <= 2 * (1000 + ENTRY_BYTES));
    }

    #[test]
    fn handles_share_chunks_and_count_for_themselves() {
        let one = ChunkCache::new(1 << 20);
        let two = one.share();
        get(&one, STORE, VOXELS, 0, || Ok(Some(vec![0; 1000]))).unwrap();
        get(&two, STORE, VOXELS, 0, || panic!("the other handle has it")).unwrap();
        get(&two, STORE, VOXELS, 1, || Ok(Some(vec![0; 10]))).unwrap();
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
                            assert_eq!(get(&cache, STORE, VOXELS, 0, load).unwrap(), Some(vec![9; 10]));
                        }
                    });
                }
            });
            assert_eq!(most.load(Ordering::SeqCst), 1);
        }
    }

    /// Reads that overlap in every way, each with all it needs in one call: every chunk comes once, and is decoded
    /// once.
    #[test]
    fn reads_that_share_chunks_wait_for_each_other_and_end() {
        let cache = ChunkCache::new(1 << 20);
        let decodings = AtomicU64::new(0);
        std::thread::scope(|scope| {
            for first in 0..8u32 {
                let (cache, decodings) = (&cache, &decodings);
                scope.spawn(move || {
                    let mut chunks: Vec<_> = (first..first + 20).map(at).collect();
                    // Orders that would wait for each other in a ring, and a chunk twice.
                    chunks.rotate_left(first as usize * 5 % 20);
                    chunks.push(at(first));
                    let mut got = Vec::new();
                    let load = |wanted: &[InnerChunk]| {
                        let wanted = wanted.to_vec();
                        Ok(wanted.into_iter().map(|chunk| {
                            decodings.fetch_add(1, Ordering::SeqCst);
                            std::thread::sleep(Duration::from_micros(200));
                            Ok(Some(vec![chunk.0[0] as u8; 10]))
                        }))
                    };
                    let take = |chunk: InnerChunk, decoded: &Decoded| {
                        assert_eq!(*decoded, Some(vec![chunk.0[0] as u8; 10]));
                        got.push(chunk.0[0]);
                    };
                    cache.get(STORE, VOXELS, &chunks, load, take).unwrap();
                    got.sort_unstable();
                    let want: Vec<_> = std::iter::once(first).chain(first..first + 20).collect();
                    assert_eq!(got, want);
                });
            }
        });
        assert_eq!(decodings.load(Ordering::SeqCst), 27);
        assert_eq!(cache.decoded_bytes(), 270);
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
            let threads: Vec<_> = (0..6).map(|_| scope.spawn(|| get(&cache, STORE, VOXELS, 0, flaky))).collect();
            threads.into_iter().map(|t| t.join()).collect()
        });
        assert_eq!(outcomes.iter().filter(|o| o.is_err()).count(), 1);
        assert_eq!(outcomes.iter().filter(|o| matches!(o, Ok(Err(_)))).count(), 1);
        assert_eq!(outcomes.iter().filter(|o| matches!(o, Ok(Ok(_)))).count(), 4);
    }
}

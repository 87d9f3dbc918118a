//! Decoded inner chunks, shared by all reads of a process: bounded, least recently used out, and each chunk decoded by
//! one thread at a time.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
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
    /// Of this handle.
    reader: Reader,
}

/// For whom is read.
#[derive(Default)]
struct Reader(Option<Arc<dyn Fn() -> bool + Send + Sync>>);

impl Reader {
    fn is_wanted(&self) -> Result<(), StoreError> {
        match &self.0 {
            Some(is_gone) if is_gone() => Err(StoreError::Unwanted),
            _ => Ok(()),
        }
    }
}

impl fmt::Debug for Reader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reader").field("is_wanted", &self.is_wanted().is_ok()).finish()
    }
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
        let shared = Arc::new(Shared { max_bytes, state: Mutex::default() });
        Self { shared, decoded_bytes: AtomicU64::new(0), reader: Reader::default() }
    }

    /// Another handle to the same chunks, with a count of its own: several nodes of one process share what they decode,
    /// and each reports what it decoded itself.
    #[must_use]
    pub fn share(&self) -> Self {
        Self { shared: self.shared.clone(), decoded_bytes: AtomicU64::new(0), reader: Reader::default() }
    }

    /// The same for one reader: once it `is_gone`, its reads end at their next inner chunk, with
    /// [`StoreError::Unwanted`]. What others wait for they then decode themselves.
    #[must_use]
    pub fn share_until(&self, is_gone: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Self { reader: Reader(Some(Arc::new(is_gone))), ..self.share() }
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
            self.reader.is_wanted()?;
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
                    self.reader.is_wanted()?;
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
mod tests;

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

/// One of several chunks that were fetched together; what is left another reader gets.
#[test]
fn a_reader_that_is_gone_decodes_no_more_chunks() {
    let (cache, decodings) = (ChunkCache::new(1 << 20), Arc::new(AtomicU64::new(0)));
    let load = |wanted: &[InnerChunk]| {
        let decodings = decodings.clone();
        Ok((0..wanted.len()).map(move |_| {
            decodings.fetch_add(1, Ordering::SeqCst);
            Ok(Some(vec![1; 10]))
        }))
    };
    let seen = decodings.clone();
    let reader = cache.share_until(move || seen.load(Ordering::SeqCst) >= 3);
    let chunks: Vec<_> = (0..20).map(at).collect();
    let read = |cache: &ChunkCache| cache.get(STORE, VOXELS, &chunks, load, |_, _| {});
    assert!(matches!(read(&reader), Err(StoreError::Unwanted)));
    assert_eq!(decodings.load(Ordering::SeqCst), 3);
    read(&cache).unwrap();
    assert_eq!(decodings.load(Ordering::SeqCst), 20, "three were kept");
    assert!(matches!(read(&reader), Err(StoreError::Unwanted)), "even of what is there");
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

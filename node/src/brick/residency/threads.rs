//! The threads that load bricks. Kernels have others, so that reading and decoding go on while a picture is computed;
//! what loads waits for no kernel.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use crate::stores::far::{READERS, readers};

/// More of them where stores are far away.
fn pool() -> Option<&'static rayon::ThreadPool> {
    readers().or_else(of_processors)
}

fn of_processors() -> Option<&'static rayon::ThreadPool> {
    static THREADS: OnceLock<Option<rayon::ThreadPool>> = OnceLock::new();
    let name = |i| format!("loading-{i}");
    THREADS.get_or_init(|| rayon::ThreadPoolBuilder::new().thread_name(name).build().ok()).as_ref()
}

/// How many there are.
pub(super) fn count(is_far: bool) -> usize {
    if is_far { READERS } else { of_processors().map_or(1, rayon::ThreadPool::current_num_threads) }
}

/// Does `work` to each, `at_once` at a time, begun in their order; the first error ends it.
pub(super) fn for_each<T: Sync, E: Send>(
    items: &[T],
    at_once: usize,
    work: impl Fn(&T) -> Result<(), E> + Sync,
) -> Result<(), E> {
    let pool = match pool() {
        Some(pool) if items.len() > 1 && at_once > 1 => pool,
        // Alone, it waits for its file and its texture here.
        _ => return items.iter().try_for_each(work),
    };
    let (next, failed) = (AtomicUsize::new(0), Mutex::new(None));
    let has_failed = AtomicBool::new(false);
    let one_after_the_other = || {
        while !has_failed.load(Ordering::Relaxed)
            && let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed))
        {
            if let Err(error) = work(item) {
                has_failed.store(true, Ordering::Relaxed);
                failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            }
        }
    };
    pool.in_place_scope(|scope| {
        for _ in 0..at_once.min(items.len()) {
            scope.spawn(|_| one_after_the_other());
        }
    });
    failed.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
}

/// Does `work` here and `aside` on these threads meanwhile; `work` is told how to end what is aside, which should then
/// end soon. Where there are no threads, nothing is done aside.
pub(crate) fn beside<T>(aside: impl FnOnce() + Send, work: impl FnOnce() -> T) -> T {
    match pool() {
        Some(pool) => pool.in_place_scope(|scope| {
            scope.spawn(|_| aside());
            work()
        }),
        None => work(),
    }
}

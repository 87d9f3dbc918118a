//! Transfer function tables of the last few scenes: a sequence or an orbit uses one.
//!
//! A table is built by the first who asks, outside of the lock: who wants another one does not wait for it, and who
//! wants the same waits for nothing else.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use brickcast_volume::look_on::Tables;
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::transfer_function::{TransferFunction, TransferTable};

/// Tables kept.
const KEPT: usize = 4;
/// Of pre-integrated ones, which take 16 to 48 MiB: those of one scene, outside and inside regions.
const SLABS_KEPT: usize = 2;

#[derive(Debug, Clone, PartialEq)]
struct Key {
    function: TransferFunction,
    /// Data units of codes 0 and 65535.
    range: (f64, f64),
    /// Sample distance in opacity units.
    delta_over_unit: f64,
    entries: usize,
    /// With the tables of interpolated light.
    lit: bool,
}

/// Built by whoever comes first.
type Place<T> = Arc<OnceLock<Arc<T>>>;
/// Latest first.
type Kept<T> = Mutex<VecDeque<(Key, Place<T>)>>;

#[derive(Debug, Default)]
pub struct TableCache {
    tables: Kept<TransferTable>,
    slabs: Kept<Preintegrated>,
}

/// Whoever asks first computes, on rayon's global threads: call it where that is allowed.
impl Tables for TableCache {
    fn table(
        &self,
        function: &TransferFunction,
        range: (f64, f64),
        delta_over_unit: f64,
        entries: usize,
    ) -> Arc<TransferTable> {
        let key = Key { function: function.clone(), range, delta_over_unit, entries, lit: false };
        let build = || TransferTable::with_entries(function, range, delta_over_unit, entries);
        known_or_new(&self.tables, key, KEPT, build)
    }

    fn slabs(
        &self,
        function: &TransferFunction,
        range: (f64, f64),
        delta_over_unit: f64,
        entries: usize,
        lit: bool,
    ) -> Arc<Preintegrated> {
        let key = Key { function: function.clone(), range, delta_over_unit, entries, lit };
        let build = || Preintegrated::with_entries(function, range, delta_over_unit, entries, lit);
        known_or_new(&self.slabs, key, SLABS_KEPT, build)
    }
}

fn known_or_new<T>(cache: &Kept<T>, key: Key, most: usize, build: impl FnOnce() -> T) -> Arc<T> {
    place(cache, key, most).get_or_init(|| Arc::new(build())).clone()
}

/// Where the table of `key` is, or will be.
fn place<T>(cache: &Kept<T>, key: Key, most: usize) -> Place<T> {
    let mut kept = cache.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, place)) = kept.iter().find(|(known, _)| *known == key) {
        return place.clone();
    }
    let place = Place::default();
    kept.truncate(most - 1);
    kept.push_front((key, place.clone()));
    place
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc;
    use std::time::Duration;

    use brickcast_volume::transfer_function::Colormap;

    use super::*;

    fn key(lo: f64) -> Key {
        let function = TransferFunction::window(lo, 200.0, 0.5, Colormap::Viridis).unwrap();
        Key { function, range: (0.0, 255.0), delta_over_unit: 1.0, entries: 256, lit: false }
    }

    #[test]
    fn a_table_that_takes_long_keeps_nobody_from_another_and_is_built_once() {
        let (cache, built): (Kept<f64>, AtomicUsize) = (Kept::default(), AtomicUsize::new(0));
        let (go, wait) = mpsc::channel();
        std::thread::scope(|scope| {
            let counted = &built;
            let slow = move || {
                counted.fetch_add(1, Ordering::SeqCst);
                wait.recv_timeout(Duration::from_secs(60)).unwrap();
                1.0
            };
            let first = scope.spawn(|| known_or_new(&cache, key(1.0), 4, slow));
            while built.load(Ordering::SeqCst) == 0 {
                std::thread::yield_now();
            }
            assert_eq!(*known_or_new(&cache, key(2.0), 4, || 2.0), 2.0, "while the other is being built");
            let same = scope.spawn(|| known_or_new(&cache, key(1.0), 4, || 3.0));
            go.send(()).unwrap();
            assert_eq!((*first.join().unwrap(), *same.join().unwrap()), (1.0, 1.0));
        });
        assert_eq!(built.load(Ordering::SeqCst), 1);
    }
}

//! Transfer function tables of the last few scenes: a sequence or an orbit uses one.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

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

/// Latest first.
type Kept<T> = Mutex<VecDeque<(Key, Arc<T>)>>;

#[derive(Debug, Default)]
pub struct TableCache {
    tables: Kept<TransferTable>,
    slabs: Kept<Preintegrated>,
}

impl TableCache {
    /// The table of `entries` entries of `function` over `range` for steps of `delta_over_unit` opacity units.
    #[must_use]
    pub fn get(
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

    /// The pre-integrated table of `function`, `lit` for interpolated light. Built once: who asks meanwhile waits for it.
    #[must_use]
    pub fn slabs(
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
    let mut kept = cache.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, table)) = kept.iter().find(|(known, _)| *known == key) {
        return table.clone();
    }
    let table = Arc::new(build());
    kept.truncate(most - 1);
    kept.push_front((key, table.clone()));
    table
}

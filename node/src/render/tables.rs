//! Transfer function tables of the last few scenes: a sequence or an orbit uses one.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use brickcast_volume::transfer_function::{TransferFunction, TransferTable};

/// Tables kept.
const KEPT: usize = 4;

#[derive(Debug, Clone, PartialEq)]
struct Key {
    function: TransferFunction,
    /// Data units of codes 0 and 65535.
    range: (f64, f64),
    /// Sample distance in opacity units.
    delta_over_unit: f64,
}

#[derive(Debug, Default)]
pub struct TableCache {
    tables: Mutex<VecDeque<(Key, Arc<TransferTable>)>>,
}

impl TableCache {
    /// The table of `function` over `range` for steps of `delta_over_unit` opacity units.
    #[must_use]
    pub fn get(&self, function: &TransferFunction, range: (f64, f64), delta_over_unit: f64) -> Arc<TransferTable> {
        let key = Key { function: function.clone(), range, delta_over_unit };
        let mut tables = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, table)) = tables.iter().find(|(known, _)| *known == key) {
            return table.clone();
        }
        let table = Arc::new(TransferTable::build(function, range, delta_over_unit));
        tables.truncate(KEPT - 1);
        tables.push_front((key, table.clone()));
        table
    }
}

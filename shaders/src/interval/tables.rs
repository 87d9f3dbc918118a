//! The tables of a scene, as extremes over ranges of codes.

use std::sync::Arc;

use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::preintegration::extremes::SlabExtremes;
use brickcast_volume::scene::Look;
use brickcast_volume::transfer_function::{TableExtremes, TransferTable};

/// What intervals are made of, outside and inside regions.
#[derive(Debug, Clone)]
pub struct IntervalTables {
    single: [Arc<TableExtremes>; 2],
    /// Where the scene integrates slabs.
    slabs: Option<[Arc<SlabExtremes>; 2]>,
}

impl IntervalTables {
    /// Of `look` over the store's `range` (data units of codes 0 and 65535), from its tables outside and, where it has
    /// a function of its own for them, inside regions.
    #[must_use]
    pub fn new(
        look: &Look,
        range: (f64, f64),
        (table, region_table): (&TransferTable, Option<&TransferTable>),
        slabs: Option<&[Arc<Preintegrated>; 2]>,
    ) -> Self {
        let single = Arc::new(TableExtremes::new(table));
        let inside = region_table.map_or_else(|| single.clone(), |table| Arc::new(TableExtremes::new(table)));
        let slabs = slabs.map(|[outside, inside]| {
            let main = Arc::new(SlabExtremes::new(outside.clone(), &look.transfer_function, range));
            let of_regions = |function| Arc::new(SlabExtremes::new(inside.clone(), function, range));
            let region = look.region_transfer_function.as_ref().map_or_else(|| main.clone(), of_regions);
            [main, region]
        });
        Self { single: [single, inside], slabs }
    }

    /// For single samples.
    #[must_use]
    pub fn single(&self, in_region: bool) -> &TableExtremes {
        &self.single[usize::from(in_region)]
    }

    /// For slabs, where there are any.
    #[must_use]
    pub fn slabs(&self, in_region: bool) -> Option<&SlabExtremes> {
        self.slabs.as_ref().map(|slabs| &*slabs[usize::from(in_region)])
    }
}

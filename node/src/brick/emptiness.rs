//! Which value ranges are empty in a scene: under every table that a sample may be read by.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use brickcast_volume::PixelKind;
use brickcast_volume::scene::RegionView;
use brickcast_volume::transfer_function::TransferTable;

use crate::kernel::KernelScene;

/// Codes `min..=max` are empty iff `counts[max][1] == counts[min][0]`.
#[derive(Debug, Default)]
pub(crate) struct Emptiness {
    pub(crate) counts: Vec<[u32; 2]>,
    pub(crate) tables: Vec<Arc<TransferTable>>,
    pub(crate) also: BesideOpacity,
}

/// What makes a value range not empty although it has no opacity: isosurfaces, and what a projection counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct BesideOpacity {
    /// Codes from here on are on an isosurface or inside it.
    lowest_surface: Option<u16>,
    pixel: PixelKind,
}

/// Is `known` the very same as `emptiness`? A dead one never is: its place is not given to another while a weak pointer
/// is left.
pub(crate) fn is_same(known: &Weak<Emptiness>, emptiness: &Arc<Emptiness>) -> bool {
    std::ptr::eq(known.as_ptr(), Arc::as_ptr(emptiness))
}

/// How many scenes' are kept, half a megabyte each: one for each level of a picture, of which few have more.
const KEPT: usize = 8;

/// The emptiness of the last scenes that skipped, the last first: maps are built anew only when it changes.
#[derive(Debug, Default)]
pub(crate) struct EmptinessCache(Mutex<VecDeque<Arc<Emptiness>>>);

impl EmptinessCache {
    /// `None` where the scene does not skip.
    pub(crate) fn get(&self, scene: &KernelScene) -> Option<Arc<Emptiness>> {
        if !scene.skip_empty {
            return None;
        }
        let tables = tables_of(scene);
        let lowest_surface = scene.style.as_ref().and_then(|style| style.lowest_surface);
        let also = BesideOpacity { lowest_surface, pixel: scene.pixel_kind() };
        let same = |known: &Emptiness| {
            known.also == also
                && known.tables.len() == tables.len()
                && known.tables.iter().zip(&tables).all(|(a, b)| Arc::ptr_eq(a, b) || a == b)
        };
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.iter().position(|known| same(known)).and_then(|place| kept.remove(place));
        let emptiness = known.unwrap_or_else(|| {
            let counts = counts(&tables, also);
            Arc::new(Emptiness { counts, tables, also })
        });
        kept.push_front(emptiness.clone());
        kept.truncate(KEPT);
        Some(emptiness)
    }
}

/// The tables that can apply: a sample that the view hides has no opacity under any.
fn tables_of(scene: &KernelScene) -> Vec<Arc<TransferTable>> {
    let of_regions = scene.region_table.as_ref().unwrap_or(&scene.table);
    match scene.region_view {
        RegionView::Residual => vec![scene.table.clone()],
        RegionView::Regions => vec![of_regions.clone()],
        RegionView::All if Arc::ptr_eq(of_regions, &scene.table) => vec![scene.table.clone()],
        RegionView::All => vec![scene.table.clone(), of_regions.clone()],
    }
}

fn counts(tables: &[Arc<TransferTable>], also: BesideOpacity) -> Vec<[u32; 2]> {
    match also.pixel {
        PixelKind::Over => {}
        // Empty is what changes no projection: nothing but the neutral code, which is one of the ends.
        kind if kind.neutral_code() == 0 => return (0..=u16::MAX).map(|code| [0, u32::from(code > 0)]).collect(),
        kind => return (0..=u16::MAX).map(|code| [u32::from(code == kind.neutral_code()), 1]).collect(),
    }
    let mut counts = vec![[0; 2]; usize::from(u16::MAX) + 1];
    if let Some(lowest) = also.lowest_surface {
        counts[usize::from(lowest)..].iter_mut().for_each(|count| count[1] = 1);
    }
    for table in tables {
        for (sum, more) in counts.iter_mut().zip(table.opaque_counts()) {
            *sum = [sum[0] + more[0], sum[1] + more[1]];
        }
    }
    counts
}

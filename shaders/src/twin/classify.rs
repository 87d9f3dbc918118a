//! `wgsl/shared/classify.wgsl` on the CPU: the transfer function for single samples.

use super::bindings::Bindings;
use super::read::{between, clamped};
use crate::layout::{SHOWS_REGIONS, SHOWS_RESIDUAL};

/// The entry below a position in a table of `last + 1` entries, and how far on it lies; `last` is at least 1.
#[inline(always)]
pub(super) fn entry_at(position: f32, last: usize) -> (usize, f32) {
    let entry = clamped(position, last as f32);
    let i = (entry as i32).min(last as i32 - 1);
    (i as usize, entry - i as f32)
}

#[inline(always)]
fn classified(entries: &[[f32; 4]], first: f32, scale: f32, code: f32) -> [f32; 4] {
    let (i, w) = entry_at((code - first) * scale, entries.len() - 1);
    let [a, b] = [entries[i], entries[i + 1]];
    std::array::from_fn(|c| between(a[c], b[c], w))
}

/// Straight colour and opacity of one step.
#[inline(always)]
pub(super) fn classify(bound: &Bindings<'_>, in_region: bool, code: f32) -> [f32; 4] {
    let (frame, tables) = (bound.scene.frame, bound.scene.tables);
    if bound.key.regions && in_region {
        return classified(tables.region.unwrap_or(tables.table), frame.region_first, frame.region_scale, code);
    }
    classified(tables.table, frame.table_first, frame.table_scale, code)
}

/// Does the view show samples of this kind?
#[inline(always)]
pub(crate) fn is_shown(bound: &Bindings<'_>, in_region: bool) -> bool {
    !bound.key.regions || bound.scene.frame.shown & if in_region { SHOWS_REGIONS } else { SHOWS_RESIDUAL } != 0
}

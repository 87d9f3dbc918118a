//! What waited for a store, on a store.

use brickcast_volume::store::Manifest;
use brickcast_volume::style::Style;

use crate::cli::args::Awaited;

/// `style` with what waited for `store`.
pub(super) fn added(awaited: &Awaited, style: Style, store: &Manifest) -> Style {
    awaited.added(style, store.otsu, store.geometry.bounds_world())
}

/// The numbers that the store gave.
pub(super) fn told(awaited: &Awaited, store: &Manifest) -> Vec<String> {
    let at = format!("isosurface at {} (Otsu's threshold); change it with --isosurface VALUE", store.otsu);
    let cuts = awaited.cuts.iter().map(|cut| cut.told(store.geometry.bounds_world()));
    awaited.otsu.map(|_| at).into_iter().chain(cuts).collect()
}

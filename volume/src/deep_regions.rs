//! Whether leaping through regions shortens the rays of a look: how much of what shows lies deep inside of regions.
//!
//! Leaping changes the picture, within its bound. So whether a store's regions are flattened must not depend on
//! bricks, nodes or backends: it goes by the look and by what the manifest counts. How a brick is walked then is
//! another matter.

use crate::store::{HISTOGRAM_BINS, Manifest};
use crate::transfer_function::TransferFunction;

/// Of what shows, the share that must lie deep in regions for leaps to pay.
pub const LEAST_DEEP: f64 = 0.3;
/// Samples between a region's border and its leap voxels, about: a ray that ends among them never leaps.
const GUARD_SAMPLES: f64 = 8.0;
/// Of the light that enters a region, the share that must be left there.
const LEAST_LEFT: f64 = 0.05;
/// Places in a bin of the histogram at which the function is looked at.
const PLACES: u32 = 8;

/// Of the voxels that `function` shows, the share that lies deep in regions through which light passes;
/// `delta_over_unit` is a step in opacity units. Nothing where the store has no regions, or does not say how deep they
/// are.
#[must_use]
pub fn deep_share(store: &Manifest, function: &TransferFunction, delta_over_unit: f64) -> Option<f64> {
    let deep = store.regions.as_ref()?.leap_histogram.as_ref()?;
    let (lo, hi) = store.range;
    let width = (hi - lo) / HISTOGRAM_BINS as f64;
    let (mut showing, mut leaping) = (0.0, 0.0);
    for (bin, (&all, &deep)) in store.histogram.iter().zip(deep).enumerate() {
        let at = |place: u32| lo + width * (bin as f64 + f64::from(place) / f64::from(PLACES));
        let opacities = (0..=PLACES).map(|place| function.opacity(at(place)));
        let most = opacities.fold(0.0, f64::max);
        if most > 0.0 {
            showing += all as f64;
            let left = libm::pow(1.0 - most, delta_over_unit * GUARD_SAMPLES);
            leaping += if left >= LEAST_LEFT { deep as f64 } else { 0.0 };
        }
    }
    Some(if showing > 0.0 { (leaping / showing).min(1.0) } else { 0.0 })
}

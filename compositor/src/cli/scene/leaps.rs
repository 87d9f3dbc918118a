//! Whether rays leap through a store's regions where nothing was said of it: by the look, and told.

use brickcast_volume::deep_regions::{LEAST_DEEP, deep_share};
use brickcast_volume::scene::{Leap, Look};
use brickcast_volume::store::Manifest;
use brickcast_volume::style::Mode;

/// What rays of `look` leap through at a `step` in voxels; one line where the store has regions.
pub(super) fn chosen(store: &Manifest, look: &Look, step: f64) -> (Leap, Option<String>) {
    if store.regions.is_none() {
        return (Leap::Off, None);
    }
    // Pictures of regions are of V' by their meaning.
    if look.tells_regions_apart() {
        return (Leap::Regions, None);
    }
    let ratio = step * store.geometry.min_spacing() / look.opacity_unit;
    let volume_itself = "--accel all leaps all the same";
    if look.style.mode != Mode::Composite {
        let note = format!("acceleration: no leaps through regions: a projection shows every sample; {volume_itself}");
        return (Leap::Off, Some(note));
    }
    let Some(share) = deep_share(store, &look.transfer_function, ratio) else {
        let note = format!(
            "acceleration: no leaps through regions: the store is older than what is known of their depth; prepare it \
             anew, or {volume_itself}"
        );
        return (Leap::Off, Some(note));
    };
    let percent = (share * 100.0).round();
    if share >= LEAST_DEEP {
        let note = format!(
            "acceleration: rays leap through regions, in which {percent} % of what shows lies deep; --accel ert,ess \
             draws the volume itself"
        );
        return (Leap::Regions, Some(note));
    }
    let note = format!(
        "acceleration: no leaps through regions, in which only {percent} % of what shows lies deep; {volume_itself}"
    );
    (Leap::Off, Some(note))
}

//! Whether an acceleration pays in a brick. A turn of the accelerated loop costs about one and a half samples of the plain one
//! (on processors, and more on GPUs that wait for the slowest of their lanes), so that a brick with little to skip or to leap
//! is faster in the plain loop. The picture is the same either way, within half a density.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use brickcast_shaders::twin::macrocell::is_empty;
use brickcast_volume::StoredBox;
use brickcast_volume::regions::BrickRegions;

use crate::emptiness::Emptiness;

/// Of a brick's macrocells, the share that must be empty for the map to pay.
const LEAST_EMPTY: f64 = 0.2;
/// Of a brick's stored voxels, the share that must leap.
const LEAST_LEAPS: f64 = 0.2;

/// Does skipping pay? Remembered for the last transfer function.
#[derive(Debug, Default)]
pub(crate) struct SkipsEnough(Mutex<Option<(Weak<Emptiness>, bool)>>);

impl SkipsEnough {
    /// `ranges`: smallest and largest code of each macrocell.
    pub(crate) fn ask(&self, emptiness: &Arc<Emptiness>, ranges: &[[u16; 2]]) -> bool {
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, answer)) = &*last
            && known.as_ptr() == Arc::as_ptr(emptiness)
        {
            return *answer;
        }
        let empty = ranges.iter().filter(|range| is_empty(&emptiness.counts, **range)).count();
        let answer = empty as f64 >= LEAST_EMPTY * ranges.len() as f64;
        *last = Some((Arc::downgrade(emptiness), answer));
        answer
    }
}

/// Does leaping pay? `regions` covers the stored box and more.
pub(crate) fn leaps_enough(stored: &StoredBox, regions: &BrickRegions, guard: u32) -> bool {
    let covered = regions.covered;
    let (size, dims) = (covered.dims().as_u64vec3(), stored.dims().as_u64vec3());
    let offset = (stored.lo - covered.lo).max(glam::IVec3::ZERO).as_u64vec3();
    let mut leaps = 0_usize;
    for z in offset.z..offset.z + dims.z {
        for y in offset.y..offset.y + dims.y {
            let row = ((z * size.y + y) * size.x + offset.x) as usize;
            // Too small a cover is the classification's to refuse.
            let Some(row) = regions.distances.get(row..row + dims.x as usize) else { return true };
            leaps += row.iter().filter(|&&distance| u32::from(distance) > guard).count();
        }
    }
    leaps as f64 >= LEAST_LEAPS * dims.element_product() as f64
}

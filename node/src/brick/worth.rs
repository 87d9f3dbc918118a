//! Whether an acceleration pays in a brick. A turn that asks a map or a texel first costs about one and a half samples
//! of the plain one (on processors, and more on GPUs that wait for the slowest of their lanes), so that a brick with
//! little to skip or to leap is faster in the plain loop. The picture is the same either way, within half a density.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use brickcast_shaders::twin::macrocell::is_empty;
use brickcast_volume::macrocell::Macrocells;
use brickcast_volume::regions::BrickRegions;
use brickcast_volume::{OwnedBox, StoredBox};
use glam::UVec3;

use super::emptiness::{Emptiness, is_same};
use crate::kernel::Occupied;

/// Of the macrocells within the bounds of what a brick shows, the share that must be empty for the map to pay.
const LEAST_EMPTY: f64 = 0.2;
/// Of a brick's stored voxels, the share that must leap.
const LEAST_LEAPS: f64 = 0.2;

/// [`Occupied`], remembered for the last transfer function.
#[derive(Debug, Default)]
pub(crate) struct LastOccupied(Mutex<Option<(Weak<Emptiness>, Occupied)>>);

impl LastOccupied {
    pub(crate) fn ask(&self, emptiness: &Arc<Emptiness>, owned: &OwnedBox, cells: &Macrocells) -> Occupied {
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, answer)) = &*last
            && is_same(known, emptiness)
        {
            return *answer;
        }
        let answer = occupied(&emptiness.counts, owned, cells);
        *last = Some((Arc::downgrade(emptiness), answer));
        answer
    }
}

fn occupied(counts: &[[u32; 2]], owned: &OwnedBox, cells: &Macrocells) -> Occupied {
    let (mut lo, mut hi) = (UVec3::MAX, UVec3::ZERO);
    let mut showing = 0_u32;
    let dims = cells.dims;
    for (i, range) in (0..).zip(&cells.ranges) {
        if is_empty(counts, *range) {
            continue;
        }
        showing += 1;
        let cell = UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
        lo = lo.min(cell);
        hi = hi.max(cell + 1);
    }
    if showing == 0 {
        return Occupied { bounds: OwnedBox { lo: owned.lo, hi: owned.lo }, skips: false, skips_uncut: true };
    }
    let first = cells.lo.as_uvec3();
    let bounds = OwnedBox { lo: (first + lo) * cells.edge, hi: (first + hi) * cells.edge };
    // What the bounds cut off need not be skipped.
    let within = (hi - lo).element_product();
    let pays = |all: u32| f64::from(all - showing) >= LEAST_EMPTY * f64::from(all);
    Occupied { bounds, skips: pays(within), skips_uncut: pays(dims.element_product()) }
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
            // Too small a cover is refused where texels are made.
            let Some(row) = regions.distances.get(row..row + dims.x as usize) else { return true };
            leaps += row.iter().filter(|&&distance| u32::from(distance) > guard).count();
        }
    }
    leaps as f64 >= LEAST_LEAPS * dims.element_product() as f64
}

#[cfg(test)]
mod tests {
    use glam::IVec3;

    use super::*;

    /// Codes from 100 on show.
    fn counts() -> Vec<[u32; 2]> {
        (0..=u32::from(u16::MAX)).map(|code| [code.saturating_sub(100), (code + 1).saturating_sub(100)]).collect()
    }

    fn cells(edge: u32, lo: IVec3, dims: UVec3, shows: impl Fn(UVec3) -> bool) -> Macrocells {
        let at = |i: u32| UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
        let range = |cell| if shows(cell) { [0, 100] } else { [0, 99] };
        Macrocells { edge, lo, dims, ranges: (0..dims.element_product()).map(|i| range(at(i))).collect() }
    }

    /// Cells that the brick only shares at its low end, and cells cut at its high end.
    #[test]
    fn bounds_are_the_smallest_box_of_cells_that_holds_all_that_shows() {
        let owned = OwnedBox { lo: UVec3::new(6, 8, 16), hi: UVec3::new(22, 21, 32) };
        let dims = UVec3::new(5, 4, 4);
        let of =
            |shows: &dyn Fn(UVec3) -> bool| occupied(&counts(), &owned, &cells(4, IVec3::new(1, 2, 4), dims, shows));
        let all = OwnedBox { lo: UVec3::new(4, 8, 16), hi: UVec3::new(24, 24, 32) };
        assert_eq!(of(&|_| true), Occupied { bounds: all, skips: false, skips_uncut: false });
        let nothing = of(&|_| false);
        assert_eq!((nothing.bounds.voxel_count(), nothing.skips, nothing.skips_uncut), (0, false, true));
        for corner in 0..8_u32 {
            let cell = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2) * (dims - 1);
            let lo = (UVec3::new(1, 2, 4) + cell) * 4;
            let hi = (UVec3::new(1, 2, 4) + cell + 1) * 4;
            let one = of(&|c| c == cell);
            assert_eq!(one, Occupied { bounds: OwnedBox { lo, hi }, skips: false, skips_uncut: true }, "{cell}");
        }
        // Two far corners: all between them is empty, and within the bounds.
        let two = of(&|c| c == UVec3::ZERO || c == dims - 1);
        assert_eq!(two, Occupied { bounds: all, skips: true, skips_uncut: true });
    }
}

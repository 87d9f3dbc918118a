//! `wgsl/walk/map.wgsl` on the CPU: over what is empty, and through cubes of one value (Krueger & Westermann 2003).
//!
//! Where slabs matter one is left out iff both of its ends lie in empty cells. So a run of empty positions that follows
//! a value is entered by one sample, and one that a value follows is left by going back to its last position.

use brickcast_volume::macrocell::MapTexel;

use super::super::bindings::Bindings;
use super::super::part::{MapWalk, Take};
use super::super::run::Step;

#[derive(Debug)]
pub struct Map {
    last_cell: [i32; 3],
    /// Voxels of a cell, per axis.
    edge: f32,
    /// The first position at which the map may say something new, and whether it is asked at the present one.
    k_look: f32,
    looks: bool,
    /// The positions just before were skipped: where the present one is not empty, the last of them must be read.
    has_skipped: bool,
    /// The present position lies in an empty cell, and is read all the same; and the one before.
    reads_empty: bool,
    front_is_empty: bool,
}

impl MapWalk for Map {
    #[inline(always)]
    fn enter_map(bound: &Bindings<'_>, k: f32) -> Self {
        let last_cell = bound.data.map.map_or([0; 3], |(_, dims)| dims.map(|n| n as i32 - 1));
        Self {
            last_cell,
            edge: (1_u32 << bound.brick.cell_shift) as f32,
            k_look: k,
            looks: true,
            has_skipped: false,
            reads_empty: false,
            front_is_empty: false,
        }
    }

    #[inline(always)]
    fn ask_map<T: Take>(&mut self, bound: &Bindings<'_>, p: [f32; 3], follows: bool) -> Step {
        let (brick, key) = (bound.brick, bound.key);
        let mut step = Step::default();
        if self.looks
            && let Some((map, dims)) = bound.data.map
        {
            let cell: [i32; 3] = std::array::from_fn(|a| {
                ((p[a] as i32 >> brick.cell_shift) - brick.cell_lo[a]).max(0).min(self.last_cell[a])
            });
            let at = cell[0] as usize + dims[0] as usize * (cell[1] as usize + dims[1] as usize * cell[2] as usize);
            let texel = MapTexel::unpack(map[at]);
            let empty = if key.skips { texel.empty } else { 0 };
            // Cells know no regions: their samples may need different tables.
            let alike = if key.cubes && !bound.has_flags() { texel.cube.distance } else { 0 };
            let is_empty = empty > 0;
            let is_alike = !is_empty && alike > 0;
            step.center = std::array::from_fn(|a| ((cell[a] + brick.cell_lo[a]) as f32 + 0.5) * self.edge);
            step.half = (f32::from(if is_empty { empty } else { alike.max(1) }) - 0.5) * self.edge;
            if T::TAKES_EMPTY {
                // Nothing there changes the pixel: a run of the code that says so.
                step.is_known = is_empty;
                step.code = T::neutral_code(bound);
            } else {
                // Both ends of all slabs up to the one that leaves.
                step.is_skip = is_empty && (!T::ends_beyond(bound) || !follows || self.front_is_empty);
                // The slab that enters what shows starts in the empty.
                step.is_back = !is_empty && self.has_skipped;
                self.reads_empty = is_empty && !step.is_skip;
            }
            step.jumps = step.is_skip || step.is_known;
            step.is_skip = step.is_skip || step.is_back;
            if is_alike && !step.is_back {
                step.code = f32::from(texel.cube.value) / 65535.0;
                step.is_flat = true;
                step.jumps = true;
            }
            step.is_by_map = step.jumps || step.is_back;
            step.is_known = step.is_by_map;
        }
        step
    }

    #[inline(always)]
    fn leave_map<T: Take>(&mut self, bound: &Bindings<'_>, step: &Step, k: f32, n: f32, k_exit: f32, shows: bool) {
        // A leap says nothing of its cell, nor does an empty one of the next position where this one is read.
        let is_short = step.is_deep && step.jumps || self.reads_empty;
        if self.looks && !step.is_skip {
            self.k_look = if is_short { k + 1.0 } else { k_exit };
        }
        self.looks = if step.is_skip { !step.is_back } else { k + n >= self.k_look && (bound.key.cubes || !shows) };
        self.has_skipped = T::ends_beyond(bound) && step.is_skip && !step.is_back;
        self.front_is_empty = self.reads_empty;
        self.reads_empty = step.is_back;
    }
}

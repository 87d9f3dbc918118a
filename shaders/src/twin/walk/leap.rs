//! `wgsl/walk/leap.wgsl` on the CPU: texels that hold leaps (Frey & Ertl 2009). What is drawn is the flattened volume,
//! several positions at once where they are known to have one value (`docs/adr/0002-leaping.md`).

use brickcast_volume::regions::code::{CodedTexel, MAX_DENSITY};

use super::super::bindings::Along;
use super::super::part::CodeWalk;
use super::super::run::Step;

/// Samples of a brick, or after a skip, that are probed whatever their values.
pub const ENTRY_PROBES: u32 = 2;
/// Filtered values that differ by less may both come from guards: 1.25 of 16383.
pub const NEARLY_EQUAL: f32 = 1.25 / 16383.0;
/// Voxels that a leap ends before the last place that is known; more where positions are large numbers.
pub const MARGIN: f32 = 1e-3;
/// Of the largest coordinate: what positions and planes may round by, with room.
pub const MARGIN_SHARE: f32 = 1e-6;
/// The last value where there is none: far from all codes, so that nothing is like it.
pub const NOTHING_YET: f32 = 9.0;

#[derive(Debug)]
pub struct Leap {
    /// Voxels.
    pub margin: f32,
    /// Positions that are probed from here on, whatever their values.
    pub probes: u32,
    /// The last value taken.
    pub last: f32,
}

impl CodeWalk for Leap {
    #[inline(always)]
    fn enter_code(along: &Along<'_>) -> Self {
        let hi = along.bound.brick.owned_hi;
        let far_corner = (0..3).fold(0.0_f32, |m, a| m.max(along.ray.origin[a].abs()).max(hi[a] as f32));
        Self { margin: MARGIN.max(MARGIN_SHARE * far_corner), probes: ENTRY_PROBES, last: NOTHING_YET }
    }

    #[inline(always)]
    fn ask_code(&mut self, along: &Along<'_>, step: &mut Step, p: [f32; 3]) -> u32 {
        if self.probes == 0 || step.is_known {
            return 0;
        }
        match CodedTexel::unpack(along.reader.nearest(p)) {
            CodedTexel::Leap { distance, slot } => {
                step.code = mean_of(along, slot);
                step.center = p.map(|x| (x as i32) as f32 + 0.5);
                step.half = f32::from(distance) - 1.0 - self.margin;
                step.jumps = true;
                step.is_known = true;
            }
            CodedTexel::Value { density, inner } => {
                step.code = f32::from(density) / f32::from(MAX_DENSITY);
                step.is_known = inner;
            }
        }
        step.is_deep = step.is_known;
        step.is_flat = step.is_known;
        1
    }

    #[inline(always)]
    fn leave_code(&mut self, step: &Step, code: f32) {
        let is_equal = (code - self.last).abs() <= NEARLY_EQUAL;
        let fewer = self.probes.max(1) - 1;
        let needed = u32::from(is_equal || step.is_deep);
        self.probes = if step.is_by_map { ENTRY_PROBES } else { fewer.max(needed) };
        self.last = code;
    }
}

fn mean_of(along: &Along<'_>, slot: u8) -> f32 {
    along.bound.data.means.and_then(|means| means.get(usize::from(slot))).copied().unwrap_or(0.0)
}

/// The mean of the region that a place is deep inside of, if it is: leap and inner guard voxels.
#[inline(always)]
pub(in super::super) fn deep_at(along: &Along<'_>, p: [f32; 3]) -> Option<f32> {
    if !along.bound.key.leaps {
        return None;
    }
    match CodedTexel::unpack(along.reader.nearest(p)) {
        CodedTexel::Leap { slot, .. } => Some(mean_of(along, slot)),
        CodedTexel::Value { density, inner } => inner.then(|| f32::from(density) / f32::from(MAX_DENSITY)),
    }
}

//! `wgsl/march.wgsl` on the CPU, in f32 with the kernel's order of operations and no fused multiply-add: the only loop
//! of rays, and the truth for every other.
//!
//! Both filters of the GPU are one here: interpolation is at full precision.

use brickcast_volume::Premul;

use super::bindings::{Along, Bindings, RayCounts};
use super::holes::is_no_data;
use super::positions::Positions;
use super::ray::Ray;
use super::run::Run;
use super::scene::Scene;
use super::take::{Projection, Sampled, Slabs, Take};
use super::walk::{CodeWalk, Leap, Map, MapWalk, Uncoded, Unmapped};
use crate::key::TakeKind;
use crate::layout::RegionFlags;

/// What a brick adds along `ray` to `sum`: the four f32 of an accumulator, whose meaning [`TakeKind::pixel_kind`] says.
/// Tables have at least two entries (without them the brick is empty).
#[must_use]
pub fn march_ray(bound: &Bindings<'_>, ray: &Ray, mut sum: Premul) -> (Premul, RayCounts) {
    let key = bound.key;
    let march = match (key.has_map(), key.leaps, key.take) {
        (false, false, TakeKind::Sampled) => counted::<Unmapped, Uncoded, Sampled>,
        (false, true, TakeKind::Sampled) => counted::<Unmapped, Leap, Sampled>,
        (true, false, TakeKind::Sampled) => counted::<Map, Uncoded, Sampled>,
        (true, true, TakeKind::Sampled) => counted::<Map, Leap, Sampled>,
        (false, false, TakeKind::Slabs(_)) => counted::<Unmapped, Uncoded, Slabs>,
        (false, true, TakeKind::Slabs(_)) => counted::<Unmapped, Leap, Slabs>,
        (true, false, TakeKind::Slabs(_)) => counted::<Map, Uncoded, Slabs>,
        (true, true, TakeKind::Slabs(_)) => counted::<Map, Leap, Slabs>,
        (false, false, TakeKind::Projection(_)) => counted::<Unmapped, Uncoded, Projection>,
        (false, true, TakeKind::Projection(_)) => counted::<Unmapped, Leap, Projection>,
        (true, false, TakeKind::Projection(_)) => counted::<Map, Uncoded, Projection>,
        (true, true, TakeKind::Projection(_)) => counted::<Map, Leap, Projection>,
    };
    let counts = march(bound, ray, &mut sum);
    (sum, counts)
}

fn counted<M: MapWalk, C: CodeWalk, T: Take>(bound: &Bindings<'_>, ray: &Ray, sum: &mut Premul) -> RayCounts {
    march::<M, C, T>(bound, ray, sum).map_or(RayCounts::default(), |(_, counts)| counts)
}

/// One invocation of the kernel that is joined from these parts; with the take as it was left. `None` where the ray
/// takes nothing.
pub fn march<M: MapWalk, C: CodeWalk, T: Take>(
    bound: &Bindings<'_>,
    ray: &Ray,
    sum: &mut Premul,
) -> Option<(T, RayCounts)> {
    let (frame, brick) = (bound.scene.frame, bound.brick);
    // Most rays of a tile miss most bricks.
    let at = Positions::new::<T>(bound, ray)?;
    if sum.a >= frame.stop_alpha || bound.scene.tables.table.len() < 2 {
        return None;
    }
    let along = &Along::new(bound, ray);
    let mut by_map = M::enter_map(bound, at.start);
    let mut by_code = C::enter_code(along);
    let mut taking = T::enter_take(along);
    let mut k = at.start;
    // The position before k was taken.
    let mut follows = false;
    let mut counts = RayCounts::default();
    while k < at.k_end && sum.a < frame.stop_alpha {
        // Always the product, never accumulated: the same sample in every brick.
        let p = T::Scene::place_at(along, k);
        let mut step = by_map.ask_map::<T>(bound, p, follows);
        counts.samples += by_code.ask_code(along, &mut step, p);
        let k_exit = at.ends_at(k, by_code.exit_of(along, &step, k));
        let k_next = if step.is_back {
            at.before(k)
        } else if step.jumps {
            k_exit
        } else {
            at.behind(k)
        };
        let n = k_next - k;
        let mut code = step.code;
        let mut in_region = step.is_deep || brick.region_flags == RegionFlags::EveryVoxel as u32;
        if !step.is_known {
            code = along.reader.read_volume(p) * brick.code_scale;
            counts.samples += 1;
            if bound.has_flags() {
                in_region = bound.data.flags[along.reader.nearest_index(p)] != 0;
                counts.samples += 1;
            }
        }
        // A place without data is no sample, and no slab ends or starts there.
        let is_taken = !(step.is_skip || is_no_data(code));
        let owns = n.min(at.k_out - k).max(0.0);
        let mut shows = false;
        if is_taken {
            let within = at.before(k_next) - k;
            let run = Run { k, n, within, owns, code, in_region, is_flat: step.is_flat, follows };
            shows = taking.take(along, p, run, sum);
        }
        by_map.leave_map::<T>(bound, &step, k, n, k_exit, shows);
        by_code.leave_code(&step, code);
        counts.skips += u32::from(step.is_by_map);
        counts.positions += if step.is_skip { 0 } else { owns as u32 };
        counts.leapt += if step.jumps && step.is_flat { n as u32 } else { 0 };
        follows = is_taken;
        k = k_next;
    }
    Some((taking, counts))
}

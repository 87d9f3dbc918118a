//! The ray loop on the processor: the twin's (`shaders/src/twin/march.rs`), for as many rays as lanes.
//!
//! The invariant: each lane does the operations of its ray in the twin's order, whatever the others do, and so has the
//! twin's bits; a lane that is not in a mask keeps all that it has. A turn first lets every lane jump over what is
//! empty until all have a position to take, then takes them together: reading costs the same for one lane as for all.

use brickcast_shaders::TakeKind;
use brickcast_shaders::layout::RegionFlags;
use brickcast_shaders::twin::bindings::{Bindings, RayCounts};

use super::lanes::{Floats, Lanes, Mask};
use super::probe::Probe;
use super::ray::{Rays, first_outside, first_sample};
use super::read::Reader;
use super::run::{Run, Step};
use super::slab::Sum;
use super::take::Take;
use super::walk::Walk;

/// Lanes that must ask the map wait until they are at least one to so many that can read: they ask one by one otherwise,
/// at one border of cells after the other, and asking costs the same for one lane as for all.
const WAIT_FOR: u32 = 2;

/// Takes what a brick adds along the `wanted` rays into `sum`.
#[inline(always)]
pub(crate) fn march<L: Lanes>(
    l: L,
    bound: &Bindings<'_>,
    reader: &Reader<'_>,
    (rays, wanted): (&Rays<L>, L::M),
    sum: &mut Sum<L>,
) -> RayCounts {
    let (frame, style, key) = (bound.scene.frame, bound.scene.style, bound.key);
    let mut counts = RayCounts::default();
    let (zero, one, none) = (l.splat(0.0), l.splat(1.0), l.mask(0));
    let stop = l.splat(frame.stop_alpha);
    let alive = wanted & sum[3].lt(stop);
    if !alive.any() {
        return counts;
    }
    let Some(mut owned) = rays.owned(l, frame, bound.brick, alive) else { return counts };
    let mut alive = owned.is_some;
    let is_styled = key.take != TakeKind::Sampled;
    let mut t_lo = zero;
    if is_styled && style.plane_count > 0 {
        let (lo, hi) = rays.clipped(l, style);
        owned.t_out = hi.smaller(owned.t_out);
        owned.k = L::F::select(zero.lt(lo), first_sample(l, frame, lo).larger(owned.k), owned.k);
        alive = alive & (owned.k * l.splat(frame.step)).lt(owned.t_out);
        if !alive.any() {
            return counts;
        }
        t_lo = lo;
    }
    let probe = &Probe { l, reader, rays, step: frame.step, style, is_styled, per_unit: frame.voxels_per_unit };
    // The first position that is not owned, and the first that is not visited.
    let k_out = first_outside(l, frame, owned.k, owned.t_out);
    let k_end = if key.take.ends_beyond() { k_out + one } else { k_out };
    // Nothing of rays that end before.
    let k_end = L::F::select(alive, k_end, zero);
    let mut walk = Walk::new(probe, bound, owned.k);
    let mut taking = Take::new(probe, bound, t_lo);
    let mut k = owned.k;
    let mut follows = none;
    let every = if bound.brick.region_flags == RegionFlags::EveryVoxel as u32 { !none } else { none };
    let has_flags = key.regions && bound.brick.region_flags == RegionFlags::Texture as u32;
    let fresh = Step::fresh(l, k);
    let mut step = fresh;
    loop {
        let mut live: L::M = k.lt(k_end) & sum[3].lt(stop);
        if key.has_map() {
            loop {
                let asks = live & walk.looks();
                let ready = live & !asks;
                if !asks.any() || asks.count() * WAIT_FOR < ready.count() {
                    live = ready;
                    break;
                }
                walk.ask_map(&mut step, (&mut k, k_end), &mut follows, (asks, &mut counts));
                live = k.lt(k_end) & sum[3].lt(stop);
            }
        } else {
            step = fresh;
        }
        if !live.any() {
            break;
        }
        let p = probe.place(k);
        if key.leaps {
            walk.ask_code(&mut step, p, (k, k_end), (live, &mut counts));
        }
        let n = L::F::select(step.jumps, step.k_exit - k, one);
        let mut code = step.code;
        let mut in_region = step.is_deep | every;
        let reads = live & !step.is_known;
        if reads.any() {
            code = L::F::select(reads, reader.read(l, p), code);
            counts.samples += reads.count();
            if has_flags {
                let flagged = reader.flagged(l, reader.nearest_index(l, p));
                in_region = (flagged & reads) | (in_region & !reads);
                counts.samples += reads.count();
            }
        }
        let owns = n.smaller(k_out - k).larger(zero);
        if (live & step.jumps).any() {
            counts.positions += total(l, live, owns);
            counts.leapt += total(l, live & step.jumps & step.is_flat, n);
        } else {
            counts.positions += (live & zero.lt(owns)).count();
        }
        // A place without data is no sample, and no slab ends or starts there.
        let taken = if reader.has_holes { live & zero.le(code) } else { live };
        let mut shows = none;
        if taken.any() {
            let run = Run { k, n, owns, code, in_region, is_flat: step.is_flat, follows };
            shows = taking.take(p, &run, taken, sum);
        }
        if key.has_map() {
            walk.leave_map(&step, (k, n), shows, live);
        }
        if key.leaps {
            walk.leave_code(&step, code, live);
        }
        step.forget(live);
        follows = (taken & live) | (follows & !live);
        k = L::F::select(live, k + n, k);
    }
    counts
}

/// Of whole numbers, where wanted.
#[inline(always)]
pub(crate) fn total<L: Lanes>(l: L, wanted: L::M, n: L::F) -> u32 {
    let n = l.store_int(L::F::select(wanted, n, l.splat(0.0)).cut_off());
    n[..L::N].iter().sum::<i32>() as u32
}

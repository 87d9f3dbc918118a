//! The ray loop on the processor: the twin's (`shaders/src/twin/march.rs`), for as many rays as lanes.
//!
//! The invariant: each lane does the operations of its ray in the twin's order, whatever the others do, and so has the
//! twin's bits; a lane that is not in a mask keeps all that it has. A turn first lets every lane jump over what is
//! empty until all have a position to take, then takes them together: reading costs the same for one lane as for all.

use brickcast_shaders::TakeKind;
use brickcast_shaders::layout::RegionFlags;
use brickcast_shaders::twin::bindings::{Bindings, RayCounts};

use super::counts::Counts;
use super::known::Known;
use super::lanes::{Floats, Ints, Lanes, Mask};
use super::positions::{Borders, Positions};
use super::probe::Probe;
use super::ray::{Rays, first_sample};
use super::read::Reader;
use super::run::{Run, Step};
use super::slab::Sum;
use super::slab_table::Slabs;
use super::take::Take;
use super::walk::Walk;

/// What a brick adds to `sum` along the `wanted` rays.
#[inline(always)]
pub(crate) fn march<L: Lanes, K: Known>(
    _: K,
    l: L,
    bound: &Bindings<'_>,
    reader: &Reader<'_>,
    (rays, wanted): (&Rays<L>, L::M),
    mut sum: Sum<L>,
) -> (Sum<L>, RayCounts) {
    let (frame, style, key) = (bound.scene.frame, bound.scene.style, K::key(bound.key));
    let (of_brick, reader, rays) = (reader, K::reader(*reader), *rays);
    let mut counts = Counts::none(l);
    let (zero, none) = (l.splat(0.0), l.mask(0));
    let stop = l.splat(frame.stop_alpha);
    let alive = wanted & sum[3].lt(stop);
    if !alive.any() {
        return (sum, counts.total(l));
    }
    let borders = key.borders.then(|| Borders::new(l, bound, of_brick, &rays));
    let Some(mut owned) = (match &borders {
        None => rays.owned(l, frame.step, bound.brick, alive),
        Some(borders) => borders.owned(alive),
    }) else {
        return (sum, counts.total(l));
    };
    let mut alive = owned.is_some;
    let is_styled = key.take != TakeKind::Sampled;
    let mut t_lo = zero;
    if is_styled && style.plane_count > 0 {
        let (lo, hi) = rays.clipped(l, style);
        owned.t_out = hi.smaller(owned.t_out);
        owned.k = L::F::select(zero.lt(lo), first_sample(l, frame.step, lo).larger(owned.k), owned.k);
        alive = alive & (owned.k * l.splat(frame.step)).lt(owned.t_out);
        if !alive.any() {
            return (sum, counts.total(l));
        }
        t_lo = lo;
    }
    let probe = &Probe { l, reader, rays: &rays, step: frame.step, style, is_styled, per_unit: frame.voxels_per_unit };
    let at = Positions::new(l, frame.step, key, (&owned, alive), borders.as_ref());
    let k_end = at.k_end;
    let slabs = Slabs::of(l, bound, key.take.slab_kind());
    let mut walk = Walk::<L, K>::new(probe, bound, at, owned.k);
    let mut taking = Take::<L, K>::new(probe, bound, slabs.as_ref(), t_lo);
    let mut k = owned.k;
    let mut follows = none;
    let every = if bound.brick.region_flags == RegionFlags::EveryVoxel as u32 { !none } else { none };
    let has_flags = key.regions && bound.brick.region_flags == RegionFlags::Texture as u32;
    // Which rays had not stopped a turn ago: where a ray is must not wait for what it adds (docs/adr/0015-lanes.md).
    let mut went_on = alive;
    // May something be known of positions before they are read?
    let may_know = key.leaps || (K::has_map(key) && (key.cubes || key.take.is_projection()));
    // A position's value is asked for a turn before it is taken: what memory takes its time for is not waited for.
    let mut has_ahead = K::READS_AHEAD && !K::has_map(key);
    let mut ahead = if has_ahead { reader.read(l, probe.place(k)) } else { zero };
    let mut next = k;
    loop {
        let goes_on = sum[3].lt(stop);
        let mut live: L::M = k.lt(k_end) & goes_on;
        if !live.any() {
            break;
        }
        let mut step = Step {
            code: zero,
            is_known: none,
            jumps: none,
            k_exit: k,
            looked: none,
            is_by_map: none,
            is_deep: none,
            is_flat: none,
        };
        if K::has_map(key) {
            let walking = k.lt(k_end) & went_on;
            live = walk.ask_map(&mut step, &mut k, &mut follows, (walking, live), &mut counts);
            if !live.any() {
                break;
            }
        }
        went_on = goes_on;
        let p = probe.place(k);
        if key.leaps {
            walk.ask_code(&mut step, p, k, (live, &mut counts));
        }
        let n = at.run(k, step.jumps, step.k_exit);
        let mut code = step.code;
        let mut in_region = step.is_deep | every;
        let reads = live & !step.is_known;
        if reads.any() {
            // The map may have led some ray elsewhere.
            let may_differ = K::has_map(key) || key.borders;
            let is_next = K::READS_AHEAD && (!may_differ || !(live & !k.same(next)).any());
            let read = if is_next && has_ahead { ahead } else { reader.read(l, p) };
            let behind = at.behind(k);
            if is_next {
                ahead = reader.read(l, probe.place(behind));
            }
            (has_ahead, next) = (is_next, behind);
            code = if may_know { L::F::select(reads, read, code) } else { read };
            counts.samples = counts.samples.count(reads);
            if has_flags {
                let flagged = reader.flagged(l, reader.nearest_index(l, p));
                in_region = (flagged & reads) | (in_region & !reads);
                counts.samples = counts.samples.count(reads);
            }
        }
        let owns = n.smaller(at.k_out - k).larger(zero);
        let jumps = key.borders || (live & step.jumps).any();
        if jumps {
            counts.positions = counts.positions + owns.only(live).cut_off();
            counts.leapt = counts.leapt + n.only(live & step.jumps & step.is_flat).cut_off();
        } else {
            let owned = if key.take.ends_beyond() { live & zero.lt(owns) } else { live };
            counts.positions = counts.positions.count(owned);
        }
        // A place without data is no sample, and no slab ends or starts there.
        let taken = if reader.has_holes { live & zero.le(code) } else { live };
        let mut shows = none;
        if taken.any() {
            let within = at.within(k, n);
            let run = Run { k, n, within, owns, jumps, code, in_region, is_flat: step.is_flat, follows };
            shows = taking.take(p, &run, taken, &mut sum);
        }
        if K::has_map(key) {
            walk.leave_map(&step, (k, n), shows);
        }
        if key.leaps {
            walk.leave_code(&step, code);
        }
        follows = taken;
        // Rays that have ended or stopped go on, too, and take nothing.
        k = k + n;
    }
    (sum, counts.total(l))
}

//! What most pictures are made of, by itself: pre-integrated slabs in a brick without leaps. The same as
//! [`super::march::march_ray`], without what that must ask at every sample.

use brickcast_volume::Premul;
use brickcast_volume::macrocell::MapTexel;
use glam::Vec4;

use super::bindings::{Bindings, RayCounts, SlabTable};
use super::jump::{first_outside, leaves};
use super::lanes::{self, entries_at};
use super::processor::{cut_off, indices, prefetch, whole};
use super::ray::{FAR, Ray, first_sample, owned_segment, rounded_up};
use super::read::{Reader, clamped};
use super::scene::styled::clip_span;
use crate::key::{SlabKind, TakeKind};
use crate::layout::{FrameUniform, RegionFlags, SHOWS_REGIONS, SHOWS_RESIDUAL};

/// Values that are read ahead of the slabs that need them, to hide latency: a read and a table look-up are each a chain
/// of dependent loads, longer than the window in which a processor executes out of order, so that only independent
/// ones side by side overlap.
const BATCH: usize = 8;
/// Values read ahead where a run may end with any slab: a vector of them, since what lies behind its end is read in
/// vain.
const OPEN_BATCH: f32 = 4.0;

const SLABS_ALONE: TakeKind = TakeKind::Slabs(SlabKind { preintegrated: true, light: None, surfaces: false });

/// True where [`slabs_ray`] will do.
#[must_use]
pub fn are_slabs_alone(bound: &Bindings<'_>) -> bool {
    let key = bound.key;
    key.take == SLABS_ALONE
        && bound.scene.slabs.is_some()
        && !key.leaps
        && !key.cubes
        && !key.holes
        && bound.brick.region_flags != RegionFlags::Texture as u32
}

/// The first sample at or behind `t`, but for rounding: never more than `most`.
#[inline(always)]
fn sample_at(frame: &FrameUniform, t: f32, most: f32) -> f32 {
    rounded_up((t / frame.step).min(most))
}

impl SlabTable<'_> {
    /// [`super::slab::node_of`] in every lane.
    #[inline(always)]
    fn entries(&self, codes: Vec4) -> (Vec4, Vec4) {
        let blocks = self.warp.len() as f32;
        let at = lanes::clamped(codes * Vec4::splat(self.scale), blocks);
        let i = whole(at).min(Vec4::splat(blocks - 1.0));
        let of = indices(i).map(|i| self.warp.get(i).copied().unwrap_or_default());
        let start = Vec4::new(of[0][0], of[1][0], of[2][0], of[3][0]);
        let growth = Vec4::new(of[0][1], of[1][1], of[2][1], of[3][1]);
        entries_at(start + (at - i) * growth, self.size - 1)
    }

    /// Do slabs from entries within lo..=hi to such show anything?
    #[inline(always)]
    fn shows(&self, lo: usize, hi: usize) -> bool {
        self.shown_before.get(hi + 2).is_none_or(|after| *after != self.shown_before[lo])
    }

    /// Says that the slab between two entries will be looked up.
    #[inline(always)]
    fn prefetch(&self, i: usize, j: usize) {
        for row in [i, i + 1] {
            prefetch(self.front.as_ptr().wrapping_add(row * self.size + j));
        }
    }

    /// Bilinear.
    #[inline(always)]
    fn between(&self, table: &[[f32; 4]], (i, u): (usize, f32), (j, v): (usize, f32)) -> Vec4 {
        let at = i * self.size + j;
        let Some(support) = table.get(at..at + self.size + 2) else { return Vec4::ZERO };
        let [a, b] = [support[0], support[1]].map(Vec4::from_array);
        let [c, d] = [support[self.size], support[self.size + 1]].map(Vec4::from_array);
        let (near, far) = (a + (b - a) * v, c + (d - c) * v);
        near + (far - near) * u
    }
}

/// The slabs of a brick along `ray`, into `sum`; where [`are_slabs_alone`].
#[must_use]
pub fn slabs_ray(bound: &Bindings<'_>, ray: &Ray, sum: Premul) -> (Premul, RayCounts) {
    let mut counts = RayCounts::default();
    let (frame, style, brick, data) = (bound.scene.frame, bound.scene.style, bound.brick, bound.data);
    let (Some(mut owned), Some(slabs)) = (owned_segment(frame, brick, ray), &bound.scene.slabs) else {
        return (sum, counts);
    };
    if style.plane_count > 0 {
        let (t_lo, t_hi) = clip_span(style, ray);
        owned.t_out = owned.t_out.min(t_hi);
        if t_lo > 0.0 {
            owned.k = owned.k.max(first_sample(frame, t_lo));
        }
    }
    if sum.a >= frame.stop_alpha || owned.k * frame.step >= owned.t_out {
        return (sum, counts);
    }
    let kind = bound.key.regions && brick.region_flags == RegionFlags::EveryVoxel as u32;
    let shows = frame.shown & if kind { SHOWS_REGIONS } else { SHOWS_RESIDUAL } != 0;
    let table = &slabs[usize::from(kind)];
    let volume = Reader::new(frame, brick, data.texels);
    let hi = style.volume_hi.map(|n| n as f32);
    let ([ox, oy, oz], [dx, dy, dz]) = (ray.origin, ray.direction);
    let k_out = first_outside(frame, owned.k, owned.t_out);
    let edge = (1_u32 << brick.cell_shift) as f32;

    // The position at sample k; the last one may lie outside the volume.
    let place = |k: f32| {
        // Always the product, never accumulated: the same sample in every brick.
        let t = k * frame.step;
        let p = [ox + t * dx, oy + t * dy, oz + t * dz];
        if k == k_out { std::array::from_fn(|a| clamped(p[a], hi[a])) } else { p }
    };
    // The codes at k and the three samples after.
    let codes = |k: f32| {
        let ks = Vec4::splat(k) + Vec4::new(0.0, 1.0, 2.0, 3.0);
        let t = ks * Vec4::splat(frame.step);
        let mut p = [Vec4::splat(ox) + t * dx, Vec4::splat(oy) + t * dy, Vec4::splat(oz) + t * dz];
        if k + 3.0 >= k_out {
            let is_last = ks.cmpge(Vec4::splat(k_out));
            p = std::array::from_fn(|a| Vec4::select(is_last, lanes::clamped(p[a], hi[a]), p[a]));
        }
        volume.read_lanes(p) * Vec4::splat(brick.code_scale)
    };

    let mut k = owned.k;
    let mut total = Vec4::from_array(sum.to_array());
    // The entry at the position before, and whether that lies in an empty cell.
    let mut front: (usize, f32) = (0, 0.0);
    let (mut has_front, mut front_is_empty, mut has_skipped) = (false, false, false);
    while k <= k_out && total.w < frame.stop_alpha {
        let (mut k_look, mut is_empty) = (FAR, false);
        if let Some((map, dims)) = data.map {
            let p: [f32; 3] = place(k);
            let cell: [i32; 3] = std::array::from_fn(|a| {
                ((cut_off(p[a]) >> brick.cell_shift) - brick.cell_lo[a]).clamp(0, dims[a] as i32 - 1)
            });
            let at = cell[0] as usize + dims[0] as usize * (cell[1] as usize + dims[1] as usize * cell[2] as usize);
            let empty = i32::from(MapTexel::unpack(map[at]).empty);
            is_empty = empty > 0;
            let center = std::array::from_fn(|a| ((cell[a] + brick.cell_lo[a]) as f32 + 0.5) * edge);
            let half = (empty.max(1) as f32 - 0.5) * edge;
            let k_exit = sample_at(frame, leaves(ray, center, half), k_out + 1.0).max(k + 1.0);
            if is_empty && (!has_front || front_is_empty) {
                counts.skips += 1;
                (k, has_front, has_skipped) = (k_exit, false, true);
                continue;
            }
            k_look = if is_empty { k + 1.0 } else { k_exit };
            if !is_empty && has_skipped {
                // The slab that ends here starts in the empty cell.
                counts.skips += 1;
                (k, has_skipped) = (k - 1.0, false);
            }
        }
        // Slabs until the map may say something new.
        let k_first = k;
        'run: loop {
            // Beyond `k_look` a run ends with the first slab that shows nothing: a few reads may be in vain.
            let known = if k < k_look { k_look - k } else { OPEN_BATCH };
            let n = cut_off(known.min(k_out + 1.0 - k).min(BATCH as f32)).max(1) as usize;
            counts.samples += n as u32;
            let mut backs = [(0, 0.0); BATCH];
            let mut shown = [false; BATCH];
            let mut before = has_front.then_some(front.0);
            for (first, (backs, shown)) in
                (0..n).step_by(4).zip(backs.chunks_exact_mut(4).zip(shown.chunks_exact_mut(4)))
            {
                let (entries, weights) = table.entries(codes(k + first as f32));
                let ends = indices(entries).into_iter().zip(weights.to_array());
                for ((back, shown), end) in backs.iter_mut().zip(shown).zip(ends) {
                    *back = end;
                    if let Some(before) = before {
                        *shown = shows && table.shows(before.min(end.0), before.max(end.0));
                        if *shown {
                            table.prefetch(before, end.0);
                        }
                    }
                    before = Some(end.0);
                }
            }
            if !shown[..n].contains(&true) {
                // Nothing to add: the run goes on, or ends with its first slab beyond `k_look`.
                let n = if k < k_look { n } else { 1 };
                (front, has_front) = (backs[n - 1], true);
                k += n as f32;
                if k > k_out || k >= k_look {
                    break 'run;
                }
                continue;
            }
            for (&back, shown) in backs[..n].iter().zip(shown) {
                let mut opacity = 0.0;
                if shown {
                    let slab = table.between(table.front, front, back);
                    // Adding nothing changes no bit.
                    total += (1.0 - total.w) * slab;
                    opacity = slab.w;
                }
                k += 1.0;
                (front, has_front) = (back, true);
                if k > k_out || total.w >= frame.stop_alpha || (k >= k_look && opacity <= 0.0) {
                    break 'run;
                }
            }
        }
        counts.positions += (k.min(k_out) - k_first) as u32;
        front_is_empty = is_empty && k == k_first + 1.0;
    }
    (Premul::from_array(total.to_array()), counts)
}

#[cfg(test)]
mod tests {
    use brickcast_volume::macrocell::Macrocells;
    use brickcast_volume::preintegration::Preintegrated;
    use brickcast_volume::style::{Clip, ClipPlane, Integration, Style, TableSize};
    use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
    use brickcast_volume::{Camera, Geometry, Orbit, OwnedBox, PictureSize, View};
    use glam::{DVec3, UVec3};

    use super::super::bindings::{BrickData, SceneData, Tables};
    use super::super::macrocell::empty_distances;
    use super::super::march::march_ray;
    use super::super::ray::pixel_ray;
    use super::*;
    use crate::key::KernelKey;
    use crate::layout::BrickUniform;
    use crate::style::StyleUniform;

    /// A few balls in air that is not quite empty.
    fn code(x: i32, y: i32, z: i32) -> u16 {
        let hash = (x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791)) as u32;
        let (a, b, c) = (x.rem_euclid(11) - 5, y.rem_euclid(9) - 4, z.rem_euclid(13) - 6);
        let ball = if a * a + b * b + c * c < 9 { 30_000 } else { 2000 };
        ball + (hash.wrapping_mul(0x9e37_79b1) >> 20) as u16
    }

    #[test]
    fn alone_or_with_everything_else_slabs_are_the_same() {
        let geometry = Geometry::new([40; 3], [1.0, 1.5, 0.75], [0.0; 3]).unwrap();
        let colors = vec![ColorPoint { x: 0.0, rgb: [0.2, 0.5, 1.0] }, ColorPoint { x: 1.0, rgb: [1.0, 0.5, 0.0] }];
        let opacities = vec![OpacityPoint { x: 0.15, opacity: 0.0 }, OpacityPoint { x: 0.6, opacity: 0.5 }];
        let function = TransferFunction::new(colors, opacities).unwrap();
        let owned = OwnedBox { lo: UVec3::new(8, 0, 16), hi: UVec3::new(32, 24, 40) };
        let normal = DVec3::new(0.3, -0.6, 1.0);
        let plane = ClipPlane { normal, offset: normal.dot(geometry.center_world()) - 3.3 };
        let clip = Clip { bounds: None, planes: vec![plane] };
        let (mut skips, mut opaque, mut samples, mut in_vain) = (0, 0, 0, 0);
        for (step, azimuth, clip) in [(0.5, 20.0, Clip::default()), (1.0, 130.0, clip.clone()), (2.0, 250.0, clip)] {
            let integration = Integration::Preintegrated(TableSize::N256);
            let scene = Style { integration, clip, ..Style::default() };
            let stored = owned.stored(scene.ghost(step));
            let reach = UVec3::splat(scene.reach(step));
            let cells_of = OwnedBox { lo: owned.lo.saturating_sub(reach), hi: owned.hi + reach };
            let clamp = |i: i32| i.clamp(0, 39);
            let texels: Vec<u16> = (stored.lo.z..stored.hi.z)
                .flat_map(|z| (stored.lo.y..stored.hi.y).map(move |y| (y, z)))
                .flat_map(|(y, z)| (stored.lo.x..stored.hi.x).map(move |x| code(clamp(x), clamp(y), clamp(z))))
                .collect();
            let table = TransferTable::with_entries(&function, (0.0, 1.0), step, 256);
            let slabs = Preintegrated::with_entries(&function, (0.0, 1.0), step, 256, false);
            let cells = Macrocells::of(&cells_of, &stored, &texels, 4);
            let distances = empty_distances(&table.opaque_counts(), &cells.ranges, cells.dims.into());
            let map: Vec<u32> = distances.into_iter().map(u32::from).collect();
            let camera = Camera::orbit(&geometry, Orbit { azimuth, elevation: 31.0, ..Orbit::default() }).unwrap();
            let view = View::new(&geometry, &camera, PictureSize::new(80, 80).unwrap(), step).unwrap();
            let frame = FrameUniform::new(&view.kernel(), &table, 0.999);
            let mut brick = BrickUniform::of_boxes(&owned, &stored);
            (brick.cell_lo, brick.cell_shift) = (cells.lo.into(), 2);
            let style = StyleUniform::new(&scene, &geometry, (0.0, 1.0));
            let slab = SlabTable::new(&slabs, [&slabs.total, &[]]);
            let tables = Tables { table: &table.entries, region: None };
            let scene = SceneData { frame: &frame, style: &style, tables, slabs: Some([slab; 2]) };
            for map in [None, Some((map.as_slice(), cells.dims.into()))] {
                let data = BrickData { texels: &texels, means: None, map, flags: &[] };
                let key = KernelKey { skips: map.is_some(), take: SLABS_ALONE, ..KernelKey::PLAIN };
                let bound = Bindings { scene: &scene, brick: &brick, data, key };
                assert!(are_slabs_alone(&bound));
                for (x, y) in (0..80).flat_map(|y| (0..80).map(move |x| (x, y))) {
                    let ray = pixel_ray(&frame, x, y);
                    let (sum, counts) = slabs_ray(&bound, &ray, Premul::CLEAR);
                    let (want, counted) = march_ray(&bound, &ray, Premul::CLEAR);
                    let worst =
                        sum.to_array().iter().zip(want.to_array()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    // Positions on the volume's faces are clamped by the one and not by the other.
                    assert!(worst < 1e-6, "({x}, {y}), step {step}: {sum:?} {want:?}");
                    let [ours, theirs] = [counts, counted].map(|c| (c.positions, c.leapt, c.skips));
                    assert_eq!(ours, theirs, "({x}, {y}), step {step}");
                    // A run reads one that counts, and up to three in vain; the last one of an opaque ray up to seven.
                    let vain = counts.samples.checked_sub(counted.samples);
                    assert!(vain.is_some_and(|n| n <= 3 * counted.samples + 7), "{counts:?} {counted:?}");
                    (samples, in_vain) = (samples + counted.samples, in_vain + vain.unwrap_or(0));
                    skips += counts.skips;
                    opaque += u32::from(sum.a > 0.5);
                }
            }
        }
        assert!(skips > 1000 && opaque > 1000, "{skips} {opaque}");
        assert!(in_vain > 0 && in_vain * 4 < samples, "{in_vain} {samples}");
    }

    #[test]
    fn what_is_not_looked_up_shows_nothing() {
        let color = |x: f64| ColorPoint { x, rgb: [0.5, 0.25, 1.0] };
        // A ramp, two spikes, and a last one that rises.
        let opacity = |(x, opacity): (f64, f64)| OpacityPoint { x, opacity };
        let points =
            [(0.0, 0.3), (10.0, 0.0), (20.2, 0.0), (20.5, 0.9), (20.8, 0.0), (40.0, 0.0), (41.0, 0.2), (42.0, 0.0)];
        let points = points.into_iter().chain([(62.5, 0.0), (63.0, 0.5)]);
        let function = TransferFunction::new(vec![color(0.0), color(63.0)], points.map(opacity).collect()).unwrap();
        let slabs = Preintegrated::with_entries(&function, (0.0, 63.0), 1.0, 64, false);
        let n = slabs.size;
        let table = SlabTable::new(&slabs, [&slabs.total, &[]]);
        let (mut dark, mut shown) = (0, 0);
        for (front, back) in (0..n - 1).flat_map(|front| (0..n - 1).map(move |back| (front, back))) {
            let entries = [(0, 0), (0, 1), (1, 0), (1, 1)];
            let is_dark = entries.iter().all(|(i, j)| slabs.total[(front + i) * n + back + j] == [0.0; 4]);
            let shows = table.shows(front.min(back), front.max(back));
            assert!(is_dark || shows, "slab from entry {front} to {back}");
            dark += u32::from(is_dark);
            shown += u32::from(is_dark && shows);
        }
        // Those that end just before something shows are looked up for nothing.
        assert!(dark > 100 && shown * 5 < dark, "{shown} of {dark} of {n} nodes");
    }
}

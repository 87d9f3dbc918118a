//! What most pictures are made of, by itself: pre-integrated slabs in a brick without leaps. The same as
//! [`super::integral::integral_ray`], without what that must ask at every sample.

use brickcast_volume::Premul;
use brickcast_volume::macrocell::MapTexel;
use glam::Vec4;

use super::accelerated::{BrickData, RayCounts, first_outside, leaves, sample_at};
use super::integral::{Integrals, clipped};
use super::lanes;
use super::processor::{cut_off, indices};
use super::raycast::{FAR, Ray, VolumeReader, clamped, first_sample, owned_segment};
use crate::key::{SlabKind, TakeKind};
use crate::layout::{BrickUniform, FrameUniform, MAP_EMPTY, RegionFlags, SHOWS_REGIONS, SHOWS_RESIDUAL};

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
pub fn are_slabs_alone(brick: &BrickUniform, data: &BrickData<'_>, with: &Integrals<'_>) -> bool {
    with.take == SLABS_ALONE
        && with.slabs.is_some()
        && data.means.is_none()
        && brick.region_flags != RegionFlags::Texture as u32
        && brick.map_mask <= MAP_EMPTY
        && brick.holes == 0
}

/// The slabs of `brick` along `ray`, into `sum`; where [`are_slabs_alone`].
#[must_use]
pub fn slabs_ray(
    frame: &FrameUniform,
    brick: &BrickUniform,
    data: &BrickData<'_>,
    with: &Integrals<'_>,
    ray: &Ray,
    sum: Premul,
) -> (Premul, RayCounts) {
    let mut counts = RayCounts::default();
    let (Some(mut owned), Some(slabs)) = (owned_segment(frame, brick, ray), &with.slabs) else { return (sum, counts) };
    let style = with.style;
    if style.plane_count > 0 {
        let (t_lo, t_hi) = clipped(style, ray);
        owned.t_out = owned.t_out.min(t_hi);
        if t_lo > 0.0 {
            owned.k = owned.k.max(first_sample(frame, t_lo));
        }
    }
    if sum.a >= frame.stop_alpha || owned.k * frame.step >= owned.t_out {
        return (sum, counts);
    }
    let in_region = brick.region_flags == RegionFlags::EveryVoxel as u32;
    let tells_apart = frame.shown != SHOWS_RESIDUAL | SHOWS_REGIONS || with.tables.region.is_some();
    let kind = in_region && tells_apart;
    let shows = frame.shown & if kind { SHOWS_REGIONS } else { SHOWS_RESIDUAL } != 0;
    let table = &slabs[usize::from(kind)];
    let volume = VolumeReader::new(frame, brick, data.texels);
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
            let empty = i32::from(MapTexel::unpack(map[at] & brick.map_mask).empty);
            is_empty = empty > 0;
            let reach = empty.max(1) - 1;
            let corner = |far: i32| std::array::from_fn(|a| (cell[a] + brick.cell_lo[a] + far) as f32 * edge);
            let k_exit = sample_at(frame, leaves(ray, corner(-reach), corner(1 + reach)), k_out + 1.0).max(k + 1.0);
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

    use super::super::accelerated::{Tables, Unwatched};
    use super::super::integral::integral_ray;
    use super::super::macrocell::empty_distances;
    use super::super::raycast::pixel_ray;
    use super::super::slab::SlabTable;
    use super::*;
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
            (brick.cell_lo, brick.cell_shift, brick.map_mask) = (cells.lo.into(), 2, MAP_EMPTY);
            let style = StyleUniform::new(&scene, &geometry, (0.0, 1.0));
            let slab = SlabTable::new(&slabs, [&slabs.total, &[]]);
            let tables = Tables { table: &table.entries, region: None };
            let with = Integrals { tables, slabs: Some([slab; 2]), style: &style, take: SLABS_ALONE };
            for map in [None, Some((map.as_slice(), cells.dims.into()))] {
                let data = BrickData { texels: &texels, means: None, map, flags: &[] };
                assert!(are_slabs_alone(&brick, &data, &with));
                for (x, y) in (0..80).flat_map(|y| (0..80).map(move |x| (x, y))) {
                    let ray = pixel_ray(&frame, x, y);
                    let (sum, counts) = slabs_ray(&frame, &brick, &data, &with, &ray, Premul::CLEAR);
                    let (want, counted) =
                        integral_ray(&frame, &brick, &data, &with, &ray, Premul::CLEAR, &mut Unwatched);
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
}

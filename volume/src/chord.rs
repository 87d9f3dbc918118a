//! How much of a pixel's ray lies in a box: for estimates, not for rendering.

use glam::{DVec2, DVec3};

use crate::brick::OwnedBox;
use crate::visibility::{KernelView, PixelRect};

/// About how many samples rays take in `voxels` (index space) within `rect`, where they read every step: the sum of
/// chords in steps over the pixels, integrated over a lattice of about `rays` rays.
#[must_use]
pub fn expected_samples(view: &KernelView, rect: &PixelRect, voxels: &OwnedBox, rays: u32) -> f64 {
    if rect.is_empty() {
        return 0.0;
    }
    let stride = (rect.pixel_count() as f64 / f64::from(rays.max(1))).sqrt().floor().max(1.0) as u32;
    // Strips of nearly equal width, each stood for by its middle.
    let strips = |lo: u32, hi: u32| {
        let count = (hi - lo).div_ceil(stride);
        (0..count).map(move |i| {
            let (from, to) = (lo + (hi - lo) * i / count, lo + (hi - lo) * (i + 1) / count);
            ((from + to) / 2, f64::from(to - from))
        })
    };
    let row = |(y, height): (u32, f64)| -> f64 {
        let pixel = |(x, width): (u32, f64)| chord(view, x, y, voxels).unwrap_or(0.0).max(0.0) * width;
        strips(rect.lo.x, rect.hi.x).map(pixel).sum::<f64>() * height
    };
    strips(rect.lo.y, rect.hi.y).map(row).sum()
}

/// The chord of a pixel's ray in steps, negative where it passes by.
fn chord(view: &KernelView, x: u32, y: u32, voxels: &OwnedBox) -> Option<f64> {
    let size = DVec2::new(f64::from(view.width), f64::from(view.height));
    let (u, v) = ((f64::from(x) + 0.5) * 2.0 / size.x - 1.0, 1.0 - (f64::from(y) + 0.5) * 2.0 / size.y);
    let q = view.ray_right.as_dvec3() * u + view.ray_up.as_dvec3() * v;
    let (eye, forward) = (view.eye.as_dvec3(), view.ray_forward.as_dvec3());
    let direction = if view.parallel { forward } else { (forward + q).normalize() };
    let aside = if view.parallel { q } else { direction - forward };
    let (origin, direction) = (eye + aside * view.fan.as_dvec3(), direction * view.voxels_per_unit.as_dvec3());
    let (lo, hi) = (voxels.lo.as_dvec3(), voxels.hi.as_dvec3());
    let (mut enter, mut leave) = (0.0_f64, f64::MAX);
    for a in 0..3 {
        if direction[a].abs() < 1e-12 {
            // Rounding may move the ray across a face: what touches counts.
            if origin[a] < lo[a] - 1e-3 || origin[a] > hi[a] + 1e-3 {
                return None;
            }
            continue;
        }
        let ends = DVec3::new(lo[a], hi[a], 0.0).map(|plane| (plane - origin[a]) / direction[a]);
        enter = enter.max(ends.x.min(ends.y));
        leave = leave.min(ends.x.max(ends.y));
    }
    Some((leave - enter) / f64::from(view.step))
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;
    use crate::{Camera, Geometry, Orbit, PictureSize, View};

    #[test]
    fn straight_through_the_middle_is_the_box_in_steps() {
        let geometry = Geometry::new([32; 3], [1.0; 3], [0.0; 3]).unwrap();
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let view = View::new(&geometry, &camera, PictureSize::new(33, 33).unwrap(), 0.5).unwrap().kernel();
        let whole = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(32) };
        let steps = |x, y, voxels: &OwnedBox| chord(&view, x, y, voxels).map_or(0.0, |chord| chord.max(0.0));
        let middle = steps(16, 16, &whole);
        assert!((63.0..=66.0).contains(&middle), "{middle}");
        // Far from the middle, where rays no longer start at the eye: the box's own corner, in perspective.
        let corners = [(0, 0), (32, 0), (0, 32), (32, 32)];
        assert!(corners.into_iter().all(|(x, y)| steps(x, y, &whole) <= 1.0));
        let across: u32 = (0..33).map(|x| u32::from(steps(x, 16, &whole) > 59.0)).sum();
        assert!((12..=20).contains(&across), "{across} of 33 pixels see the box");
        let inner = OwnedBox { lo: UVec3::splat(12), hi: UVec3::splat(20) };
        assert!(steps(0, 0, &inner) == 0.0 && (15.0..18.0).contains(&steps(16, 16, &inner)));
    }

    /// Far away, a box of V voxels, seen by parallel rays of one pixel a voxel, has V / step samples; a coarse lattice
    /// finds them, too.
    #[test]
    fn expected_samples_are_the_boxs_volume() {
        let geometry = Geometry::new([64; 3], [1.0; 3], [0.0; 3]).unwrap();
        let middle = geometry.center_world();
        for eye in [DVec3::new(0.3, 0.2, 1.0), DVec3::new(1.0, 1.0, 1.0), DVec3::new(0.1, 0.9, 0.3)] {
            let parallel = crate::Projection::Parallel { parallel_scale: 100.0 };
            let camera = Camera::new(middle + eye * 300.0, middle, DVec3::new(0.1, 1.0, 0.2), parallel).unwrap();
            let view = View::new(&geometry, &camera, PictureSize::new(200, 200).unwrap(), 0.5).unwrap();
            let voxels = OwnedBox { lo: UVec3::new(10, 20, 0), hi: UVec3::new(40, 36, 60) };
            let want = voxels.voxel_count() as f64 / 0.5;
            for rays in [1 << 20, 256, 64] {
                let got = expected_samples(&view.kernel(), &view.project(&voxels), &voxels, rays);
                let tolerance = if rays == 1 << 20 { 0.01 } else { 0.1 };
                assert!((got / want - 1.0).abs() < tolerance, "{eye} {rays}: {got} for {want}");
            }
        }
    }

    /// From inside, only what lies before the eye counts.
    #[test]
    fn an_eye_inside_sees_the_rest_of_the_box() {
        let geometry = Geometry::new([64; 3], [1.0; 3], [0.0; 3]).unwrap();
        let middle = geometry.center_world();
        let narrow = crate::Projection::Perspective { view_angle: 0.1 };
        let camera = Camera::new(middle, middle + DVec3::Z, DVec3::Y, narrow).unwrap();
        let view = View::new(&geometry, &camera, PictureSize::new(8, 8).unwrap(), 1.0).unwrap();
        let whole = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(64) };
        let got = expected_samples(&view.kernel(), &view.project(&whole), &whole, 64) / 64.0;
        assert!((got - 32.0).abs() < 1.0, "{got}");
    }
}

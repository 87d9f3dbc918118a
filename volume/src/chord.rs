//! How much of a pixel's ray lies in a box: for bounds and estimates, not for rendering.

use glam::{DVec2, DVec3};

use crate::brick::OwnedBox;
use crate::visibility::KernelView;

/// The most samples that the ray through the centre of pixel (x, y) can take in `voxels`: its chord in steps, and one.
#[must_use]
pub fn most_samples(view: &KernelView, x: u32, y: u32, voxels: &OwnedBox) -> u32 {
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
                return 0;
            }
            continue;
        }
        let ends = DVec3::new(lo[a], hi[a], 0.0).map(|plane| (plane - origin[a]) / direction[a]);
        enter = enter.max(ends.x.min(ends.y));
        leave = leave.min(ends.x.max(ends.y));
    }
    let chord = (leave - enter) / f64::from(view.step);
    if chord < -0.01 { 0 } else { (chord.max(0.0) + 0.01).ceil() as u32 + 1 }
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
        let middle = most_samples(&view, 16, 16, &whole);
        assert!((64..=67).contains(&middle), "{middle}");
        // Far from the middle, where rays no longer start at the eye: the box's own corner, in perspective.
        let corners = [(0, 0), (32, 0), (0, 32), (32, 32)];
        assert!(corners.into_iter().all(|(x, y)| most_samples(&view, x, y, &whole) <= 2));
        let across: u32 = (0..33).map(|x| u32::from(most_samples(&view, x, 16, &whole) > 60)).sum();
        assert!((12..=20).contains(&across), "{across} of 33 pixels see the box");
        assert_eq!(most_samples(&view, 0, 0, &OwnedBox { lo: UVec3::splat(12), hi: UVec3::splat(20) }), 0);
        assert!(most_samples(&view, 16, 16, &OwnedBox { lo: UVec3::splat(12), hi: UVec3::splat(20) }) <= 19);
    }
}

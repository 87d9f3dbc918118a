//! Which samples of a ray lie in a box.

use super::{Ray, Scene};

/// The part of a ray inside a box, `t` in `[enter, exit)`, world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Segment {
    pub(super) enter: f64,
    pub(super) exit: f64,
}

/// The k of the samples with `enter <= k Delta < exit`, as `[first, end)`.
pub(super) fn owned_samples(scene: &Scene, segment: Segment) -> (i64, i64) {
    let delta = scene.delta();
    let at_or_after = |t: f64| {
        let mut k = (t / delta).ceil() as i64;
        while k as f64 * delta < t {
            k += 1;
        }
        while (k - 1) as f64 * delta >= t {
            k -= 1;
        }
        k
    };
    (at_or_after(segment.enter), at_or_after(segment.exit))
}

/// The ray's part in the voxels `[low, high)`, not before the eye.
pub(super) fn clip(scene: &Scene, ray: &Ray, low: [usize; 3], high: [usize; 3]) -> Option<Segment> {
    let s = clip_unbounded(scene, ray, low, high)?;
    let enter = s.enter.max(0.0);
    (enter < s.exit).then_some(Segment { enter, exit: s.exit })
}

/// As [`clip`], behind the eye too.
pub(super) fn clip_unbounded(scene: &Scene, ray: &Ray, low: [usize; 3], high: [usize; 3]) -> Option<Segment> {
    let origin = scene.volume.index_from_world(ray.origin);
    let direction = scene.volume.parts_along_axes(ray.direction) / scene.volume.spacing;
    let mut segment = Segment { enter: f64::NEG_INFINITY, exit: f64::INFINITY };
    for axis in 0..3 {
        let (lo, hi) = (low[axis] as f64, high[axis] as f64);
        if direction[axis] == 0.0 {
            if !(lo <= origin[axis] && origin[axis] < hi) {
                return None;
            }
            continue;
        }
        let (a, b) = ((lo - origin[axis]) / direction[axis], (hi - origin[axis]) / direction[axis]);
        segment.enter = segment.enter.max(a.min(b));
        segment.exit = segment.exit.min(a.max(b));
    }
    (segment.enter < segment.exit).then_some(segment)
}

/// As [`clip`], but with the eye relative to each brick's own corner, all in f32: rounds a common face twice,
/// differently.
pub(super) fn clip_brick_local_f32(scene: &Scene, ray: &Ray, low: [usize; 3], high: [usize; 3]) -> Option<Segment> {
    let (mut enter, mut exit) = (0.0_f32, f32::INFINITY);
    for axis in 0..3 {
        let (spacing, direction) = (scene.volume.spacing[axis] as f32, ray.direction[axis] as f32);
        let corner = scene.volume.origin[axis] as f32 + (low[axis] as f32 - 0.5) * spacing;
        let local = ray.origin[axis] as f32 - corner;
        let size = (high[axis] - low[axis]) as f32 * spacing;
        if direction == 0.0 {
            if !(0.0 <= local && local < size) {
                return None;
            }
            continue;
        }
        let (a, b) = ((0.0 - local) * (1.0 / direction), (size - local) * (1.0 / direction));
        enter = enter.max(a.min(b));
        exit = exit.min(a.max(b));
    }
    (enter < exit).then_some(Segment { enter: f64::from(enter), exit: f64::from(exit) })
}

/// True where f32 cannot tell on which side of the volume's faces a sample lies.
pub(super) fn is_doubtful(scene: &Scene, ray: &Ray) -> bool {
    let origin = scene.volume.index_from_world(ray.origin);
    let direction = scene.volume.parts_along_axes(ray.direction) / scene.volume.spacing;
    let delta = scene.delta();
    let (mut enter, mut exit) = ((f64::NEG_INFINITY, 0.0), (f64::INFINITY, 0.0));
    for axis in 0..3 {
        let n = scene.volume.dims[axis] as f64;
        if direction[axis] == 0.0 {
            continue;
        }
        // A few roundings of the operands, each of half an ulp of f32 (2^-24 relative).
        let slack = 1e-6 * (origin[axis].abs() + n) / direction[axis].abs();
        let (a, b) = (-origin[axis] / direction[axis], (n - origin[axis]) / direction[axis]);
        let (near, far) = (a.min(b), a.max(b));
        if near > enter.0 {
            enter = (near, slack);
        }
        if far < exit.0 {
            exit = (far, slack);
        }
    }
    let on_a_sample = |(t, slack): (f64, f64)| {
        let k = (t / delta).round().max(0.0);
        (k * delta - t).abs() <= slack + 1e-6 * t.abs()
    };
    exit.0 + exit.1 >= (enter.0 - enter.1).max(0.0) && (on_a_sample(enter) || on_a_sample(exit))
}

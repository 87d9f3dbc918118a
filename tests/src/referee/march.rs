//! Samples along a ray, and what they add up to.

use glam::DVec3;

use super::clip::{Segment, clip, clip_brick_local_f32, clip_unbounded, is_doubtful, owned_samples};
use super::{Ray, Sabotage, Scene};
use crate::compare::Picture;

/// A picture of the referee's.
#[derive(Debug, Clone)]
pub struct Rendering {
    pub picture: Picture,
    /// Samples integrated.
    pub samples: u64,
    /// Pixels, row-major, whose ray has a sample so close to the face by which it enters or leaves the volume that f32
    /// cannot tell on which side it lies. Within the volume such doubt does no harm: whichever brick owns the sample,
    /// it counts. And those with a sample of which f32 cannot tell whether it has data.
    pub doubtful: Vec<bool>,
}

/// What a ray has gathered: premultiplied colour and opacity.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Gathered {
    pub(super) rgba: [f64; 4],
    samples: u64,
}

/// The whole volume at once.
#[must_use]
pub fn render(scene: &Scene) -> Rendering {
    by_rows(scene, |ray, _| {
        let mut gathered = Gathered::default();
        if let Some(segment) = clip(scene, ray, [0; 3], scene.volume.dims) {
            let (first, end) = owned_samples(scene, segment);
            march(scene, ray, (first, end), 0.0, &mut gathered, &|p| scene.volume.sample(p));
        }
        gathered
    })
}

/// Brick by brick, front to back, each with its own samples; `mistake` is made throughout.
#[must_use]
pub fn render_bricks(scene: &Scene, brick_size: usize, mistake: Sabotage) -> Rendering {
    let mut scene = scene.clone();
    let center = (scene.volume.world_box().0 + scene.volume.world_box().1) / 2.0;
    match mistake {
        Sabotage::OriginAtCorner => scene.volume.origin += scene.volume.spacing * 0.5,
        Sabotage::CubicVoxels => {
            scene.volume.spacing = DVec3::splat(scene.volume.min_spacing());
            let moved = (scene.volume.world_box().0 + scene.volume.world_box().1) / 2.0;
            scene.volume.origin += center - moved;
        }
        Sabotage::UncorrectedOpacity => scene.unit = scene.delta(),
        Sabotage::DoubledUnit => scene.unit *= 2.0,
        _ => {}
    }
    let bricks = bricks(scene.volume.dims, brick_size);
    let [width, height] = scene.size;
    by_rows(&scene, |ray, [x, y]| match mistake {
        Sabotage::Mirror => gather(&scene, &scene.camera.ray(width - 1 - x, y, scene.size), &bricks, mistake),
        Sabotage::UpsideDown => gather(&scene, &scene.camera.ray(x, height - 1 - y, scene.size), &bricks, mistake),
        _ => gather(&scene, ray, &bricks, mistake),
    })
}

/// Voxel boxes `[low, high)` of `size`^3, smaller at the high ends.
fn bricks(dims: [usize; 3], size: usize) -> Vec<[[usize; 3]; 2]> {
    let starts = |axis: usize| (0..dims[axis]).step_by(size);
    let mut bricks = Vec::new();
    for z in starts(2) {
        for y in starts(1) {
            for x in starts(0) {
                let high = |axis: usize, low: usize| dims[axis].min(low + size);
                bricks.push([[x, y, z], [high(0, x), high(1, y), high(2, z)]]);
            }
        }
    }
    bricks
}

fn gather(scene: &Scene, ray: &Ray, bricks: &[[[usize; 3]; 2]], mistake: Sabotage) -> Gathered {
    let mut crossed: Vec<_> = bricks
        .iter()
        .filter_map(|&[low, high]| {
            let segment = match mistake {
                Sabotage::BrickLocalPlanes => clip_brick_local_f32(scene, ray, low, high),
                Sabotage::BehindTheEye => clip_unbounded(scene, ray, low, high),
                _ => clip(scene, ray, low, high),
            };
            segment.map(|s| (s, low, high))
        })
        .collect();
    crossed.sort_by(|a, b| a.0.enter.total_cmp(&b.0.enter).then(a.0.exit.total_cmp(&b.0.exit)));
    if mistake == Sabotage::ReversedOrder {
        crossed.reverse();
    }
    let volume_enter = clip(scene, ray, [0; 3], scene.volume.dims).map_or(0.0, |s| s.enter);
    let mut gathered = Gathered::default();
    for (segment, low, high) in crossed {
        let delta = scene.delta();
        let (mut first, mut end) = owned_samples(scene, segment);
        let mut phase = 0.0;
        match mistake {
            Sabotage::PhasePerBrick => {
                phase = segment.enter;
                (first, end) = (0, ((segment.exit - segment.enter) / delta).ceil() as i64);
            }
            Sabotage::PhaseFromEntry => {
                phase = volume_enter;
                let shifted = |t: f64| t - volume_enter;
                let local = Segment { enter: shifted(segment.enter), exit: shifted(segment.exit) };
                (first, end) = owned_samples(scene, local);
            }
            Sabotage::HalfStepShift => {
                phase = delta * 0.5;
                let shifted = |t: f64| t - delta * 0.5;
                let local = Segment { enter: shifted(segment.enter), exit: shifted(segment.exit) };
                (first, end) = owned_samples(scene, local);
            }
            Sabotage::ClosedExit if end as f64 * delta <= segment.exit => end += 1,
            Sabotage::OpenEntry if first as f64 * delta <= segment.enter => first += 1,
            Sabotage::OneSampleTooMany => end += 1,
            _ => {}
        }
        let volume = &scene.volume;
        let read = |p: DVec3| match mistake {
            Sabotage::HalfVoxelShift => volume.sample(p + 0.5),
            Sabotage::AxisSwap => volume.sample_within(p, [0; 3], volume.dims, super::volume::Volume::offset_z_fastest),
            Sabotage::MissingGhosts => volume.sample_within(p, low, high, super::volume::Volume::offset),
            _ => volume.sample(p),
        };
        if mistake == Sabotage::StraightOver {
            let mut layer = Gathered::default();
            march(scene, ray, (first, end), phase, &mut layer, &read);
            gathered = straight_over(gathered, layer);
        } else {
            march(scene, ray, (first, end), phase, &mut gathered, &read);
        }
    }
    if mistake == Sabotage::StraightAlpha && gathered.rgba[3] > 0.0 {
        let [r, g, b, a] = gathered.rgba;
        gathered.rgba = [r / a, g / a, b / a, a];
    }
    gathered
}

/// Front to back over the samples `first..end` at `t_k = phase + k Delta`; `read` takes a position in index space.
fn march(
    scene: &Scene,
    ray: &Ray,
    (first, end): (i64, i64),
    phase: f64,
    gathered: &mut Gathered,
    read: &impl Fn(DVec3) -> f64,
) {
    let exponent = scene.delta() / scene.unit;
    for k in first..end {
        if gathered.rgba[3] >= scene.early_termination && scene.early_termination < 1.0 {
            return;
        }
        let t = phase + k as f64 * scene.delta();
        gathered.samples += 1;
        let value = read(scene.volume.index_from_world(ray.origin + ray.direction * t));
        if value.is_nan() {
            continue;
        }
        let [r, g, b] = scene.transfer.color(value);
        let alpha = 1.0 - (1.0 - scene.transfer.opacity(value)).powf(exponent);
        let through = 1.0 - gathered.rgba[3];
        for (sum, color) in gathered.rgba.iter_mut().zip([r, g, b, 1.0]) {
            *sum += through * alpha * color;
        }
    }
}

fn straight_over(front: Gathered, back: Gathered) -> Gathered {
    let straight = |c: f64, a: f64| if a > 0.0 { c / a } else { 0.0 };
    let (f, b) = (front.rgba, back.rgba);
    let alpha = f[3] + (1.0 - f[3]) * b[3];
    let mut rgba = [0.0, 0.0, 0.0, alpha];
    for c in 0..3 {
        rgba[c] = f[3] * straight(f[c], f[3]) + (1.0 - f[3]) * straight(b[c], b[3]);
    }
    Gathered { rgba, samples: front.samples + back.samples }
}

/// Is there a sample on the ray of which f32 cannot tell whether it has data?
fn meets_doubt(scene: &Scene, ray: &Ray) -> bool {
    let Some(segment) = clip(scene, ray, [0; 3], scene.volume.dims) else { return false };
    let (first, end) = owned_samples(scene, segment);
    let place = |k: i64| scene.volume.index_from_world(ray.origin + ray.direction * (k as f64 * scene.delta()));
    (first..=end).any(|k| scene.volume.is_doubtful(place(k)))
}

/// Every pixel of `scene`, rows shared among the processors.
pub(super) fn by_rows(scene: &Scene, pixel: impl Fn(&Ray, [usize; 2]) -> Gathered + Sync) -> Rendering {
    let [width, height] = scene.size;
    let mut gathered = vec![(Gathered::default(), false); width * height];
    let has_holes = scene.volume.values.iter().any(|v| v.is_nan());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let rows_each = height.div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        for (part, rows) in gathered.chunks_mut(rows_each * width).enumerate() {
            let pixel = &pixel;
            scope.spawn(move || {
                for (i, out) in rows.iter_mut().enumerate() {
                    let (x, y) = (i % width, part * rows_each + i / width);
                    let ray = scene.camera.ray(x, y, scene.size);
                    *out = (pixel(&ray, [x, y]), is_doubtful(scene, &ray) || (has_holes && meets_doubt(scene, &ray)));
                }
            });
        }
    });
    Rendering {
        picture: Picture { width, height, pixels: gathered.iter().map(|(g, _)| g.rgba).collect() },
        samples: gathered.iter().map(|(g, _)| g.samples).sum(),
        doubtful: gathered.iter().map(|(_, doubt)| *doubt).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Camera, Lens, Transfer, Volume};
    use super::*;

    /// Two voxels of 1.0 along x with the values 0 and 1; opacity is half the value, red is the value, green is one.
    fn two_voxels(position: DVec3, focal_point: DVec3) -> Scene {
        let mut volume = Volume::filled([2, 1, 1], [1.0; 3], [0.0; 3], 0.0);
        volume.values[1] = 1.0;
        Scene {
            volume,
            camera: Camera { position, focal_point, view_up: DVec3::Y, lens: Lens::Parallel { parallel_scale: 0.1 } },
            transfer: Transfer {
                colors: vec![(0.0, [0.0, 1.0, 0.0]), (1.0, [1.0, 1.0, 0.0])],
                opacities: vec![(0.0, 0.0), (1.0, 0.5)],
            },
            size: [1, 1],
            step: 0.5,
            unit: 0.5,
            early_termination: 1.0,
        }
    }

    /// Summed by hand. The eye is 1.25 before the box, so the samples lie at 0.25, 0.75, 1.25 and 1.75 within it, where
    /// the values are 0, 0.25, 0.75 and 1; the back one comes first.
    #[test]
    fn a_ray_summed_by_hand() {
        let scene = two_voxels(DVec3::new(2.75, 0.0, 0.0), DVec3::ZERO);
        let rendering = render(&scene);
        assert_eq!(rendering.samples, 4);
        let (mut c, mut a) = (0.0, 0.0);
        for v in [1.0, 0.75, 0.25, 0.0] {
            c += (1.0 - a) * (v / 2.0) * v;
            a += (1.0 - a) * (v / 2.0);
        }
        let expected = [c, a, 0.0, a];
        assert!(expected.iter().zip(rendering.picture.pixels[0]).all(|(e, v)| (e - v).abs() < 1e-15));
        // Opacities refer to a length: the same over twice the unit is the square root of the transparency.
        let mut longer = scene.clone();
        longer.unit = 1.0;
        let root = 1.0 - (1.0 - a).sqrt();
        assert!((render(&longer).picture.pixels[0][3] - root).abs() < 1e-15);
        // Half an opacity is reached with the first sample.
        let stopped = render(&Scene { early_termination: 0.5, ..scene });
        assert_eq!((stopped.samples, stopped.picture.pixels[0]), (1, [0.5, 0.5, 0.0, 0.5]));
    }

    /// Half-open: of samples on both faces of the box the near one counts; at the eye, k = 0 counts.
    #[test]
    fn the_sample_at_the_entry_counts_and_the_one_at_the_exit_does_not() {
        for (x, samples) in [(2.0, 4), (1.5, 4), (1.25, 4), (1.0, 3), (0.0, 1), (-0.5, 0)] {
            let scene = two_voxels(DVec3::new(x, 0.0, 0.0), DVec3::new(x - 1.0, 0.0, 0.0));
            assert_eq!(render(&scene).samples, samples, "eye at {x}");
            assert_eq!(render_bricks(&scene, 1, Sabotage::None).samples, samples, "eye at {x}, in bricks");
        }
    }

    /// From the default orbit, x grows to the right and y upwards: of four voxels only the one there is seen.
    #[test]
    fn the_default_orbit_shows_x_to_the_right_and_y_upwards() {
        let mut volume = Volume::filled([4, 4, 1], [1.0; 3], [0.0; 3], 0.0);
        volume.values[3 * 4 + 3] = 1.0;
        let camera = Camera::orbit(&volume, 0.0, 0.0, 1.0, 30.0);
        let scene = Scene { camera, volume, size: [16, 16], ..two_voxels(DVec3::X, DVec3::ZERO) };
        let picture = render(&scene).picture;
        assert!(picture.max_alpha() > 0.2);
        for (i, pixel) in picture.pixels.iter().enumerate() {
            assert!(pixel[3] == 0.0 || (i % 16 >= 8 && i / 16 < 8), "pixel {i}: {pixel:?}");
        }
    }

    /// A ray in the box's low face belongs to it, one in the high face does not.
    #[test]
    fn rays_inside_faces_have_one_owner() {
        for (y, samples) in [(-0.5, 4), (0.0, 4), (0.5, 0)] {
            let scene = two_voxels(DVec3::new(2.0, y, 0.0), DVec3::new(1.0, y, 0.0));
            assert_eq!(render(&scene).samples, samples, "ray at y = {y}");
        }
    }
}

//! What formulas say: opacity of a constant body, order of bricks, early termination.

use brickcast_node::kernel::{BrickInput, Job, KernelScene, Raycaster};
use brickcast_volume::scene::Filter;
use brickcast_volume::{OwnedBox, Premul};
use glam::UVec3;

use super::scene::{BOTH_FILTERS, VIEWPOINTS, Volume, cpu, flat_table, gpu_too, render_one, scene};

/// On both backends, with all filters of each.
fn everywhere(check: impl Fn(&dyn Raycaster, Filter)) {
    check(&cpu(), Filter::Exact);
    if let Some(gpu) = gpu_too() {
        BOTH_FILTERS.iter().for_each(|&filter| check(gpu, filter));
    }
}

#[test]
fn constant_body_has_the_opacity_of_its_samples() {
    everywhere(|raycaster, filter| {
        let volume = Volume::constant([40, 30, 20]);
        for viewpoint in &VIEWPOINTS {
            for (step, opacity) in [(0.25, 0.02), (0.5, 0.1), (1.0, 0.05), (2.0, 0.3)] {
                let view = viewpoint.view(&volume.geometry, [1, 1], step);
                let table = flat_table([1.0, 0.5, 0.25], opacity, step);
                let scene = KernelScene::plain(view, table, 1.0, filter);
                let image = render_one(raycaster, &scene, volume.job(raycaster, &view, 16));
                let samples = image.total().samples as f64;
                assert!(samples * step > 10.0, "{}: {samples}", viewpoint.name);
                let want = 1.0 - (1.0 - opacity).powf(samples * step);
                let p = image.pixels.typed::<Premul>().unwrap()[0];
                for (got, share) in [(p.r, 1.0), (p.g, 0.5), (p.b, 0.25), (p.a, 1.0)] {
                    let off = (f64::from(got) - want * share).abs();
                    assert!(off < 1.0 / 255.0, "{}, step {step}, {filter:?}: {p:?}, {want}", viewpoint.name);
                }
            }
        }
    });
}

/// The chord through the box along its axis is known: so are the samples, the first one at the face included.
#[test]
fn samples_are_half_open_along_a_known_chord() {
    everywhere(|raycaster, filter| {
        let volume = Volume::constant([40, 30, 20]);
        // The eye is 40 voxels in front of z = 20: t from 40 to 60, at multiples of the step.
        for (step, want) in [(0.5, 40), (1.0, 20), (2.0, 10), (3.0, 6), (7.0, 3)] {
            let view = VIEWPOINTS[6].view(&volume.geometry, [1, 1], step);
            let image = render_one(raycaster, &scene(view, 1.0, filter), volume.job(raycaster, &view, 8));
            assert_eq!(image.total().samples, want, "step {step}, {filter:?}");
        }
    });
}

/// Two opaque bricks in one job: the first of the list hides the second, whichever it is.
#[test]
fn bricks_blend_in_the_jobs_order() {
    everywhere(|raycaster, filter| {
        let volume = Volume::ramps([40, 30, 20], [1.0; 3], [0.0; 3]);
        let view = VIEWPOINTS[0].view(&volume.geometry, [33, 33], 0.5);
        let opaque = KernelScene { early_termination: 0.9, ..scene(view, 0.9, filter) };
        let halves = [(0, 10), (10, 20)].map(|(from, to)| {
            let owned = OwnedBox { lo: UVec3::new(0, 0, from), hi: UVec3::new(40, 30, to) };
            raycaster.upload(owned, &BrickInput::plain(&volume.cut(owned.stored(1)))).unwrap()
        });
        let render = |bricks: Vec<_>| {
            let image = render_one(raycaster, &opaque, Job::new(bricks, view.size().full_rect()));
            (image.pixels.typed::<Premul>().unwrap()[16 * 33 + 16], image.counts)
        };
        let [far, near] = halves;
        let (far_first, _) = render(vec![far.clone(), near.clone()]);
        let (near_first, samples) = render(vec![near.clone(), far.clone()]);
        let (near_alone, _) = render(vec![near]);
        let (far_alone, alone) = render(vec![far]);
        // One accumulator: what the second adds is what the first lets through.
        let join = |front: Premul, back: Premul| brickcast_volume::over(front, back);
        let far_over_near = join(far_alone, near_alone);
        let near_over_far = join(near_alone, far_alone);
        for (got, want) in [(far_first, far_over_near), (near_first, near_over_far)] {
            let off = got.to_array().iter().zip(want.to_array()).fold(0.0_f32, |m, (g, w)| m.max((g - w).abs()));
            // Early termination at 0.9 leaves out at most a tenth.
            assert!(off < 0.1, "{got:?} {want:?}");
        }
        assert!((far_first.r - near_first.r).abs() > 0.02 || (far_first.b - near_first.b).abs() > 0.02);
        assert!(samples[1].samples < alone[0].samples, "hidden samples must not be taken: {samples:?}, {alone:?}");
    });
}

/// Off means off: opacity one does not stop a ray, and 0.999 changes the picture by less than 1/255.
#[test]
fn early_termination_saves_samples_only() {
    everywhere(|raycaster, filter| {
        let volume = Volume::constant([40, 30, 20]);
        let view = VIEWPOINTS[1].view(&volume.geometry, [33, 33], 0.5);
        let render = |early_termination, opacity| {
            let table = flat_table([1.0; 3], opacity, 0.5);
            let scene = KernelScene::plain(view, table, early_termination, filter);
            let image = render_one(raycaster, &scene, volume.job(raycaster, &view, 16));
            (image.total().samples, image.pixels)
        };
        let (all, transparent) = render(1.0, 0.0);
        assert!(transparent.raw().iter().all(|p| *p == [0.0; 4]));
        let (off, full) = render(1.0, 1.0);
        assert_eq!(off, all);
        let (on, early) = render(0.999, 1.0);
        // One sample a ray.
        assert_eq!(on, full.raw().iter().filter(|p| p[3] > 0.0).count() as u64);
        assert_eq!(early, full);
        let (on, early) = render(0.999, 0.5);
        let (off, late) = render(1.0, 0.5);
        assert!(on < off / 2 && off == all);
        assert!(super::scene::difference(&early, &late).max < 1.0 / 255.0);
    });
}

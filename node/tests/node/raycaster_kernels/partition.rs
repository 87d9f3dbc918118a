//! One picture whatever the bricks: every sample has exactly one owner.

use brickcast_node::kernel::{BrickInput, Raycaster};
use brickcast_volume::merge::sort_front_to_back;
use brickcast_volume::scene::Filter;
use brickcast_volume::{BrickGrid, OwnedBox};

use super::scene::{BOTH_FILTERS, VIEWPOINTS, Volume, cpu, difference, gpu, most_opaque, render_one, scene};

const DIMS: [u32; 3] = [40, 30, 20];

fn check(raycaster: &dyn Raycaster, filters: &[Filter]) {
    let volumes = [Volume::ramps(DIMS, [1.0; 3], [0.0; 3]), Volume::ramps(DIMS, [1.0, 2.0, 3.0], [5.0, -3.0, 2.0])];
    for volume in &volumes {
        let resident = [64, 8, 16, 32].map(|size| (size, volume.upload(raycaster, size)));
        for viewpoint in &VIEWPOINTS {
            for (size, step) in [([47, 31], 0.5), ([17, 5], 1.0), ([17, 5], 0.25)] {
                let view = viewpoint.view(&volume.geometry, size, step);
                for &filter in filters {
                    // Early termination off: all samples count.
                    let scene = scene(view, 1.0, filter);
                    let whole = render_one(raycaster, &scene, resident[0].1.job(&view));
                    assert_eq!(whole.counts.len(), 1);
                    assert!(whole.counts[0].samples > 0 && most_opaque(&whole.pixels) > 0.3, "{}", viewpoint.name);
                    for (brick_size, bricks) in &resident[1..] {
                        let cut = render_one(raycaster, &scene, bricks.job(&view));
                        let what = format!("{}, {size:?}, step {step}, {filter:?}, {brick_size}", viewpoint.name);
                        assert!(cut.counts.len() > 1);
                        assert_eq!(cut.total().samples, whole.counts[0].samples, "{what}");
                        let d = difference(&cut.pixels, &whole.pixels);
                        assert!(d.max <= 1.0 / 255.0, "{what}: {d:?}");
                    }
                }
            }
        }
    }
}

/// Samples that lie on brick faces but for rounding: along z the spacing is four steps. Planes computed brick by brick,
/// each from the last, count such samples twice or not at all.
fn check_rounded_faces(raycaster: &dyn Raycaster, filters: &[Filter]) {
    for spacing in [1.1, 1.3, 1.7, 1.9, 2.3, 2.9, 3.1] {
        let volume = Volume::ramps([16, 16, 64], [1.0, 1.0, spacing], [0.0; 3]);
        let resident = [64, 8, 16].map(|size| volume.upload(raycaster, size));
        for eye in [60.0, 77.0, 90.25] {
            let view = VIEWPOINTS[8].moved([-7.7, 0.2, eye - 40.0]).view(&volume.geometry, [9, 5], spacing / 4.0);
            for &filter in filters {
                let scene = scene(view, 1.0, filter);
                let counts =
                    resident.each_ref().map(|bricks| render_one(raycaster, &scene, bricks.job(&view)).total().samples);
                assert!(counts[0] > 1000);
                assert_eq!(counts, [counts[0]; 3], "spacing {spacing}, eye {eye}, {filter:?}");
            }
        }
    }
}

#[test]
fn every_sample_has_one_owner_on_the_cpu() {
    check(&cpu(), &[Filter::Exact]);
    check_rounded_faces(&cpu(), &[Filter::Exact]);
}

#[test]
fn every_sample_has_one_owner_on_the_gpu() {
    let gpu = gpu();
    check(gpu, &BOTH_FILTERS);
    check_rounded_faces(gpu, &BOTH_FILTERS);
}

/// The count must notice a brick that takes one layer of its neighbour's samples too.
#[test]
fn a_ghost_voxel_that_is_integrated_is_noticed() {
    let cpu = cpu();
    let volume = Volume::ramps(DIMS, [1.0; 3], [0.0; 3]);
    let view = VIEWPOINTS[1].view(&volume.geometry, [47, 31], 0.5);
    let scene = scene(view, 1.0, Filter::Exact);
    let whole = render_one(&cpu, &scene, volume.job(&cpu, &view, 64));
    let grid = BrickGrid::new(DIMS.into(), 16).unwrap();
    let mut order: Vec<_> = grid.bricks().collect();
    sort_front_to_back(&mut order, 16, view.viewpoint());
    let mut job = volume.job(&cpu, &view, 16);
    for (slot, brick) in job.bricks.iter_mut().zip(order) {
        let owned = grid.owned_box(brick);
        let greedy = OwnedBox { lo: owned.lo, hi: (owned.hi + 1).min(DIMS.into()) };
        *slot = cpu.upload(greedy, &BrickInput::plain(&volume.cut(greedy.stored(1)))).unwrap();
    }
    let greedy = render_one(&cpu, &scene, job);
    assert!(greedy.total().samples > whole.counts[0].samples);
    assert!(difference(&greedy.pixels, &whole.pixels).max > 1.0 / 255.0);
}

//! One picture whatever the bricks: every sample has exactly one owner.

use brickcast_node::raycaster::Raycaster;
use brickcast_volume::merge::sort_front_to_back;
use brickcast_volume::scene::Filter;
use brickcast_volume::{BrickGrid, OwnedBox};

use crate::scene::{BOTH_FILTERS, VIEWPOINTS, Volume, cpu, difference, gpu, most_opaque, render_one, scene};

const DIMS: [u32; 3] = [40, 30, 20];

fn check(raycaster: &dyn Raycaster, filters: &[Filter]) {
    let volumes = [Volume::ramps(DIMS, [1.0; 3], [0.0; 3]), Volume::ramps(DIMS, [1.0, 2.0, 3.0], [5.0, -3.0, 2.0])];
    for volume in &volumes {
        for viewpoint in &VIEWPOINTS {
            for (size, step) in [([47, 31], 0.5), ([17, 5], 1.0), ([17, 5], 0.25)] {
                let view = viewpoint.view(&volume.geometry, size, step);
                for &filter in filters {
                    // Early termination off: all samples count.
                    let scene = scene(view, 1.0, filter);
                    let whole = render_one(raycaster, &scene, volume.job(raycaster, &view, 64));
                    assert_eq!(whole.samples.len(), 1);
                    assert!(whole.samples[0] > 0 && most_opaque(&whole.pixels) > 0.3, "{}", viewpoint.name);
                    for brick_size in [8, 16, 32] {
                        let cut = render_one(raycaster, &scene, volume.job(raycaster, &view, brick_size));
                        let what = format!("{}, {size:?}, step {step}, {filter:?}, {brick_size}", viewpoint.name);
                        assert!(cut.samples.len() > 1);
                        assert_eq!(cut.samples.iter().sum::<u64>(), whole.samples[0], "{what}");
                        let d = difference(&cut.pixels, &whole.pixels);
                        assert!(d.max <= 1.0 / 255.0, "{what}: {d:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn every_sample_has_one_owner_on_the_cpu() {
    check(&cpu(), &[Filter::Exact]);
}

#[test]
fn every_sample_has_one_owner_on_the_gpu() {
    let Some(gpu) = gpu("every_sample_has_one_owner_on_the_gpu") else { return };
    check(gpu, &BOTH_FILTERS);
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
        *slot = cpu.upload(greedy, &volume.cut(greedy.stored(1))).unwrap();
    }
    let greedy = render_one(&cpu, &scene, job);
    assert!(greedy.samples.iter().sum::<u64>() > whole.samples[0]);
    assert!(difference(&greedy.pixels, &whole.pixels).max > 1.0 / 255.0);
}

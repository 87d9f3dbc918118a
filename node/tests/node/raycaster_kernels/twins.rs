//! The WGSL kernel against its CPU twin (docs/definition.md, Tolerances).

use brickcast_node::gpu::GpuOptions;
use brickcast_node::kernel::{Raycaster, Recipe};
use brickcast_volume::scene::Filter;

use super::scene::{BOTH_FILTERS, VIEWPOINTS, Volume, cpu, difference, gpu, most_opaque, open_gpu, render_one, scene};

/// Isotropic at the origin, and 1 : 2 : 3 elsewhere.
fn volumes() -> [Volume; 2] {
    let dims = [40, 30, 20];
    [Volume::ramps(dims, [1.0; 3], [0.0; 3]), Volume::ramps(dims, [0.5, 1.0, 1.5], [-7.0, 3.5, 11.0])]
}

/// Renders everything on both; returns (pixels, pixels beyond 2/255).
fn compare(gpu: &dyn Raycaster, filters: &[Filter], sizes: &[[u32; 2]], steps: &[f64]) -> (usize, usize) {
    let cpu = cpu();
    let (mut pixels, mut beyond) = (0, 0);
    for (v, volume) in volumes().iter().enumerate() {
        let (on_cpu, on_gpu) = (volume.upload(&cpu, 16), volume.upload(gpu, 16));
        for viewpoint in &VIEWPOINTS {
            for (&size, &step) in sizes.iter().flat_map(|size| steps.iter().map(move |step| (size, step))) {
                let view = viewpoint.view(&volume.geometry, size, step);
                let twin_scene = scene(view, 0.999, Filter::Exact);
                let twin = render_one(&cpu, &twin_scene, on_cpu.job(&view));
                let what = format!("volume {v}, {}, {size:?}, step {step}", viewpoint.name);
                if size[0] * size[1] > 1000 {
                    assert!(most_opaque(&twin.pixels) > 0.3, "{what}: nothing to see");
                }
                for &filter in filters {
                    let image = render_one(gpu, &scene(view, 0.999, filter), on_gpu.job(&view));
                    let d = difference(&image.pixels, &twin.pixels);
                    assert!(d.mean < 0.05 / 255.0, "{what}, {filter:?}: {d:?}");
                    pixels += image.pixels.len();
                    beyond += d.beyond;
                }
            }
        }
    }
    (pixels, beyond)
}

/// 0.01 % of the pixels may exceed the maximum: a sample on the volume's face may change owner.
fn assert_rare((pixels, beyond): (usize, usize)) {
    assert!(beyond * 10_000 <= pixels, "{beyond} of {pixels} pixels differ by more than 2/255");
}

#[test]
fn gpu_and_twin_agree_from_everywhere() {
    let gpu = gpu();
    assert_rare(compare(gpu, &BOTH_FILTERS, &[[61, 47]], &[0.25, 0.5, 1.0, 2.0]));
}

#[test]
fn gpu_and_twin_agree_at_odd_image_sizes() {
    let gpu = gpu();
    assert_rare(compare(gpu, &BOTH_FILTERS, &[[1, 1], [17, 5], [2, 31]], &[0.5]));
}

/// Adapters without 16-bit normalised textures: 32-bit voxels through the exact kernel, and a note that says so.
#[test]
fn voxels_as_floats_give_the_same_picture() {
    let options = GpuOptions { without_norm16: true, ..GpuOptions::from_env() };
    let gpu = open_gpu(options);
    assert!(gpu.info().notes.iter().any(|n| n.contains("16-bit")), "{:?}", gpu.info());
    assert_eq!(gpu.brick_bytes(1000, Recipe::default()), 4000);
    assert_rare(compare(&gpu, &[Filter::Hardware], &[[61, 47]], &[0.5]));
}

/// Real GPUs filter the transfer function as half floats.
#[test]
fn half_float_tables_give_the_same_picture() {
    let options = GpuOptions { without_float_table: true, ..GpuOptions::from_env() };
    let gpu = open_gpu(options);
    assert_rare(compare(&gpu, &[Filter::Hardware], &[[61, 47]], &[0.5, 1.0]));
}

/// Half a voxel off in one path must not pass as agreement.
#[test]
fn a_shifted_volume_is_noticed() {
    let cpu = cpu();
    let [volume, _] = volumes();
    let view = VIEWPOINTS[1].view(&volume.geometry, [61, 47], 0.5);
    let straight = render_one(&cpu, &scene(view, 0.999, Filter::Exact), volume.job(&cpu, &view, 16));
    let view = VIEWPOINTS[1].moved([0.5, 0.0, 0.0]).view(&volume.geometry, [61, 47], 0.5);
    let moved = render_one(&cpu, &scene(view, 0.999, Filter::Exact), volume.job(&cpu, &view, 16));
    let d = difference(&straight.pixels, &moved.pixels);
    assert!(d.mean > 0.05 / 255.0 && d.beyond * 10_000 > straight.pixels.len(), "{d:?}");
}

//! How a call is cut into jobs, batches and threads changes no bit; what is wrong with a call is said in words.

use std::time::Duration;

use brickcast_harness::{ignore, leave_out};
use brickcast_node::backend::{BackendChoice, open};
use brickcast_node::cpu::CpuRaycaster;
use brickcast_node::gpu::{GpuError, GpuOptions, GpuRaycaster};
use brickcast_node::kernel::{BrickInput, Job, JobImage, KernelKey, RaycastError, Raycaster, Recipe};
use brickcast_volume::OwnedBox;
use brickcast_volume::scene::Filter;
use glam::UVec3;

use super::scene::{BOTH_FILTERS, VIEWPOINTS, Volume, cpu, gpu, most_opaque, open_gpu, rect, render_one, scene};

fn volume() -> Volume {
    Volume::ramps([40, 30, 20], [1.0, 2.0, 3.0], [5.0, -3.0, 2.0])
}

/// Twice the same call; one job against a job per rectangle, some empty or of one pixel.
fn same_bits(raycaster: &dyn Raycaster, filter: Filter) {
    let volume = volume();
    let view = VIEWPOINTS[1].view(&volume.geometry, [83, 59], 0.5);
    let scene = scene(view, 0.999, filter);
    let job = volume.job(raycaster, &view, 16);
    let whole = render_one(raycaster, &scene, job.clone());
    assert!(most_opaque(&whole.pixels) > 0.3);
    let again = render_one(raycaster, &scene, job.clone());
    assert_eq!((&whole.pixels, &whole.counts), (&again.pixels, &again.counts));
    let rects = [
        rect([0, 0], [83, 7]),
        rect([0, 7], [40, 59]),
        rect([40, 7], [41, 8]),
        rect([41, 7], [83, 8]),
        rect([40, 8], [83, 58]),
        rect([9, 9], [9, 9]),
        rect([40, 58], [83, 59]),
    ];
    let jobs: Vec<Job> = rects.iter().map(|&rect| Job { rect, ..job.clone() }).collect();
    let parts = raycaster.render(&scene, &jobs).unwrap();
    let mut joined = vec![[f32::NAN; 4]; whole.pixels.len()];
    let mut samples = 0;
    for (part, rect) in parts.iter().zip(rects) {
        assert_eq!((part.rect, part.pixels.len()), (rect, rect.pixel_count()));
        samples += part.total().samples;
        let width = rect.size().x as usize;
        for (i, pixel) in part.pixels.raw().iter().enumerate() {
            let (x, y) = (rect.lo.x as usize + i % width, rect.lo.y as usize + i / width);
            joined[y * 83 + x] = *pixel;
        }
    }
    assert_eq!(joined, whole.pixels.raw());
    assert_eq!(samples, whole.total().samples);
}

#[test]
fn rectangles_and_repeats_change_no_bit() {
    same_bits(&cpu(), Filter::Exact);
    let gpu = gpu();
    BOTH_FILTERS.iter().for_each(|&filter| same_bits(gpu, filter));
}

/// Bricks that are cut front to back into jobs, each of which goes on where the one before it ended.
fn passes_have_the_bits_of_the_whole(raycaster: &dyn Raycaster, filter: Filter) {
    let volume = volume();
    let view = VIEWPOINTS[1].view(&volume.geometry, [83, 59], 0.5);
    // Rays that end early end in the passes, too.
    let scene = scene(view, 0.9, filter);
    let job = volume.job(raycaster, &view, 8);
    let whole = render_one(raycaster, &scene, job.clone());
    assert!(most_opaque(&whole.pixels) > 0.3 && job.bricks.len() > 20);
    for at_once in [1, 7] {
        let mut image = None::<JobImage>;
        let mut samples = 0;
        for bricks in job.bricks.chunks(at_once) {
            let front = image.map(|image| image.pixels);
            let pass = Job { front, ..Job::new(bricks.to_vec(), job.rect) };
            let next = render_one(raycaster, &scene, pass);
            samples += next.total().samples;
            image = Some(next);
        }
        assert!(image.unwrap().pixels == whole.pixels, "{at_once} bricks at once");
        assert_eq!(samples, whole.total().samples);
    }
    let front = Some(render_one(raycaster, &scene, Job { rect: rect([0, 0], [2, 2]), ..job.clone() }).pixels);
    let error = raycaster.render(&scene, &[Job { front, ..job }]).unwrap_err();
    assert!(matches!(error, RaycastError::Front { got: 4, want: 4897, .. }), "{error}");
}

#[test]
fn a_job_goes_on_where_another_ended() {
    passes_have_the_bits_of_the_whole(&cpu(), Filter::Exact);
    passes_have_the_bits_of_the_whole(&CpuRaycaster::twin(), Filter::Exact);
    let gpu = gpu();
    BOTH_FILTERS.iter().for_each(|&filter| passes_have_the_bits_of_the_whole(gpu, filter));
}

#[test]
fn threads_change_no_bit() {
    let volume = volume();
    let view = VIEWPOINTS[7].view(&volume.geometry, [83, 59], 0.5);
    let [one, many] = [1, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let cpu = CpuRaycaster::new();
            assert_eq!(cpu.info().threads, threads as u32);
            render_one(&cpu, &scene(view, 0.999, Filter::Exact), volume.job(&cpu, &view, 8))
        })
    });
    assert!(most_opaque(&one.pixels) > 0.3);
    assert_eq!((one.pixels, one.counts), (many.pixels, many.counts));
}

/// Rectangles larger than the accumulator buffer go through it in bands.
#[test]
fn small_accumulators_change_no_bit() {
    let options = GpuOptions { accumulator_bytes: 1, ..GpuOptions::from_env() };
    let (gpu, small) = (gpu(), open_gpu(options));
    let volume = volume();
    // 262,144 bytes at least, 16 a pixel: three bands of the first job.
    let view = VIEWPOINTS[1].view(&volume.geometry, [211, 199], 1.0);
    let scene = scene(view, 0.999, Filter::Hardware);
    let render = |raycaster: &dyn Raycaster| {
        let job = volume.job(raycaster, &view, 16);
        let corner = Job { rect: rect([100, 90], [180, 190]), ..job.clone() };
        raycaster.render(&scene, &[job.clone(), corner, job]).unwrap()
    };
    for (a, b) in render(gpu).iter().zip(render(&small)) {
        assert!(most_opaque(&a.pixels) > 0.3);
        assert_eq!((&a.pixels, &a.counts), (&b.pixels, &b.counts));
    }
}

fn refusals(raycaster: &dyn Raycaster, other: &dyn Raycaster) {
    let volume = volume();
    let view = VIEWPOINTS[0].view(&volume.geometry, [20, 10], 0.5);
    let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(8) };
    let no_ghost = raycaster.upload(owned, &BrickInput::plain(&volume.cut(owned.stored(0))));
    assert!(matches!(no_ghost, Err(RaycastError::MissingGhost { .. })));
    let mut short = volume.cut(owned.stored(1));
    short.codes.pop();
    assert!(matches!(
        raycaster.upload(owned, &BrickInput::plain(&short)),
        Err(RaycastError::VoxelCount { got: 999, want: 1000, .. })
    ));

    let scene = scene(view, 0.999, Filter::Exact);
    let brick = raycaster.upload(owned, &BrickInput::plain(&volume.cut(owned.stored(1)))).unwrap();
    assert_eq!(brick.bytes(), raycaster.brick_bytes(1000, Recipe::default()));
    let outside = Job::new(vec![brick], rect([0, 0], [20, 11]));
    let outside = raycaster.render(&scene, &[outside]);
    assert!(matches!(outside, Err(RaycastError::RectOutsidePicture { width: 20, height: 10, .. })));
    let foreign = raycaster.render(&scene, &[volume.job(other, &view, 16)]);
    assert!(matches!(foreign, Err(RaycastError::ForeignBrick { .. })));
    // And it still renders.
    let nothing = render_one(raycaster, &scene, Job::new(vec![], view.size().full_rect()));
    assert!(nothing.pixels.len() == 200 && nothing.pixels.raw().iter().all(|p| *p == [0.0; 4]));
    assert!(raycaster.render(&scene, &[]).unwrap().is_empty());
    assert!(most_opaque(&render_one(raycaster, &scene, volume.job(raycaster, &view, 16)).pixels) > 0.3);
}

#[test]
fn bad_calls_are_refused_in_words() {
    let gpu = gpu();
    refusals(&cpu(), gpu);
    refusals(gpu, &cpu());
    // A brick of another device is no less foreign.
    refusals(gpu, &open_gpu(GpuOptions::from_env()));
}

#[test]
fn oversized_bricks_are_refused() {
    let gpu = gpu();
    let volume = Volume::constant([1 << 17, 1, 1]);
    let owned = OwnedBox { lo: UVec3::ZERO, hi: volume.geometry.dims() };
    let error = gpu.upload(owned, &BrickInput::plain(&volume.cut(owned.stored(1)))).unwrap_err();
    assert!(matches!(error, RaycastError::BrickTooLarge { dims: [131_074, 3, 3], .. }), "{error}");
}

/// Whatever is called on a lost device is an error that says so, again and again, and never a panic.
#[test]
fn a_lost_device_is_an_error() {
    let gpu = open_gpu(GpuOptions::from_env());
    let volume = volume();
    let view = VIEWPOINTS[1].view(&volume.geometry, [16, 16], 1.0);
    let (scene, job) = (scene(view, 0.999, Filter::Hardware), volume.job(&gpu, &view, 16));
    let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::ONE };
    let voxels = volume.cut(owned.stored(1));
    assert!(gpu.render(&scene, std::slice::from_ref(&job)).is_ok());
    gpu.lose_device();
    for _ in 0..2 {
        for error in [
            gpu.upload(owned, &BrickInput::plain(&voxels)).map(drop).unwrap_err(),
            gpu.render(&scene, std::slice::from_ref(&job)).map(drop).unwrap_err(),
            gpu.warm_up(Filter::Exact, &[KernelKey::PLAIN]).unwrap_err(),
        ] {
            assert!(matches!(error, RaycastError::DeviceLost { .. }) && !error.is_retryable(), "{error}");
        }
    }
}

/// A wait has an end: here at once, in the start-up test.
#[test]
fn waits_time_out() {
    let options = GpuOptions { timeout: Duration::ZERO, ..GpuOptions::from_env() };
    match GpuRaycaster::new(options) {
        Err(error @ GpuError::NoAdapter) => ignore(error),
        Err(GpuError::StartUp { source: RaycastError::Timeout { .. }, .. }) => {}
        Ok(gpu) if gpu.info().notes.iter().any(|note| note.contains("cannot filter")) => {
            ignore("this adapter has no filter to test at start-up");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_unknown_adapter_is_named_with_those_found() {
    let wanted = "no such adapter".to_owned();
    match GpuRaycaster::new(GpuOptions { adapter: Some(wanted), ..GpuOptions::default() }) {
        Err(GpuError::NoSuchAdapter { wanted, found }) => {
            assert!(wanted == "no such adapter" && !found.is_empty());
        }
        Err(error @ GpuError::NoAdapter) => ignore(error),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_chosen_backend_opens_and_warms_up() {
    let cpu = open(BackendChoice::Cpu).unwrap();
    assert_eq!((cpu.info().backend, cpu.info().notes.len()), ("cpu", 0));
    let auto = open(BackendChoice::Auto).unwrap();
    // A real GPU; else the CPU kernel, which is faster than a driver that plays GPU, and it says why.
    let told = auto.info().notes.iter().any(|note| note.starts_with("rendering on the CPU: no "));
    assert!(!auto.info().is_on_processor || auto.info().backend == "cpu" && told, "{:?}", auto.info());
    // Whoever asks for the GPU's kernel gets it, whoever runs it.
    match open(BackendChoice::Gpu) {
        Ok(gpu) => {
            let software = gpu.info().is_on_processor;
            assert_eq!((gpu.info().backend, auto.info().backend), ("gpu", if software { "cpu" } else { "gpu" }));
        }
        Err(why) => leave_out(why),
    }
    for raycaster in [cpu, auto] {
        BOTH_FILTERS.iter().for_each(|&filter| raycaster.warm_up(filter, &[KernelKey::PLAIN]).unwrap());
    }
}

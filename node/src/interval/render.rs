//! Jobs of intervals: pixel by pixel, with threads of their own turn.

use brickcast_shaders::interval::{BrickSpans, IntervalTables, RaySamples, Spans, unending, walk_brick};
use brickcast_shaders::twin::bindings::{Bindings, RayCounts};
use brickcast_shaders::twin::ray::pixel_ray;
use brickcast_shaders::{BrickTraits, KernelKey};
use brickcast_volume::scene::{Extreme, Filter};
use brickcast_volume::{PixelRect, RawPixel};
use glam::UVec2;
use rayon::prelude::*;

use super::brick::IntervalBrick;
use crate::kernel::{
    BackendInfo, BrickCounts, Job, JobImage, KernelScene, RaycastError, Watch, check_jobs, new_pixels,
};

/// By how much a sampler of 8 bits weighs wrong along an axis, at most.
const HARDWARE_BLUR: f32 = 1.0 / 256.0;
/// By how much a GPU places a sample elsewhere, of the largest coordinate: operations in another order, and fused ones.
const PLACE_SHARE: f32 = 1e-6;

/// What of a scene is asked for.
#[derive(Debug, Clone)]
pub(crate) struct IntervalScene {
    pub(crate) extreme: Extreme,
    pub(crate) tables: IntervalTables,
}

/// Renders every job as [`Raycaster::render_watched`](crate::kernel::Raycaster::render_watched) does, into halves of
/// intervals; `info` is of the backend whose pictures the intervals shall hold.
///
/// # Errors
/// Bricks that are none of intervals, out of memory; nobody wants it any more.
pub(crate) fn render(
    scene: &KernelScene,
    interval: &IntervalScene,
    info: &BackendInfo,
    jobs: &[Job],
    watch: Watch<'_>,
) -> Result<Vec<JobImage>, RaycastError> {
    check_jobs(scene, jobs, u32::MAX)?;
    let frame = unending(scene.frame_uniform());
    let data = scene.data(&frame);
    let blur = if info.backend == "cpu" {
        0.0
    } else {
        let far = scene.view.kernel().eye.abs().max_element();
        let reach = jobs.iter().flat_map(|job| &job.bricks).filter_map(|brick| {
            brick.as_any().downcast_ref::<IntervalBrick>().map(|b| b.uniform.owned_hi.into_iter().max().unwrap_or(0))
        });
        let place = PLACE_SHARE * far.max(reach.max().unwrap_or(0) as f32);
        if scene.filter == Filter::Hardware { HARDWARE_BLUR + place } else { place }
    };
    let render_job = |job: &Job| {
        let bricks = job.bricks.iter().map(|b| b.as_any().downcast_ref::<IntervalBrick>());
        let bricks: Vec<&IntervalBrick> =
            bricks.collect::<Option<_>>().ok_or(RaycastError::ForeignBrick { backend: "interval" })?;
        let placed: Vec<Placed<'_>> = bricks
            .iter()
            .map(|brick| {
                let traits = BrickTraits { holes: brick.uniform.holes != 0, ..BrickTraits::default() };
                let key = KernelKey::of(scene.look(), traits);
                let bound = Bindings { scene: &data, brick: &brick.uniform, data: brick.data(), key };
                let is_exact = blur == 0.0 || scene.filter == Filter::Nearest || key.take.slab_kind().surfaces;
                let spans = match brick.flattened() {
                    Some(f) => Some(Spans { high: Some(&f.high), distances: Some(&f.distances), blur }),
                    None if is_exact => None,
                    None => Some(Spans { high: None, distances: None, blur }),
                };
                Placed { rect: scene.view.project(&brick.uniform.owned()), spans: BrickSpans { bound, spans } }
            })
            .collect();
        let mut pixels = new_pixels(scene.pixel_kind(), &job.rect)?;
        let width = job.rect.size().x as usize;
        let rows = pixels.raw_mut().par_chunks_mut(width.max(1)).enumerate().with_max_len(1);
        let row = |(y, row): (usize, &mut [RawPixel])| {
            let mut counts = vec![RayCounts::default(); placed.len()];
            let mut samples = RaySamples::default();
            for (x, pixel) in row.iter_mut().enumerate() {
                watch.is_wanted()?;
                let at = job.rect.lo + UVec2::new(x as u32, y as u32);
                let ray = pixel_ray(&frame, at.x, at.y);
                samples.clear();
                for (brick, counts) in placed.iter().zip(&mut counts) {
                    if samples.is_done() {
                        break;
                    }
                    if contains(&brick.rect, at) {
                        *counts = counts.plus(walk_brick(&brick.spans, &interval.tables, &ray, &mut samples));
                    }
                }
                let within = samples.interval();
                let ([r, g, b, _], [.., a]) = match interval.extreme {
                    Extreme::Lowest => (within.lo, within.hi),
                    Extreme::Highest => (within.hi, within.lo),
                };
                *pixel = [r, g, b, a];
            }
            watch.goes_on()?;
            Ok::<Vec<BrickCounts>, RaycastError>(counts.into_iter().map(BrickCounts::from).collect())
        };
        let counts = rows.map(row).try_reduce(
            || vec![BrickCounts::default(); placed.len()],
            |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a = a.plus(b));
                Ok(a)
            },
        )?;
        Ok(JobImage { rect: job.rect, pixels, counts })
    };
    crate::cpu::on_kernel_threads(|| jobs.par_iter().map(render_job).collect())
}

/// A brick in a job, and the pixels that it may show in.
struct Placed<'a> {
    rect: PixelRect,
    spans: BrickSpans<'a>,
}

fn contains(rect: &PixelRect, at: UVec2) -> bool {
    at.cmpge(rect.lo).all() && at.cmplt(rect.hi).all()
}

//! Recording a call's dispatches, and bringing accumulators and counters back.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use brickcast_shaders::layout::{COUNTERS, Counter};
use brickcast_shaders::{RaycastVariant, WORKGROUP_PIXELS};
use brickcast_volume::PixelRect;

use super::cells::MapBuilder;
use super::device::Gpu;
use super::kernel::{DISPATCH_BYTES, FRAME_BYTES, FrameTables, Kernels, SCENE_BYTES};
use super::plan::{self, Band, Batch, Dispatch, PIXEL_BYTES};
use super::upload::GpuBrick;
use crate::brick::emptiness::Emptiness;
use crate::kernel::{BrickCounts, Job, JobImage, KernelScene, RaycastError, Watch};

/// The most dispatches of one submission.
const SUBMIT_DISPATCHES: usize = 1024;
/// Of a dispatch's counters.
const COUNTER_BYTES: u64 = COUNTERS as u64 * 4;

/// Buffers that live from call to call.
#[derive(Debug)]
pub(super) struct Scratch {
    frame: wgpu::Buffer,
    dispatches: wgpu::Buffer,
    /// Bytes from one dispatch's uniform to the next.
    dispatch_stride: u64,
    buffers: Option<Buffers>,
    /// The last tables, as bound for a variant.
    tables: Option<(FrameTables, RaycastVariant, wgpu::BindGroup)>,
    maps: MapBuilder,
}

/// Accumulator and counters, and where they are read.
#[derive(Debug)]
struct Buffers {
    accumulator: wgpu::Buffer,
    counters: wgpu::Buffer,
    staging: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
}

/// What a call renders with.
pub(super) struct Call<'a> {
    pub(super) gpu: &'a Arc<Gpu>,
    pub(super) kernels: &'a Kernels,
    pub(super) variant: RaycastVariant,
    /// Where the scene skips.
    pub(super) emptiness: Option<&'a Arc<Emptiness>>,
    /// Most bytes of the accumulator buffer.
    pub(super) accumulator_bytes: u64,
    pub(super) watch: Watch<'a>,
}

fn buffer(gpu: &Gpu, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
}

impl Scratch {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, RaycastError> {
        let alignment = u64::from(gpu.limits.min_storage_buffer_offset_alignment);
        let dispatch_stride = DISPATCH_BYTES.next_multiple_of(alignment.max(1));
        let bytes = dispatch_stride * SUBMIT_DISPATCHES as u64;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        gpu.guarded("uniform buffers", bytes, || Self {
            frame: buffer(gpu, "frame", SCENE_BYTES, usage),
            dispatches: buffer(gpu, "dispatches", bytes, usage),
            dispatch_stride,
            buffers: None,
            tables: None,
            maps: MapBuilder::default(),
        })
    }

    /// Makes room for `pixels` and `counters`; grows only, by doubling up to `most` bytes of pixels.
    fn reserve(&mut self, call: &Call<'_>, pixels: u64, counters: u64) -> Result<&Buffers, RaycastError> {
        let (need_pixels, need_counters) = (pixels * PIXEL_BYTES, counters.max(1) * COUNTER_BYTES);
        let old = self.buffers.as_ref().map_or((0, 0), |b| (b.accumulator.size(), b.counters.size()));
        if old.0 < need_pixels || old.1 < need_counters {
            // The old ones first: both at a time might not fit.
            self.buffers = None;
            let grown = |old: u64, need: u64| if old < need { need.next_power_of_two() } else { old };
            let pixel_bytes = grown(old.0, need_pixels).min(call.accumulator_bytes.max(need_pixels));
            let counter_bytes = grown(old.1, need_counters.max(4096));
            let staging_bytes = pixel_bytes + counter_bytes;
            let gpu = call.gpu;
            let kept = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
            let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
            let dispatches = &self.dispatches;
            self.buffers = Some(gpu.guarded("accumulators", pixel_bytes + staging_bytes, || {
                let accumulator = buffer(gpu, "accumulator", pixel_bytes, kept);
                let counters = buffer(gpu, "counters", counter_bytes, kept);
                let bind_group = call.kernels.bind_dispatch(gpu, dispatches, &accumulator, &counters);
                Buffers { accumulator, counters, staging: buffer(gpu, "staging", staging_bytes, read), bind_group }
            })?);
        }
        let missing = RaycastError::OutOfMemory { what: "accumulators", bytes: need_pixels };
        self.buffers.as_ref().ok_or(missing)
    }

    /// What scenes that skip need.
    pub(super) fn warm_up_maps(&mut self, gpu: &Gpu) -> Result<(), RaycastError> {
        self.maps.warm_up(gpu)
    }

    /// Binds the frame; tables are uploaded only when they change.
    fn bind_frame(&mut self, call: &Call<'_>, scene: &KernelScene) -> Result<wgpu::BindGroup, RaycastError> {
        let gpu = call.gpu;
        let frame = scene.frame_uniform();
        gpu.guarded("a frame's uniform", SCENE_BYTES, || {
            gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
            if let Some(style) = &scene.style {
                gpu.queue.write_buffer(&self.frame, FRAME_BYTES, bytemuck::bytes_of(&style.uniform));
            }
        })?;
        let tables = FrameTables::of(scene);
        if let Some((known, variant, bound)) = &self.tables
            && *variant == call.variant
            && known.is_same(&tables)
        {
            return Ok(bound.clone());
        }
        // The old ones first: both at a time might not fit.
        self.tables = None;
        let bound = gpu.guarded("a transfer function", tables.bytes(), || {
            call.kernels.bind_frame(gpu, call.variant, &self.frame, &tables)
        })?;
        self.tables = Some((tables, call.variant, bound.clone()));
        Ok(bound)
    }
}

pub(super) fn render(
    call: &Call<'_>,
    scratch: &mut Scratch,
    scene: &KernelScene,
    jobs: &[Job],
) -> Result<Vec<JobImage>, RaycastError> {
    let bricks: Vec<Vec<&GpuBrick>> = jobs.iter().map(|job| bricks_of(call.gpu, job)).collect::<Result<_, _>>()?;
    let mut images: Vec<JobImage> = jobs
        .iter()
        .map(|job| {
            let counts = vec![BrickCounts::default(); job.bricks.len()];
            Ok(JobImage { rect: job.rect, pixels: job.started(scene.pixel_kind())?, counts })
        })
        .collect::<Result<_, RaycastError>>()?;
    let frame = scratch.bind_frame(call, scene)?;
    if let Some(emptiness) = call.emptiness {
        scratch.maps.update(call.gpu, emptiness, bricks.iter().flatten().copied())?;
    }
    let rects: Vec<PixelRect> = jobs.iter().map(|job| job.rect).collect();
    let capacity = (call.accumulator_bytes / PIXEL_BYTES).min(u64::from(u32::MAX)) as u32;
    for batch in plan::batches(&rects, capacity) {
        let mut dispatches = Vec::new();
        for band in &batch.bands {
            for (i, brick) in bricks[band.job].iter().enumerate() {
                let of_brick = brick.in_scene(jobs[band.job].sides_of(i), scene, call.emptiness);
                dispatches.extend(plan::dispatches(&scene.view, band, (i, call.gpu.dispatch_samples()), of_brick));
            }
        }
        if !dispatches.is_empty() {
            let front = jobs.iter().any(|job| job.front.is_some()).then_some(&*images);
            let staged = run(call, scratch, &frame, &bricks, (&batch, front), &mut dispatches)?;
            collect(call, scratch, &batch, &dispatches, staged, &mut images)?;
        }
    }
    Ok(images)
}

fn bricks_of<'a>(gpu: &Arc<Gpu>, job: &'a Job) -> Result<Vec<&'a GpuBrick>, RaycastError> {
    job.bricks
        .iter()
        .map(|b| b.as_any().downcast_ref::<GpuBrick>().filter(|b| b.is_on(gpu)))
        .collect::<Option<_>>()
        .ok_or(RaycastError::ForeignBrick { backend: "gpu" })
}

/// Runs of dispatches that make up a submission of at most `most` samples: short, so that waits are.
fn submissions(dispatches: &[Dispatch], most: f64) -> Vec<std::ops::Range<usize>> {
    let (mut runs, mut first, mut samples) = (Vec::new(), 0, 0.0);
    for (i, dispatch) in dispatches.iter().enumerate() {
        if i > first && (i - first == SUBMIT_DISPATCHES || samples + dispatch.samples > most) {
            runs.push(first..i);
            (first, samples) = (i, 0.0);
        }
        samples += dispatch.samples;
    }
    runs.push(first..dispatches.len());
    runs
}

/// Renders a batch, over what is in front where there is something, and copies the result to the staging buffer;
/// returns its bytes there.
fn run(
    call: &Call<'_>,
    scratch: &mut Scratch,
    frame: &wgpu::BindGroup,
    bricks: &[Vec<&GpuBrick>],
    (batch, front): (&Batch, Option<&[JobImage]>),
    dispatches: &mut [Dispatch],
) -> Result<u64, RaycastError> {
    let gpu = call.gpu;
    let stride = scratch.dispatch_stride;
    scratch.reserve(call, u64::from(batch.pixels), dispatches.len() as u64)?;
    let Some(buffers) = &scratch.buffers else { return Ok(0) };
    let pixel_bytes = u64::from(batch.pixels) * PIXEL_BYTES;
    let counter_bytes = dispatches.len() as u64 * COUNTER_BYTES;
    for (counter, dispatch) in dispatches.iter_mut().enumerate() {
        dispatch.uniform.counter = counter as u32;
    }
    let mut pipelines = HashMap::new();
    for dispatch in &*dispatches {
        if let Entry::Vacant(vacant) = pipelines.entry(dispatch.key) {
            vacant.insert(call.kernels.pipeline(gpu, call.variant, dispatch.key)?);
        }
    }
    let runs = submissions(dispatches, gpu.dispatch_samples());
    let last = runs.len() - 1;
    let mut before = None;
    for (n, run) in runs.into_iter().enumerate() {
        let mut uniforms = vec![0; run.len() * stride as usize];
        for (slot, dispatch) in uniforms.chunks_mut(stride as usize).zip(&dispatches[run.clone()]) {
            slot[..DISPATCH_BYTES as usize].copy_from_slice(bytemuck::bytes_of(&dispatch.uniform));
        }
        let submission = gpu.guarded("rendering", 0, || {
            gpu.queue.write_buffer(&scratch.dispatches, 0, &uniforms);
            if n == 0 {
                write_front(gpu, &buffers.accumulator, batch, front.unwrap_or_default());
            }
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            if n == 0 {
                if front.is_none() {
                    encoder.clear_buffer(&buffers.accumulator, 0, Some(pixel_bytes));
                }
                encoder.clear_buffer(&buffers.counters, 0, Some(counter_bytes));
            }
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_bind_group(0, frame, &[]);
                // wgpu puts a barrier between dispatches that write the same buffer: bricks blend in this order.
                let mut key = None;
                for (i, dispatch) in dispatches[run].iter().enumerate() {
                    if key != Some(dispatch.key) {
                        key = Some(dispatch.key);
                        pass.set_pipeline(&pipelines[&dispatch.key]);
                    }
                    let [width, height] = dispatch.uniform.rect_size;
                    pass.set_bind_group(1, &buffers.bind_group, &[(i as u64 * stride) as u32]);
                    pass.set_bind_group(2, &bricks[dispatch.job][dispatch.position].bind_group, &[]);
                    let groups = |pixels: u32| pixels.div_ceil(WORKGROUP_PIXELS);
                    pass.dispatch_workgroups(groups(width), groups(height), 1);
                }
            }
            if n == last {
                encoder.copy_buffer_to_buffer(&buffers.accumulator, 0, &buffers.staging, 0, pixel_bytes);
                encoder.copy_buffer_to_buffer(&buffers.counters, 0, &buffers.staging, pixel_bytes, counter_bytes);
            }
            gpu.queue.submit([encoder.finish()])
        })?;
        // One submission runs while the next is recorded; the last is waited for by the mapping.
        if let Some(before) = before.replace(submission) {
            gpu.wait("rendering", before)?;
            // What runs still writes nothing that a later call reads before its own.
            call.watch.goes_on()?;
        }
    }
    if let Some(submission) = before {
        gpu.wait("rendering", submission)?;
    }
    Ok(pixel_bytes + counter_bytes)
}

/// The accumulators of a batch as they start.
fn write_front(gpu: &Gpu, accumulator: &wgpu::Buffer, batch: &Batch, front: &[JobImage]) {
    for band in &batch.bands {
        if let Some(image) = front.get(band.job) {
            let pixels = &image.pixels.raw()[first_pixel(band, image)..][..band.rect.pixel_count()];
            gpu.queue.write_buffer(accumulator, u64::from(band.base) * PIXEL_BYTES, bytemuck::cast_slice(pixels));
        }
    }
}

/// Where a band begins in its job's image: bands are whole rows, so that their pixels lie together.
fn first_pixel(band: &Band, image: &JobImage) -> usize {
    (band.rect.lo.y - image.rect.lo.y) as usize * band.rect.size().x as usize
}

/// Staging buffer to images.
fn collect(
    call: &Call<'_>,
    scratch: &Scratch,
    batch: &Batch,
    dispatches: &[Dispatch],
    bytes: u64,
    images: &mut [JobImage],
) -> Result<(), RaycastError> {
    let Some(buffers) = &scratch.buffers else { return Ok(()) };
    call.gpu.read("reading back", &buffers.staging, bytes, |staged| {
        let (pixels, counters) = staged.split_at(batch.pixels as usize * PIXEL_BYTES as usize);
        for band in &batch.bands {
            let image = &mut images[band.job];
            let count = band.rect.pixel_count();
            let to = first_pixel(band, image);
            let from = band.base as usize * PIXEL_BYTES as usize;
            let target: &mut [u8] = bytemuck::cast_slice_mut(&mut image.pixels.raw_mut()[to..to + count]);
            target.copy_from_slice(&pixels[from..from + target.len()]);
        }
        for (dispatch, counter) in dispatches.iter().zip(counters.as_chunks::<{ COUNTER_BYTES as usize }>().0) {
            let number = |which: Counter| u64::from(u32::from_le_bytes(counter.as_chunks::<4>().0[which as usize]));
            let samples = number(Counter::Reads);
            let positions = if dispatch.key.counts_positions() { number(Counter::Taken) } else { samples };
            let (leapt, skips) = (number(Counter::Leapt), number(Counter::Jumps));
            let counts = &mut images[dispatch.job].counts[dispatch.position];
            *counts = counts.plus(BrickCounts { samples, positions, leapt, skips });
        }
    })
}

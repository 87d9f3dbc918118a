//! The raycaster on the GPU, through wgpu. Nothing outside this folder knows wgpu.

mod cells;
mod device;
mod device_files;
pub mod drivers;
mod filter_test;
mod kernel;
mod options;
mod plan;
mod readback;
#[cfg(test)]
mod reflection;
mod tables;
mod upload;

use std::sync::{Arc, Mutex, PoisonError};

use brickcast_shaders::RaycastVariant;
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::regions::Density;
use brickcast_volume::scene::Filter;
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{Camera, Geometry, Orbit, PictureSize, View};
use glam::UVec3;

use crate::brick::bytes::{CELL_BYTES, expected_bytes};
use crate::brick::emptiness::EmptinessCache;
use crate::brick::texels::BuiltBrick;
use crate::kernel::{
    BackendInfo, BrickInput, Job, JobImage, KernelKey, KernelScene, RaycastError, Raycaster, Recipe, ResidentBrick,
    Watch, check_jobs,
};
use device::Gpu;
use kernel::Kernels;
use readback::{Call, Scratch};

pub use options::{GpuError, GpuOptions};

/// Renders with wgpu compute kernels.
#[derive(Debug)]
pub struct GpuRaycaster {
    info: BackendInfo,
    gpu: Arc<Gpu>,
    kernels: Kernels,
    /// The linear filter cannot be used: everything goes through the exact kernel.
    exact_only: bool,
    accumulator_bytes: u64,
    emptiness: EmptinessCache,
    /// Also makes calls take turns, which bounds the memory of accumulators.
    scratch: Mutex<Scratch>,
}

impl GpuRaycaster {
    /// Opens the best adapter and tests its filter.
    ///
    /// # Errors
    /// No adapter, none of the name asked for, or one that does not work.
    pub fn new(options: GpuOptions) -> Result<Self, GpuError> {
        let gpu = Arc::new(Gpu::open(&options)?);
        let failed = |source| GpuError::StartUp { adapter: gpu.name.clone(), source };
        let mut notes = Vec::new();
        let norm16 = gpu.can_filter && !options.without_norm16;
        if gpu.is_software {
            notes.push(format!("{} is a software driver: the GPU kernel runs on the processor", gpu.name));
        }
        let mut exact_only = !norm16;
        if norm16 {
            if let Some(complaint) = filter_test::complaint(&gpu).map_err(failed)? {
                notes.push(format!("{complaint}: using the exact filter (eight loads) instead"));
                exact_only = true;
            }
        } else {
            notes.push(
                "the adapter cannot filter 16-bit voxels: they take 4 bytes, and the exact filter (eight loads) is \
                 used"
                    .to_owned(),
            );
        }
        let kernels = Kernels::new(&gpu, norm16, exact_only).map_err(failed)?;
        let threads =
            if gpu.is_software { std::thread::available_parallelism().map_or(1, |n| n.get() as u32) } else { 1 };
        let info = BackendInfo {
            backend: "gpu",
            adapter: gpu.name.clone(),
            notes,
            threads,
            is_on_processor: gpu.is_software,
            limits: gpu.told_limits(),
        };
        let accumulator_bytes = options
            .accumulator_bytes
            .min(gpu.limits.max_storage_buffer_binding_size)
            .min(gpu.limits.max_buffer_size)
            .max(plan::MIN_ACCUMULATOR_BYTES);
        let scratch = Mutex::new(Scratch::new(&gpu).map_err(failed)?);
        Ok(Self { info, gpu, kernels, exact_only, accumulator_bytes, emptiness: EmptinessCache::default(), scratch })
    }

    /// Takes the device away, as a driver does that resets: for tests of what then follows.
    #[doc(hidden)]
    pub fn lose_device(&self) {
        self.gpu.device.destroy();
    }

    fn variant(&self, filter: Filter) -> RaycastVariant {
        match filter {
            Filter::Hardware if !self.exact_only => RaycastVariant::Hardware,
            _ => RaycastVariant::Exact,
        }
    }
}

impl Raycaster for GpuRaycaster {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn brick_bytes(&self, stored_voxels: u64, recipe: Recipe) -> u64 {
        expected_bytes(stored_voxels, recipe, self.kernels.voxel_bytes(), CELL_BYTES)
    }

    fn upload_bytes(&self, stored_voxels: u64) -> u64 {
        // The driver's copy, and what it is copied from where texels are no codes.
        let texel = self.kernels.voxel_bytes();
        stored_voxels * if texel == 2 { texel } else { 2 * texel }
    }

    fn upload(&self, owned: OwnedBox, input: &BrickInput<'_>) -> Result<Arc<dyn ResidentBrick>, RaycastError> {
        let prepared = BuiltBrick::new(&owned, input)?;
        Ok(Arc::new(upload::upload(&self.gpu, &self.kernels, owned, prepared)?))
    }

    fn upload_uniform(&self, owned: OwnedBox, mean: Density) -> Result<Arc<dyn ResidentBrick>, RaycastError> {
        let prepared = BuiltBrick::uniform(&owned, mean);
        Ok(Arc::new(upload::upload(&self.gpu, &self.kernels, owned, prepared)?))
    }

    fn warm_up(&self, filter: Filter, keys: &[KernelKey]) -> Result<(), RaycastError> {
        let broken = |reason: String| RaycastError::Gpu { what: "warming up", reason };
        let (scene, owned) = smallest_scene(filter).map_err(broken)?;
        let stored = owned.stored(brickcast_volume::brick::GHOST_SAMPLED);
        let codes = vec![u16::MAX; stored.voxel_count() as usize];
        let bricks = vec![self.upload(owned, &BrickInput::plain(&BrickVoxels { stored, codes, has_holes: false }))?];
        self.render(&scene, &[Job::new(bricks, scene.view.size().full_rect())])?;
        if keys.iter().any(|key| key.has_map()) {
            self.scratch.lock().unwrap_or_else(PoisonError::into_inner).warm_up_maps(&self.gpu)?;
        }
        keys.iter().try_for_each(|&key| self.kernels.pipeline(&self.gpu, self.variant(filter), key).map(drop))
    }

    fn render_watched(
        &self,
        scene: &KernelScene,
        jobs: &[Job],
        watch: Watch<'_>,
    ) -> Result<Vec<JobImage>, RaycastError> {
        let limits = &self.gpu.limits;
        check_jobs(scene, jobs, limits.max_texture_dimension_2d.saturating_mul(tables::ROW as u32))?;
        let emptiness = self.emptiness.get(scene);
        let call = Call {
            gpu: &self.gpu,
            kernels: &self.kernels,
            variant: self.variant(scene.filter),
            emptiness: emptiness.as_ref(),
            accumulator_bytes: self.accumulator_bytes,
            watch,
        };
        let mut scratch = self.scratch.lock().unwrap_or_else(PoisonError::into_inner);
        readback::render(&call, &mut scratch, scene, jobs)
    }
}

/// One voxel, one workgroup: enough to make the driver compile the kernel.
fn smallest_scene(filter: Filter) -> Result<(KernelScene, OwnedBox), String> {
    let words = |e: &dyn std::fmt::Display| e.to_string();
    let geometry = Geometry::new([1; 3], [1.0; 3], [0.0; 3]).map_err(|e| words(&e))?;
    let camera = Camera::orbit(&geometry, Orbit::default()).map_err(|e| words(&e))?;
    let size = PictureSize::new(16, 16).map_err(|e| words(&e))?;
    let view = View::new(&geometry, &camera, size, 0.5).map_err(|e| words(&e))?;
    let colors = vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }];
    let function = TransferFunction::new(colors, vec![OpacityPoint { x: 0.0, opacity: 0.5 }]).map_err(|e| words(&e))?;
    let table = Arc::new(TransferTable::build(&function, (0.0, 1.0), 0.5));
    let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::ONE };
    Ok((KernelScene::plain(view, table, 1.0, filter), owned))
}

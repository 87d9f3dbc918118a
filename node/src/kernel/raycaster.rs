//! One interface over the GPU and the CPU kernel.

use std::sync::Arc;

use brickcast_shaders::KernelKey;
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::regions::Density;
use brickcast_volume::scene::Filter;

use super::brick::{BrickInput, ResidentBrick};
use super::error::RaycastError;
use super::job::{Job, JobImage};
use super::recipe::Recipe;
use super::scene::KernelScene;
use super::watch::{Pulse, Watch};

/// Who renders.
#[derive(Debug, Clone)]
pub struct BackendInfo {
    /// `gpu` or `cpu`.
    pub backend: &'static str,
    /// Adapter and driver, or the processor.
    pub adapter: String,
    /// Fallbacks taken at start-up, in words for the user.
    pub notes: Vec<String>,
    /// Processor threads that render; 1 where a real GPU does.
    pub threads: u32,
    /// The processor renders, by itself or playing GPU.
    pub is_on_processor: bool,
    /// What of the adapter bounds volumes and pictures, by wgpu's names; nothing on the processor.
    pub limits: Vec<(&'static str, u64)>,
}

/// The GPU or the CPU kernel behind one door. Calls block; a node calls them from a blocking thread.
pub trait Raycaster: Send + Sync + std::fmt::Debug {
    fn info(&self) -> &BackendInfo;

    /// Bytes that a brick with a stored box of `stored_voxels` voxels will occupy, unless it turns out to be of one
    /// region (then next to none); exact but for macrocells of bricks that are no cubes.
    fn brick_bytes(&self, stored_voxels: u64, recipe: Recipe) -> u64;

    /// Bytes that such a brick holds on its way to where it renders, beside what it occupies there; nothing where that
    /// is the processor.
    fn upload_bytes(&self, _stored_voxels: u64) -> u64 {
        0
    }

    /// # Errors
    /// Input that does not fit the recipe or itself, out of memory, device lost.
    fn upload(&self, owned: OwnedBox, input: &BrickInput<'_>) -> Result<Arc<dyn ResidentBrick>, RaycastError>;

    /// A brick whose stored box is all one region of this mean: like [`Raycaster::upload`] of its voxels, without them.
    ///
    /// # Errors
    /// Out of memory, device lost.
    fn upload_uniform(&self, owned: OwnedBox, mean: Density) -> Result<Arc<dyn ResidentBrick>, RaycastError>;

    /// Compiles what a scene needs whose bricks take these kernels, so that the first frame is not slower than the
    /// next.
    ///
    /// # Errors
    /// Device lost.
    fn warm_up(&self, filter: Filter, keys: &[KernelKey]) -> Result<(), RaycastError>;

    /// Renders every job into an accumulator of its own, from where it starts, with early termination. Pixels depend
    /// neither on how a picture is cut into jobs' rectangles nor on how its bricks are cut into jobs that go on where
    /// others ended.
    ///
    /// # Errors
    /// Out of memory, device lost; `watch` says that nobody wants it any more.
    fn render_watched(
        &self,
        scene: &KernelScene,
        jobs: &[Job],
        watch: Watch<'_>,
    ) -> Result<Vec<JobImage>, RaycastError>;

    /// Can the bricks of a job be seen by several scenes, those of a volume's levels?
    fn takes_scenes_together(&self) -> bool {
        false
    }

    /// As [`Raycaster::render_watched`], of scenes that differ in their volume's level alone. Where they are not taken
    /// together all jobs are of the same one.
    ///
    /// # Errors
    /// As [`Raycaster::render_watched`].
    fn render_scenes(
        &self,
        scenes: &[&KernelScene],
        jobs: &[Job],
        watch: Watch<'_>,
    ) -> Result<Vec<JobImage>, RaycastError> {
        let scene = jobs.first().and_then(|job| scenes.get(job.scene_of(0)));
        scene.map_or_else(|| Ok(Vec::new()), |scene| self.render_watched(scene, jobs, watch))
    }

    /// The same to its end.
    ///
    /// # Errors
    /// Out of memory, device lost.
    fn render(&self, scene: &KernelScene, jobs: &[Job]) -> Result<Vec<JobImage>, RaycastError> {
        self.render_watched(scene, jobs, Watch::new(&Pulse::default(), &|| false))
    }
}

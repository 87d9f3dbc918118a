//! One interface over the GPU and the CPU kernel.

use std::sync::Arc;

use brickcast_volume::brick::OwnedBox;
use brickcast_volume::scene::Filter;
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::TransferTable;
use brickcast_volume::{PixelRect, Premul, View};

/// What a kernel needs to know of a frame.
#[derive(Debug, Clone)]
pub struct KernelScene {
    pub view: View,
    pub table: Arc<TransferTable>,
    /// In (0, 1]; 1 is off.
    pub early_termination: f32,
    pub filter: Filter,
}

/// A brick in the backend's memory; dropping it frees the memory.
pub trait ResidentBrick: Send + Sync + std::fmt::Debug {
    /// Bytes that it occupies.
    fn bytes(&self) -> u64;
    fn as_any(&self) -> &dyn std::any::Any;
}

/// One accumulator: bricks front to back, into the pixels of `rect`.
#[derive(Debug, Clone)]
pub struct Job {
    pub bricks: Vec<Arc<dyn ResidentBrick>>,
    pub rect: PixelRect,
}

/// A finished accumulator.
#[derive(Debug, Clone)]
pub struct JobImage {
    pub rect: PixelRect,
    /// Row-major within `rect`.
    pub pixels: Vec<Premul>,
    /// Samples that each brick of the job took, in the job's order.
    pub samples: Vec<u64>,
}

#[derive(Debug, thiserror::Error)]
pub enum RaycastError {
    #[error("{0}")]
    Todo(String),
}

/// Who renders.
#[derive(Debug, Clone)]
pub struct BackendInfo {
    /// `gpu` or `cpu`.
    pub backend: &'static str,
    /// Adapter and driver, or the processor.
    pub adapter: String,
    /// Fallbacks taken at start-up, in words for the user.
    pub notes: Vec<String>,
    pub threads: u32,
}

/// The GPU or the CPU kernel behind one door. Calls block; a node calls them from a blocking thread.
pub trait Raycaster: Send + Sync + std::fmt::Debug {
    fn info(&self) -> &BackendInfo;

    /// Bytes that a brick with a stored box of `stored_voxels` voxels will occupy.
    fn brick_bytes(&self, stored_voxels: u64) -> u64;

    /// # Errors
    /// Out of memory, device lost.
    fn upload(&self, owned: OwnedBox, voxels: &BrickVoxels) -> Result<Arc<dyn ResidentBrick>, RaycastError>;

    /// Compiles what `filter` needs, so that the first frame is not slower than the next.
    ///
    /// # Errors
    /// Device lost.
    fn warm_up(&self, filter: Filter) -> Result<(), RaycastError>;

    /// Renders every job into an accumulator of its own, from zero, with early termination.
    ///
    /// # Errors
    /// Out of memory, device lost.
    fn render(&self, scene: &KernelScene, jobs: &[Job]) -> Result<Vec<JobImage>, RaycastError>;
}

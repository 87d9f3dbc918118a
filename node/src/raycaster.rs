//! One interface over the GPU and the CPU kernel.

use std::sync::Arc;

use brickcast_volume::brick::OwnedBox;
use brickcast_volume::regions::{BrickRegions, ClassifyError, Density, RegionTable};
use brickcast_volume::scene::{Filter, RegionView};
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::TransferTable;
use brickcast_volume::{PixelRect, Premul, StoredBox, View};

use crate::cpu::CpuRaycaster;
use crate::gpu::{GpuError, GpuOptions, GpuRaycaster};
use crate::kernel_style::KernelStyle;
use crate::recipe::Recipe;
use crate::watch::{Cancelled, Pulse, Watch};
use crate::worth::Occupied;

pub use brickcast_shaders::Features;
use brickcast_shaders::FrameUniform;

/// What a kernel needs to know of a frame.
#[derive(Debug, Clone)]
pub struct KernelScene {
    pub view: View,
    pub table: Arc<TransferTable>,
    /// In (0, 1]; 1 is off.
    pub early_termination: f32,
    pub filter: Filter,
    /// Use the macrocells of bricks that have them. What a brick leaps through is its recipe's business.
    pub skip_empty: bool,
    /// Bricks without region flags (see [`Recipe::region_flags`]) count as free of regions.
    pub region_view: RegionView,
    /// For samples whose nearest voxel is in a region.
    pub region_table: Option<Arc<TransferTable>>,
    /// What the plain kernels do not do; none where the scene asks for nothing of it.
    pub style: Option<KernelStyle>,
}

impl KernelScene {
    /// Without skipping, and regions like all else.
    #[must_use]
    pub fn plain(view: View, table: Arc<TransferTable>, early_termination: f32, filter: Filter) -> Self {
        let (skip_empty, region_view, region_table, style) = (false, RegionView::All, None, None);
        Self { view, table, early_termination, filter, skip_empty, region_view, region_table, style }
    }

    /// The uniform of the frame.
    #[must_use]
    pub fn frame_uniform(&self) -> FrameUniform {
        // A projection's pixels are no opacities, and every sample counts.
        let is_projection = self.style.as_ref().is_some_and(|style| style.kinds.mode != 0);
        let stop = if is_projection { 1.0 } else { self.early_termination };
        FrameUniform::new(&self.view.kernel(), &self.table, stop)
            .with_regions(self.region_view, self.region_table.as_deref())
            .with_filter(self.filter)
    }

    /// The part of `owned` that holds all samples and slabs that show, where all that is not empty lies in `occupied`: a slab
    /// that shows starts or ends there. Every sample of a projection counts.
    /// And whether it pays to skip in it.
    pub(crate) fn bounds(&self, occupied: Occupied, owned: &OwnedBox) -> (OwnedBox, bool) {
        let Occupied { bounds, skips, skips_uncut } = occupied;
        if self.style.as_ref().is_some_and(|style| style.kinds.mode != 0) {
            return (*owned, skips_uncut);
        }
        if bounds.voxel_count() == 0 {
            return (OwnedBox { lo: owned.lo, hi: owned.lo }, skips);
        }
        let reach = glam::UVec3::splat(self.style.as_ref().map_or(0, |style| style.reach));
        let lo = bounds.lo.saturating_sub(reach).max(owned.lo);
        (OwnedBox { lo, hi: (bounds.hi + reach).min(owned.hi).max(lo) }, skips)
    }

    /// May macrocells be skipped in a brick? In a projection what is skipped counts as a sample of no weight; a place that holds no
    /// data is none at all.
    pub(crate) fn skips_in(&self, has_holes: bool) -> bool {
        !has_holes || self.style.as_ref().is_none_or(|style| style.kinds.mode == 0)
    }

    /// True where it matters which samples are in regions.
    #[must_use]
    pub fn tells_regions_apart(&self) -> bool {
        self.region_view != RegionView::All || self.region_table.is_some()
    }
}

/// What a resident brick is made from.
#[derive(Debug, Clone, Copy)]
pub struct BrickInput<'a> {
    pub voxels: &'a BrickVoxels,
    /// Of the brick, at least one voxel beyond the stored box; for recipes with a guard or region flags.
    pub regions: Option<(&'a BrickRegions, &'a RegionTable)>,
    pub recipe: Recipe,
}

impl<'a> BrickInput<'a> {
    /// The voxels as they are.
    #[must_use]
    pub fn plain(voxels: &'a BrickVoxels) -> Self {
        Self { voxels, regions: None, recipe: Recipe::default() }
    }
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
    /// What each brick of the job took, in the job's order.
    pub counts: Vec<BrickCounts>,
}

impl JobImage {
    /// Of all bricks.
    #[must_use]
    pub fn total(&self) -> BrickCounts {
        self.counts.iter().copied().fold(BrickCounts::default(), BrickCounts::plus)
    }
}

/// What the rays of a job did in one brick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BrickCounts {
    /// Reads of texels, probes and region flags included.
    pub samples: u64,
    /// Sample positions integrated; a leap counts all of its.
    pub positions: u64,
    /// Positions that leaps covered.
    pub leapt: u64,
    /// Jumps by macrocells alone: turns of a ray's loop that read no texel.
    pub skips: u64,
}

impl BrickCounts {
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self {
            samples: self.samples.saturating_add(more.samples),
            positions: self.positions.saturating_add(more.positions),
            leapt: self.leapt.saturating_add(more.leapt),
            skips: self.skips.saturating_add(more.skips),
        }
    }
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RaycastError {
    #[error(transparent)]
    Classify(#[from] ClassifyError),
    #[error(
        "recipe {0:?} needs the brick's regions; prepare the store with regions, or leave out leaping and region views"
    )]
    NoRegions(Recipe),
    #[error("macrocells of {0} voxels: 4 and 8 are possible")]
    MacrocellEdge(u8),
    #[error("a brick's stored box of {dims:?} voxels came with {got} codes in place of {want}")]
    VoxelCount { dims: [u32; 3], got: usize, want: u64 },
    #[error(
        "a brick's stored box {stored:?} must reach one voxel beyond its owned box {owned:?} on every side: read it with a \
         ghost layer of at least 1"
    )]
    MissingGhost { owned: OwnedBox, stored: StoredBox },
    #[error(
        "a brick of {dims:?} voxels (ghost layers included) exceeds the {max} per axis of the adapter's 3D textures; \
         prepare the store with a smaller --brick, or use --backend cpu"
    )]
    BrickTooLarge { dims: [u32; 3], max: u32 },
    #[error("a job's rectangle {rect:?} reaches beyond the picture of {width}x{height}")]
    RectOutsidePicture { rect: PixelRect, width: u32, height: u32 },
    #[error("a transfer function table of {entries} entries: between 2 and {max} are needed")]
    TableSize { entries: usize, max: u32 },
    #[error("a brick that another backend uploaded was given to the {backend} raycaster: upload it there first")]
    ForeignBrick { backend: &'static str },
    #[error("out of memory for {what} ({bytes} bytes); lower --memory-budget or the picture's size")]
    OutOfMemory { what: &'static str, bytes: u64 },
    #[error("the GPU device was lost ({reason}); restart the node, or use --backend cpu")]
    DeviceLost { reason: String },
    #[error(
        "the GPU did not finish {what} within {seconds} s; the driver may hang: restart the node, or use --backend cpu"
    )]
    Timeout { what: &'static str, seconds: u64 },
    #[error("the GPU refused {what}: {reason}")]
    Gpu { what: &'static str, reason: String },
    #[error("nobody wants the picture any more")]
    Cancelled,
}

impl From<Cancelled> for RaycastError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

impl RaycastError {
    /// True where the same call may succeed later on this very raycaster (memory may have been freed).
    #[must_use]
    pub fn is_retryable(&self) -> bool {
        matches!(self, Self::OutOfMemory { .. })
    }
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
    /// Processor threads that render; 1 where a real GPU does.
    pub threads: u32,
    /// The processor renders, by itself or playing GPU.
    pub is_on_processor: bool,
}

/// The GPU or the CPU kernel behind one door. Calls block; a node calls them from a blocking thread.
pub trait Raycaster: Send + Sync + std::fmt::Debug {
    fn info(&self) -> &BackendInfo;

    /// Bytes that a brick with a stored box of `stored_voxels` voxels will occupy, unless it turns out to be of one region
    /// (then next to none); exact but for macrocells of bricks that are no cubes.
    fn brick_bytes(&self, stored_voxels: u64, recipe: Recipe) -> u64;

    /// # Errors
    /// Input that does not fit the recipe or itself, out of memory, device lost.
    fn upload(&self, owned: OwnedBox, input: &BrickInput<'_>) -> Result<Arc<dyn ResidentBrick>, RaycastError>;

    /// A brick whose stored box is all one region of this mean: like [`Raycaster::upload`] of its voxels, without them.
    ///
    /// # Errors
    /// Out of memory, device lost.
    fn upload_uniform(&self, owned: OwnedBox, mean: Density) -> Result<Arc<dyn ResidentBrick>, RaycastError>;

    /// Compiles what a scene needs whose bricks have up to these features, so that the first frame is not slower than the
    /// next.
    ///
    /// # Errors
    /// Device lost.
    fn warm_up(&self, filter: Filter, features: Features) -> Result<(), RaycastError>;

    /// Renders every job into an accumulator of its own, from zero, with early termination. Pixels do not depend on how a picture
    /// is cut into jobs' rectangles.
    ///
    /// # Errors
    /// Out of memory, device lost; `watch` says that nobody wants it any more.
    fn render_watched(
        &self,
        scene: &KernelScene,
        jobs: &[Job],
        watch: Watch<'_>,
    ) -> Result<Vec<JobImage>, RaycastError>;

    /// The same to its end.
    ///
    /// # Errors
    /// Out of memory, device lost.
    fn render(&self, scene: &KernelScene, jobs: &[Job]) -> Result<Vec<JobImage>, RaycastError> {
        self.render_watched(scene, jobs, Watch::new(&Pulse::default(), &|| false))
    }
}

/// Which backend the user asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BackendChoice {
    /// The GPU, or the CPU where there is none, saying why.
    #[default]
    Auto,
    Gpu,
    Cpu,
}

/// Opens the backend that `choice` names; the adapter is chosen as [`GpuOptions::from_env`] says.
///
/// # Errors
/// Only for [`BackendChoice::Gpu`]: no adapter, or one that cannot be used.
pub fn open(choice: BackendChoice) -> Result<Arc<dyn Raycaster>, GpuError> {
    let gpu = || GpuRaycaster::new(GpuOptions::from_env());
    match choice {
        BackendChoice::Cpu => Ok(Arc::new(CpuRaycaster::new())),
        BackendChoice::Gpu => Ok(Arc::new(gpu()?)),
        BackendChoice::Auto => match gpu() {
            Ok(raycaster) => Ok(Arc::new(raycaster)),
            Err(error) => Ok(Arc::new(CpuRaycaster::with_note(format!("rendering on the CPU: {error}")))),
        },
    }
}

/// What both backends demand of a brick.
pub(crate) fn check_brick(owned: &OwnedBox, voxels: &BrickVoxels) -> Result<(), RaycastError> {
    let stored = voxels.stored;
    let needed = owned.stored(brickcast_volume::brick::GHOST_SAMPLED);
    if stored.lo.cmpgt(needed.lo).any() || stored.hi.cmplt(needed.hi).any() {
        return Err(RaycastError::MissingGhost { owned: *owned, stored });
    }
    let want = stored.voxel_count();
    if voxels.codes.len() as u64 != want {
        return Err(RaycastError::VoxelCount { dims: stored.dims().into(), got: voxels.codes.len(), want });
    }
    Ok(())
}

/// What both backends demand of a call.
pub(crate) fn check_jobs(scene: &KernelScene, jobs: &[Job], max_entries: u32) -> Result<(), RaycastError> {
    for table in [Some(&scene.table), scene.region_table.as_ref()].into_iter().flatten() {
        let entries = table.entries.len();
        if entries < 2 || entries > max_entries as usize {
            return Err(RaycastError::TableSize { entries, max: max_entries });
        }
    }
    let size = scene.view.size();
    let full = size.full_rect();
    match jobs.iter().find(|job| !job.rect.is_empty() && job.rect.intersect(&full) != job.rect) {
        Some(job) => {
            let (width, height) = (size.width(), size.height());
            Err(RaycastError::RectOutsidePicture { rect: job.rect, width, height })
        }
        None => Ok(()),
    }
}

/// A cleared accumulator.
pub(crate) fn new_pixels(rect: &PixelRect) -> Result<Vec<Premul>, RaycastError> {
    let count = rect.pixel_count();
    let mut pixels = Vec::new();
    if pixels.try_reserve_exact(count).is_err() {
        let bytes = (count * size_of::<Premul>()) as u64;
        return Err(RaycastError::OutOfMemory { what: "an accumulator", bytes });
    }
    pixels.resize(count, Premul::CLEAR);
    Ok(pixels)
}

//! The product's kernels behind the one interface that they share, fed with a test's scene.

use std::sync::{Arc, OnceLock};

use brickcast_harness::{ignore, leave_out};
use brickcast_node::backend::{self, BackendChoice};
use brickcast_node::kernel::{BrickInput, Job, JobImage, KernelScene, KernelStyle, Raycaster, ResidentBrick};
use brickcast_volume::brick::GHOST_SAMPLED;
use brickcast_volume::merge::sort_front_to_back;
use brickcast_volume::pixel::Coloring;
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::scene::Filter;
use brickcast_volume::store::{BrickVoxels, NO_DATA_CODE};
use brickcast_volume::style::Style;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{BrickGrid, BrickIndex, Camera, Geometry, OwnedBox, PictureSize, PixelRect, Projection, View};

use crate::compare::Picture;
use crate::referee::Lens;
use crate::scenes::Scene;

/// Which of the product's kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    Cpu,
    Gpu,
}

impl Backend {
    pub const ALL: [Self; 2] = [Self::Cpu, Self::Gpu];
}

/// A scene cut into bricks that are resident in a kernel's memory.
#[derive(Debug)]
pub struct Loaded<'a> {
    raycaster: &'a dyn Raycaster,
    grid: BrickGrid,
    geometry: Geometry,
    /// In the grid's linear order.
    bricks: Vec<Arc<dyn ResidentBrick>>,
    filter: Filter,
    style: Style,
}

/// Opens a kernel; `Err` says why there is none.
fn open(backend: Backend) -> Result<Arc<dyn Raycaster>, String> {
    let choice = match backend {
        Backend::Cpu => BackendChoice::Cpu,
        Backend::Gpu => BackendChoice::Gpu,
    };
    let raycaster = backend::open(choice).map_err(|error| error.to_string())?;
    eprintln!("{backend:?}: {:?}", raycaster.info());
    Ok(raycaster)
}

/// The kernel of `backend`. Where this machine has none, the test is ignored.
#[must_use]
pub fn raycaster(backend: Backend) -> &'static dyn Raycaster {
    opened(backend).unwrap_or_else(|why| ignore(format_args!("no {backend:?} kernel: {why}")))
}

/// The kernels that this machine has. The test is ignored in part where one is missing.
pub fn raycasters() -> impl Iterator<Item = (Backend, &'static dyn Raycaster)> {
    Backend::ALL.into_iter().filter_map(|backend| {
        let opened = opened(backend).inspect_err(|why| leave_out(format_args!("no {backend:?} kernel: {why}")));
        Some((backend, opened.ok()?))
    })
}

/// Opened once per process.
fn opened(backend: Backend) -> Result<&'static dyn Raycaster, &'static str> {
    static CPU: OnceLock<Result<Arc<dyn Raycaster>, String>> = OnceLock::new();
    static GPU: OnceLock<Result<Arc<dyn Raycaster>, String>> = OnceLock::new();
    let cell = match backend {
        Backend::Cpu => &CPU,
        Backend::Gpu => &GPU,
    };
    cell.get_or_init(|| open(backend)).as_ref().map(AsRef::as_ref).map_err(String::as_str)
}

/// The stretched codes of `owned` grown by `ghost` layers, clamped at the volume's edge.
#[must_use]
pub fn cut(codes: &[u16], dims: [usize; 3], owned: OwnedBox, ghost: u32) -> BrickVoxels {
    let stored = owned.stored(ghost);
    let clamped = |i: i32, axis: usize| usize::try_from(i).unwrap_or(0).min(dims[axis] - 1);
    let mut cut = Vec::with_capacity(stored.voxel_count() as usize);
    for z in stored.lo.z..stored.hi.z {
        for y in stored.lo.y..stored.hi.y {
            for x in stored.lo.x..stored.hi.x {
                cut.push(codes[(clamped(z, 2) * dims[1] + clamped(y, 1)) * dims[0] + clamped(x, 0)]);
            }
        }
    }
    BrickVoxels { stored, codes: cut, has_holes: false }
}

/// Cuts the scene's volume into bricks of `brick_size` and uploads them all.
///
/// # Panics
/// Where the product refuses the volume or a brick.
#[must_use]
pub fn load<'a>(raycaster: &'a dyn Raycaster, scene: &Scene, brick_size: u32) -> Loaded<'a> {
    let dims = scene.truth.volume.dims;
    load_cut(raycaster, scene, brick_size, |owned| with_holes(scene, cut(&scene.codes, dims, owned, GHOST_SAMPLED)))
}

/// What a store says of a brick whose voxels may lack data.
fn with_holes(scene: &Scene, voxels: BrickVoxels) -> BrickVoxels {
    let has_holes = scene.has_holes && voxels.codes.contains(&NO_DATA_CODE);
    BrickVoxels { has_holes, ..voxels }
}

/// As [`load`], to be rendered in a style, with the ghost layers that it needs.
///
/// # Panics
/// As [`load`].
#[must_use]
pub fn load_styled<'a>(raycaster: &'a dyn Raycaster, scene: &Scene, brick_size: u32, style: &Style) -> Loaded<'a> {
    let (dims, ghost) = (scene.truth.volume.dims, style.ghost(scene.truth.step));
    let loaded =
        load_cut(raycaster, scene, brick_size, |owned| with_holes(scene, cut(&scene.codes, dims, owned, ghost)));
    Loaded { style: style.clone(), ..loaded }
}

/// As [`load`], each brick's voxels made by `cut`: the way in for bricks that are wrong on purpose.
///
/// # Panics
/// As [`load`].
#[must_use]
pub fn load_cut<'a>(
    raycaster: &'a dyn Raycaster,
    scene: &Scene,
    brick_size: u32,
    cut: impl Fn(OwnedBox) -> BrickVoxels,
) -> Loaded<'a> {
    let volume = &scene.truth.volume;
    let dims = volume.dims.map(|n| u32::try_from(n).unwrap());
    let geometry = Geometry::new(dims, volume.spacing.into(), volume.origin.into()).unwrap();
    let geometry = geometry.with_directions(volume.directions).unwrap();
    let grid = BrickGrid::new(geometry.dims(), brick_size).unwrap();
    let upload = |brick: BrickIndex| {
        let owned = grid.owned_box(brick);
        raycaster.upload(owned, &BrickInput::plain(&cut(owned))).unwrap()
    };
    let bricks = grid.bricks().map(upload).collect();
    Loaded { raycaster, grid, geometry, bricks, filter: Filter::default(), style: Style::default() }
}

impl Loaded<'_> {
    /// The same bricks, read through another filter than the default.
    #[must_use]
    pub fn with_filter(self, filter: Filter) -> Self {
        Self { filter, ..self }
    }

    /// The whole picture as one accumulator through all bricks, and the samples taken.
    ///
    /// # Panics
    /// Where the product refuses the scene or answers in another shape than asked for.
    #[must_use]
    pub fn render(&self, scene: &Scene) -> (Picture, u64) {
        let [width, height] = scene.truth.size;
        let image = self.render_rect(scene, picture_size(scene).full_rect());
        let colors = Coloring::new(transfer_function(scene), scene.range).colors(&image.pixels);
        let pixels = colors.into_iter().map(|p| p.to_array().map(f64::from)).collect();
        (Picture { width, height, pixels }, image.total().samples)
    }

    /// A part of the picture.
    ///
    /// # Panics
    /// As [`Self::render`].
    #[must_use]
    pub fn render_rect(&self, scene: &Scene, rect: PixelRect) -> JobImage {
        self.render_layers(scene, 1, rect).remove(0)
    }

    /// The bricks cut into `count` runs, front to back, each a job of its own in one call.
    ///
    /// # Panics
    /// As [`Self::render`].
    #[must_use]
    pub fn render_layers(&self, scene: &Scene, count: usize, rect: PixelRect) -> Vec<JobImage> {
        let truth = &scene.truth;
        let view = View::new(&self.geometry, &camera(scene), picture_size(scene), truth.step).unwrap();
        let (function, ratio) = (transfer_function(scene), truth.delta() / truth.unit);
        let entries = self.style.table_entries();
        let table = TransferTable::with_entries(&function, scene.range, ratio, entries);
        let lit = self.style.shading.is_some_and(|phong| phong.lighting.needs_weights());
        let slabs = self.style.integrates_slabs().then(|| {
            let slabs = Arc::new(Preintegrated::with_entries(&function, scene.range, ratio, entries, lit));
            [slabs.clone(), slabs]
        });
        let style = KernelStyle::new(&self.style, truth.step, &self.geometry, scene.range, slabs);
        let mut order: Vec<BrickIndex> = self.grid.bricks().collect();
        sort_front_to_back(&mut order, self.grid.brick_size(), view.viewpoint());
        let bricks: Vec<_> = order.iter().map(|&b| self.bricks[self.grid.id(b).index()].clone()).collect();
        let plain = KernelScene::plain(view, Arc::new(table), truth.early_termination as f32, self.filter);
        let kernel_scene = KernelScene { style, ..plain };
        let jobs: Vec<Job> =
            bricks.chunks(bricks.len().div_ceil(count)).map(|run| Job::new(run.to_vec(), rect)).collect();
        let images = self.raycaster.render(&kernel_scene, &jobs).unwrap();
        assert_eq!(images.len(), jobs.len(), "one image for each job");
        for (image, job) in images.iter().zip(&jobs) {
            assert_eq!(image.rect, rect);
            assert_eq!(image.pixels.len(), rect.pixel_count());
            assert_eq!(image.counts.len(), job.bricks.len(), "one count for each brick of the job");
        }
        images
    }
}

fn picture_size(scene: &Scene) -> PictureSize {
    let [width, height] = scene.truth.size.map(|n| u32::try_from(n).unwrap());
    PictureSize::new(width, height).unwrap()
}

fn camera(scene: &Scene) -> Camera {
    let camera = &scene.truth.camera;
    let projection = match camera.lens {
        Lens::Perspective { view_angle } => Projection::Perspective { view_angle },
        Lens::Parallel { parallel_scale } => Projection::Parallel { parallel_scale },
    };
    Camera::new(camera.position, camera.focal_point, camera.view_up, projection).unwrap()
}

fn transfer_function(scene: &Scene) -> TransferFunction {
    let transfer = &scene.truth.transfer;
    let colors = transfer.colors.iter().map(|&(x, rgb)| ColorPoint { x, rgb }).collect();
    let opacities = transfer.opacities.iter().map(|&(x, opacity)| OpacityPoint { x, opacity }).collect();
    TransferFunction::new(colors, opacities).unwrap()
}

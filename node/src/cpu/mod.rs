//! The raycaster on the processor: jobs over screen tiles, by the ray loop of `brickcast_cpu`.

use std::any::Any;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

pub use brickcast_cpu::InstructionSet;
use brickcast_cpu::{Pause, PlacedBrick, ShownEntries, Tile, render_tile};
use brickcast_shaders::layout::{BrickUniform, FrameUniform};
use brickcast_shaders::twin::bindings::{Bindings, BrickData, SceneData};
use brickcast_shaders::twin::macrocell::empty_distances;
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::lod::Sides;
use brickcast_volume::macrocell::MapTexel;
use brickcast_volume::regions::Density;
use brickcast_volume::scene::Filter;
use brickcast_volume::{PixelRect, RawPixel};
use glam::UVec2;
use rayon::prelude::*;

use crate::brick::bytes::{CELL_BYTES, expected_bytes};
use crate::brick::emptiness::{Emptiness, EmptinessCache, is_same};
use crate::brick::texels::{BuiltBrick, BuiltCells};
use crate::brick::worth::LastOccupied;
use crate::kernel::{
    BackendInfo, BrickCounts, BrickInput, Cancelled, Job, JobImage, KernelKey, KernelScene, Placed, RaycastError,
    Raycaster, Recipe, ResidentBrick, Watch, check_jobs,
};

/// Tile edge in pixels: small enough that threads stay busy to the end, large enough that a brick's voxels are reused
/// ...
const TILE: usize = 32;
/// ... and where there are few pixels, each of them long.
const SMALLEST_TILE: usize = 4;
/// Tiles that every thread should find.
const TILES_PER_THREAD: usize = 4;

/// The threads of all CPU kernels of this process. Nothing else runs on them: what needs threads for a moment (tables,
/// decoding, encoding tiles) must not wait until a picture is done.
fn kernel_threads() -> Option<&'static rayon::ThreadPool> {
    static THREADS: OnceLock<Option<rayon::ThreadPool>> = OnceLock::new();
    let name = |i| format!("kernel-{i}");
    THREADS.get_or_init(|| rayon::ThreadPoolBuilder::new().thread_name(name).build().ok()).as_ref()
}

/// Does work of kernels on their threads; a system that gives no more has those of the others.
pub(crate) fn on_kernel_threads<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match kernel_threads() {
        Some(threads) => threads.install(work),
        None => work(),
    }
}

/// Renders with threads of its own. Every pixel is computed alone, so pictures do not depend on the number of threads.
#[derive(Debug)]
pub struct CpuRaycaster {
    info: BackendInfo,
    set: InstructionSet,
    /// All by the twin, ray by ray.
    by_twin: bool,
    emptiness: EmptinessCache,
}

/// What a map was built for, and its texels. No more than the name of the emptiness: its counts of half a megabyte must
/// not live as long as every brick that once saw them.
type BuiltMap = (Option<Weak<Emptiness>>, Arc<Vec<u32>>);

#[derive(Debug)]
struct CpuBrick {
    owned: OwnedBox,
    uniform: BrickUniform,
    texels: Vec<u16>,
    means: Option<Vec<f32>>,
    cells: Option<BuiltCells>,
    flags: Vec<u8>,
    /// The macrocell map of the last scene.
    map: Mutex<Option<BuiltMap>>,
    occupancy: LastOccupied,
    bytes: u64,
}

impl ResidentBrick for CpuBrick {
    fn bytes(&self) -> u64 {
        self.bytes
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

impl CpuBrick {
    /// Keeps what was prepared.
    fn new(owned: OwnedBox, prepared: BuiltBrick<'_>) -> Result<Self, RaycastError> {
        let bytes = prepared.bytes(size_of::<u16>() as u64, CELL_BYTES);
        let texels = match prepared.texels {
            std::borrow::Cow::Owned(texels) => texels,
            std::borrow::Cow::Borrowed(codes) => {
                let mut texels = Vec::new();
                if texels.try_reserve_exact(codes.len()).is_err() {
                    return Err(RaycastError::OutOfMemory { what: "a brick", bytes });
                }
                texels.extend_from_slice(codes);
                texels
            }
        };
        let (uniform, means, cells) = (prepared.uniform, prepared.means, prepared.cells);
        let flags = prepared.flags.unwrap_or_default();
        Ok(Self {
            owned,
            uniform,
            texels,
            means,
            cells,
            flags,
            map: Mutex::default(),
            occupancy: LastOccupied::default(),
            bytes,
        })
    }

    /// The map for `emptiness`, built anew where it is another than the last one.
    fn map(&self, emptiness: Option<&Arc<Emptiness>>) -> Option<Arc<Vec<u32>>> {
        let BuiltCells { cells, homogeneous } = self.cells.as_ref()?;
        if emptiness.is_none() && homogeneous.is_none() {
            return None;
        }
        let mut map = self.map.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, built)) = &*map {
            let is_current = match (known, emptiness) {
                (Some(known), Some(emptiness)) => is_same(known, emptiness),
                (known, emptiness) => known.is_none() && emptiness.is_none(),
            };
            if is_current {
                return Some(built.clone());
            }
        }
        let mut texels = homogeneous.clone().unwrap_or_else(|| vec![0; cells.ranges.len()]);
        if let Some(emptiness) = emptiness {
            let distances = empty_distances(&emptiness.counts, &cells.ranges, cells.dims.into());
            let bits = |empty| MapTexel { empty, ..MapTexel::default() }.pack();
            texels.iter_mut().zip(distances).for_each(|(texel, distance)| *texel |= bits(distance));
        }
        let texels = Arc::new(texels);
        *map = Some((emptiness.map(Arc::downgrade), texels.clone()));
        Some(texels)
    }
}

/// A brick in a job: where it shows, and what it needs for this scene.
struct SceneBrick<'a> {
    brick: &'a CpuBrick,
    projected: PixelRect,
    uniform: BrickUniform,
    key: KernelKey,
    map: Option<Arc<Vec<u32>>>,
}

impl<'a> SceneBrick<'a> {
    fn new(brick: &'a CpuBrick, sides: Sides, scene: &KernelScene, emptiness: Option<&Arc<Emptiness>>) -> Self {
        let cells = brick.cells.as_ref();
        let ask = |(emptiness, built): (_, &BuiltCells)| brick.occupancy.ask(emptiness, &brick.owned, &built.cells);
        let has_cubes = cells.is_some_and(|built| built.homogeneous.is_some());
        let has = (brick.means.is_some(), has_cubes);
        let Placed { uniform, shown, key } =
            Placed::new(scene, &brick.uniform, has, emptiness.zip(cells).map(ask), sides);
        let map = brick.map(emptiness.filter(|_| key.skips));
        Self { brick, projected: scene.view.project(&shown), uniform, key, map }
    }

    fn placed<'b>(&'b self, reads: &Reads<'b>) -> PlacedBrick<'b> {
        let bound = Bindings { scene: reads.data, brick: &self.uniform, data: self.data(), key: self.key };
        let place = if reads.by_twin { PlacedBrick::by_twin } else { PlacedBrick::new };
        place(self.projected, bound, reads.shown)
    }

    fn data(&self) -> BrickData<'_> {
        let dims = |cells: &BuiltCells| cells.cells.dims.into();
        BrickData {
            texels: &self.brick.texels,
            means: self.brick.means.as_deref(),
            map: self.map.as_ref().zip(self.brick.cells.as_ref()).map(|(map, cells)| (map.as_slice(), dims(cells))),
            flags: &self.brick.flags,
        }
    }
}

impl CpuRaycaster {
    #[must_use]
    pub fn new() -> Self {
        Self::with_set(InstructionSet::best())
    }

    /// By an instruction set: pictures are the same by all, to the bit.
    #[must_use]
    pub fn with_set(set: InstructionSet) -> Self {
        let threads = rayon::current_num_threads() as u32;
        let (arch, name, width) = (std::env::consts::ARCH, set.name(), set.width());
        let adapter = format!("CPU ({arch}, {name}, {width} rays side by side), {threads} threads");
        let info = BackendInfo {
            backend: "cpu",
            adapter,
            notes: Vec::new(),
            threads,
            is_on_processor: true,
            limits: Vec::new(),
        };
        Self { info, set, by_twin: false, emptiness: EmptinessCache::default() }
    }

    /// By the kernel's twin, ray by ray: slow, and what every set equals to the bit.
    #[must_use]
    pub fn twin() -> Self {
        let mut raycaster = Self::with_set(InstructionSet::Portable);
        raycaster.by_twin = true;
        raycaster.info.adapter = format!("CPU ({}), the kernel's twin", std::env::consts::ARCH);
        raycaster
    }

    /// By the set that `BRICKCAST_CPU` names, else by the best one that the processor has.
    #[must_use]
    pub fn from_env() -> Self {
        let Some(name) = std::env::var_os("BRICKCAST_CPU") else { return Self::new() };
        let name = name.to_string_lossy();
        match InstructionSet::named(&name) {
            Some(set) if set.is_here() => Self::with_set(set),
            _ if name == "twin" => Self::twin(),
            known => {
                let here = InstructionSet::ALL.iter().filter(|set| set.is_here()).map(|set| set.name());
                let here = here.collect::<Vec<_>>().join(", ");
                let why = known.map_or("no instruction set is called so", |_| "this processor does not have it");
                Self::new().with_note(format!("BRICKCAST_CPU={name} is not heeded: {why}; there are {here}, and twin"))
            }
        }
    }

    /// With a note, such as why the CPU renders.
    #[must_use]
    pub fn with_note(mut self, note: String) -> Self {
        self.info.notes.push(note);
        self
    }
}

impl Default for CpuRaycaster {
    fn default() -> Self {
        Self::new()
    }
}

impl Raycaster for CpuRaycaster {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn brick_bytes(&self, stored_voxels: u64, recipe: Recipe) -> u64 {
        expected_bytes(stored_voxels, recipe, size_of::<u16>() as u64, CELL_BYTES)
    }

    fn upload(&self, owned: OwnedBox, input: &BrickInput<'_>) -> Result<Arc<dyn ResidentBrick>, RaycastError> {
        Ok(Arc::new(CpuBrick::new(owned, BuiltBrick::new(&owned, input)?)?))
    }

    fn upload_uniform(&self, owned: OwnedBox, mean: Density) -> Result<Arc<dyn ResidentBrick>, RaycastError> {
        Ok(Arc::new(CpuBrick::new(owned, BuiltBrick::uniform(&owned, mean))?))
    }

    fn warm_up(&self, _filter: Filter, _keys: &[KernelKey]) -> Result<(), RaycastError> {
        Ok(())
    }

    fn render_watched(
        &self,
        scene: &KernelScene,
        jobs: &[Job],
        watch: Watch<'_>,
    ) -> Result<Vec<JobImage>, RaycastError> {
        self.render_scenes(&[scene], jobs, watch)
    }

    fn takes_scenes_together(&self) -> bool {
        true
    }

    fn render_scenes(
        &self,
        scenes: &[&KernelScene],
        jobs: &[Job],
        watch: Watch<'_>,
    ) -> Result<Vec<JobImage>, RaycastError> {
        let frames: Vec<FrameUniform> = scenes.iter().map(|scene| scene.frame_uniform()).collect();
        let data: Vec<SceneData<'_>> = scenes.iter().zip(&frames).map(|(scene, frame)| scene.data(frame)).collect();
        let mut reads = Vec::with_capacity(scenes.len());
        for (scene, data) in scenes.iter().zip(&data) {
            check_jobs(scene, jobs, u32::MAX)?;
            let (shown, emptiness) = (ShownEntries::of(&data.tables), self.emptiness.get(scene));
            reads.push(Reads { scene, data, set: self.set, by_twin: self.by_twin, shown, emptiness, watch });
        }
        on_kernel_threads(|| jobs.par_iter().map(|job| render_job(&reads, job)).collect())
    }
}

fn render_job(scenes: &[Reads<'_>], job: &Job) -> Result<JobImage, RaycastError> {
    let bricks: Vec<(SceneBrick<'_>, &Reads<'_>)> = job
        .bricks
        .par_iter()
        .enumerate()
        .map(|(i, b)| {
            let (brick, reads) = (b.as_any().downcast_ref::<CpuBrick>()?, scenes.get(job.scene_of(i))?);
            Some((SceneBrick::new(brick, job.sides_of(i), reads.scene, reads.emptiness.as_ref()), reads))
        })
        .collect::<Option<_>>()
        .ok_or(RaycastError::ForeignBrick { backend: "cpu" })?;
    let Some(reads) = scenes.first() else { return Err(RaycastError::ForeignBrick { backend: "cpu" }) };
    let placed: Vec<PlacedBrick<'_>> = bricks.iter().map(|(brick, reads)| brick.placed(reads)).collect();
    let mut pixels = job.started(reads.scene.pixel_kind())?;
    let edge = tile_edge(job.rect.pixel_count(), rayon::current_num_threads());
    // One by one: what rayon would keep together is a quarter of the picture, whose other quarters may be empty.
    let tiles = tiles_of(&job.rect, pixels.raw_mut(), edge).into_par_iter().with_max_len(1);
    let is_wanted = |pause: Pause| match pause {
        // The pulse is one number for all threads: too dear for every row.
        Pause::Brick => reads.watch.goes_on().is_ok(),
        Pause::Row => reads.watch.is_wanted().is_ok(),
    };
    let render = |tile| {
        let counts = render_tile(reads.set, reads.data.frame, &placed, &is_wanted, tile).ok_or(Cancelled)?;
        Ok::<Vec<BrickCounts>, RaycastError>(counts.into_iter().map(BrickCounts::from).collect())
    };
    let counts = tiles.map(render).try_reduce(
        || vec![BrickCounts::default(); bricks.len()],
        |mut a, b| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a = a.plus(b));
            Ok(a)
        },
    )?;
    Ok(JobImage { rect: job.rect, pixels, counts })
}

/// What rays read of a scene, by which set, and how they are watched.
struct Reads<'a> {
    scene: &'a KernelScene,
    data: &'a SceneData<'a>,
    set: InstructionSet,
    by_twin: bool,
    shown: ShownEntries,
    emptiness: Option<Arc<Emptiness>>,
    watch: Watch<'a>,
}

/// The largest edge that leaves every thread some tiles.
fn tile_edge(pixels: usize, threads: usize) -> usize {
    let mut edge = TILE;
    while edge > SMALLEST_TILE && pixels < threads * TILES_PER_THREAD * edge * edge {
        edge /= 2;
    }
    edge
}

/// Cuts a row-major accumulator into tiles.
fn tiles_of<'a>(rect: &PixelRect, pixels: &'a mut [RawPixel], edge: usize) -> Vec<Tile<'a>> {
    let mut tiles = Vec::new();
    if rect.is_empty() {
        return tiles;
    }
    let width = rect.size().x as usize;
    for (band, rows) in pixels.chunks_mut(width * edge).enumerate() {
        let first = tiles.len();
        let height = rows.len() / width;
        for x in (0..width).step_by(edge) {
            let lo = rect.lo + UVec2::new(x as u32, (band * edge) as u32);
            let hi = lo + UVec2::new((width - x).min(edge) as u32, height as u32);
            tiles.push(Tile { rect: PixelRect { lo, hi }, rows: Vec::with_capacity(height) });
        }
        for row in rows.chunks_mut(width) {
            for (tile, part) in tiles[first..].iter_mut().zip(row.chunks_mut(edge)) {
                tile.rows.push(part);
            }
        }
    }
    tiles
}

#[cfg(test)]
mod tests;

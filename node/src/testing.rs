//! What the unit tests of this crate share: a volume in memory, stores, scenes, and a raycaster whose picture is known.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};

use brickcast_proto::{LayerOrder, RenderOrder, TileRect};
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::format::{FormatError, SourceHeader, VolumeSource, VoxelType};
use brickcast_volume::regions::Density;
use brickcast_volume::scene::{Filter, Look, Quality, Scene, Transport, ViewSpec};
use brickcast_volume::store::{PrepareOptions, prepare};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{
    Camera, Epoch, FrameId, Geometry, MergeTree, Orbit, PictureSize, PixelKind, Pixels, Premul, SessionId, StoreHash,
    TreeNode, over,
};

use crate::kernel::{
    BackendInfo, BrickCounts, BrickInput, Job, JobImage, KernelKey, KernelScene, RaycastError, Raycaster, Recipe,
    ResidentBrick, Watch,
};

/// u8 voxels `value(x, y, z)`.
#[derive(Debug)]
struct MemoryVolume {
    header: SourceHeader,
    value: fn(u32, u32, u32) -> u8,
    next: u32,
}

impl VolumeSource for MemoryVolume {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.next = 0;
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        let end = (self.next + count).min(d.z);
        planes.clear();
        for z in self.next..end {
            planes.extend((0..d.y).flat_map(|y| (0..d.x).map(move |x| (x, y))).map(|(x, y)| (self.value)(x, y, z)));
        }
        self.next = end;
        Ok(())
    }
}

pub(crate) const DIMS: [u32; 3] = [40, 33, 50];

/// A store of [`DIMS`] voxels in bricks of 8: 5 x 5 x 7 bricks, chunks of single bricks.
pub(crate) fn make_store(path: &Path, value: fn(u32, u32, u32) -> u8) -> StoreHash {
    make_store_of(8, path, value)
}

/// A store of [`DIMS`] voxels in other bricks; from 16 on they have halos.
pub(crate) fn make_store_of(brick_size: u32, path: &Path, value: fn(u32, u32, u32) -> u8) -> StoreHash {
    let geometry = Geometry::new(DIMS, [1.0, 1.0, 1.5], [0.0; 3]).unwrap();
    let header = SourceHeader::new("test", geometry, VoxelType::U8);
    let options = PrepareOptions { brick_size, range: Some((0.0, 255.0)), ..PrepareOptions::default() };
    prepare(&mut MemoryVolume { header, value, next: 0 }, path, &options, &mut |_| {}).unwrap().hash
}

pub(crate) fn ramp(x: u32, y: u32, z: u32) -> u8 {
    (x * 3 + y * 2 + z) as u8
}

pub(crate) fn scene(width: u32, height: u32, orbit: Orbit) -> Scene {
    let geometry = Geometry::new(DIMS, [1.0, 1.0, 1.5], [0.0; 3]).unwrap();
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.1, 0.2, 0.9] }, ColorPoint { x: 255.0, rgb: [1.0, 0.8, 0.1] }];
    let opacities = vec![OpacityPoint { x: 60.0, opacity: 0.0 }, OpacityPoint { x: 255.0, opacity: 0.4 }];
    let camera = Camera::orbit(&geometry, orbit).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(width, height).unwrap() };
    let look = Look::new(TransferFunction::new(colors, opacities).unwrap(), 4.0);
    Scene::new(look, view, Quality { filter: Filter::Exact, ..Quality::default() }).unwrap()
}

/// All chunks of the tree in one layer, all tiles.
pub(crate) fn whole_order(tree: &MergeTree, store: StoreHash, scene: Scene) -> RenderOrder {
    let tiles = TileRect::of_picture(scene.view.size);
    let chunks = tree.chunk_ids().collect();
    let layers = vec![LayerOrder { node: TreeNode(1), chunks, tiles }];
    let (session, frame, epoch) = (SessionId(1), FrameId(7), Epoch(3));
    RenderOrder { session, frame, epoch, store, scene, transport: Transport::F32, layers, parts: Vec::new() }
}

#[derive(Debug)]
struct FakeBrick {
    owned: OwnedBox,
    bytes: u64,
    alive: Arc<AtomicU64>,
}

impl ResidentBrick for FakeBrick {
    fn bytes(&self) -> u64 {
        self.bytes
    }

    fn as_any(&self) -> &dyn std::any::Any {
        self
    }
}

impl Drop for FakeBrick {
    fn drop(&mut self) {
        self.alive.fetch_sub(self.bytes, Ordering::SeqCst);
    }
}

/// Every brick is a plate of its own colour over the pixels that it projects to.
#[derive(Debug)]
pub(crate) struct FakeRaycaster {
    info: BackendInfo,
    /// Bytes of bricks that live now, and the most that ever did.
    pub(crate) alive: Arc<AtomicU64>,
    pub(crate) most_alive: AtomicU64,
    pub(crate) uploads: AtomicUsize,
    pub(crate) calls: AtomicUsize,
    /// Widths of the pictures as they were rendered, each once in a row.
    pub(crate) widths: Mutex<Vec<u32>>,
    /// Panics in the call of this number.
    pub(crate) panic_in_call: AtomicUsize,
    /// Calls wait while this is set.
    pub(crate) is_held: AtomicBool,
    /// Each upload waits for one of these, until the sender is gone.
    pub(crate) permits: Mutex<Option<mpsc::Receiver<()>>>,
    /// Uploads that wait for a permit, or have had one.
    pub(crate) asked: AtomicUsize,
}

impl FakeRaycaster {
    pub(crate) fn new() -> Self {
        let info = BackendInfo {
            backend: "cpu",
            adapter: "fake".to_owned(),
            notes: Vec::new(),
            threads: 1,
            is_on_processor: true,
            limits: Vec::new(),
        };
        Self {
            info,
            alive: Arc::default(),
            most_alive: AtomicU64::default(),
            uploads: AtomicUsize::default(),
            calls: AtomicUsize::default(),
            widths: Mutex::default(),
            panic_in_call: AtomicUsize::new(usize::MAX),
            is_held: AtomicBool::default(),
            permits: Mutex::default(),
            asked: AtomicUsize::default(),
        }
    }

    /// From now on each upload waits for what comes through the sender.
    pub(crate) fn hold_uploads(&self) -> mpsc::Sender<()> {
        let (sender, receiver) = mpsc::channel();
        *self.permits.lock().unwrap() = Some(receiver);
        sender
    }

    fn plate(owned: &OwnedBox) -> Premul {
        let seed = owned.lo.x * 73 + owned.lo.y * 179 + owned.lo.z * 283;
        let alpha = 0.1 + (seed % 17) as f32 / 40.0;
        let shade = |n: u32| (seed % n) as f32 / n as f32 * alpha;
        Premul { r: shade(7), g: shade(11), b: shade(13), a: alpha }
    }
}

impl Raycaster for FakeRaycaster {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn brick_bytes(&self, stored_voxels: u64, _recipe: Recipe) -> u64 {
        stored_voxels * 2
    }

    fn upload(&self, owned: OwnedBox, input: &BrickInput<'_>) -> Result<Arc<dyn ResidentBrick>, RaycastError> {
        self.asked.fetch_add(1, Ordering::SeqCst);
        if let Some(permits) = &*self.permits.lock().unwrap() {
            // Gone: go on without.
            let _ = permits.recv();
        }
        let bytes = self.brick_bytes(input.voxels.stored.voxel_count(), input.recipe);
        self.uploads.fetch_add(1, Ordering::SeqCst);
        let now = self.alive.fetch_add(bytes, Ordering::SeqCst) + bytes;
        self.most_alive.fetch_max(now, Ordering::SeqCst);
        Ok(Arc::new(FakeBrick { owned, bytes, alive: self.alive.clone() }))
    }

    fn upload_uniform(&self, owned: OwnedBox, _mean: Density) -> Result<Arc<dyn ResidentBrick>, RaycastError> {
        self.uploads.fetch_add(1, Ordering::SeqCst);
        Ok(Arc::new(FakeBrick { owned, bytes: 0, alive: self.alive.clone() }))
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
        while self.is_held.load(Ordering::SeqCst) {
            // A kernel that hangs: no beat, and nothing stops it.
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        watch.goes_on()?;
        let call = self.calls.fetch_add(1, Ordering::SeqCst);
        let mut widths = self.widths.lock().unwrap();
        widths.push(scene.view.size().width());
        widths.dedup();
        drop(widths);
        assert!(call != self.panic_in_call.load(Ordering::SeqCst), "the fake was told to panic");
        let render = |job: &Job| {
            let width = job.rect.size().x as usize;
            let started = job.started(PixelKind::Over).unwrap();
            let mut pixels = started.typed::<Premul>().unwrap().to_vec();
            for brick in &job.bricks {
                let owned = brick.as_any().downcast_ref::<FakeBrick>().unwrap().owned;
                let rect = scene.view.project(&owned).intersect(&job.rect);
                for y in rect.lo.y..rect.hi.y {
                    for x in rect.lo.x..rect.hi.x {
                        let at = (y - job.rect.lo.y) as usize * width + (x - job.rect.lo.x) as usize;
                        pixels[at] = over(pixels[at], Self::plate(&owned));
                    }
                }
            }
            let counts = vec![BrickCounts { samples: 10, positions: 10, leapt: 0, skips: 4 }; job.bricks.len()];
            JobImage { rect: job.rect, pixels: Pixels::of(pixels), counts }
        };
        Ok(jobs.iter().map(render).collect())
    }
}

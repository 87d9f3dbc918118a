//! Synthetic volumes cut into bricks, views with a hazard each, and the comparison of pictures.

use std::sync::{Arc, OnceLock};

use brickcast_harness::{ignore, leave_out};
use brickcast_node::cpu::CpuRaycaster;
use brickcast_node::gpu::{GpuError, GpuOptions, GpuRaycaster};
use brickcast_node::kernel::{BrickInput, Job, JobImage, KernelScene, Raycaster, ResidentBrick};
use brickcast_volume::merge::sort_front_to_back;
use brickcast_volume::scene::Filter;
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{
    BrickGrid, Camera, Geometry, OwnedBox, PictureSize, PixelRect, Pixels, Projection, RawPixel, StoredBox, View,
};
use glam::{DVec3, IVec3};

pub(crate) const BOTH_FILTERS: [Filter; 2] = [Filter::Hardware, Filter::Exact];

pub(crate) struct Volume {
    pub(crate) geometry: Geometry,
    code: fn(IVec3) -> u16,
}

impl Volume {
    /// Three ramps of different slope, waves, and an L of voxels that breaks every symmetry.
    pub(crate) fn ramps(dims: [u32; 3], spacing: [f64; 3], origin: [f64; 3]) -> Self {
        let geometry = Geometry::new(dims, spacing, origin).unwrap();
        Self { geometry, code: ramps }
    }

    pub(crate) fn constant(dims: [u32; 3]) -> Self {
        Self { geometry: Geometry::new(dims, [1.0; 3], [0.0; 3]).unwrap(), code: |_| 30_000 }
    }

    /// Voxels of a stored box; beyond the volume the edge is repeated.
    pub(crate) fn cut(&self, stored: StoredBox) -> BrickVoxels {
        let last = self.geometry.dims().as_ivec3() - 1;
        let mut codes = Vec::new();
        for z in stored.lo.z..stored.hi.z {
            for y in stored.lo.y..stored.hi.y {
                codes.extend(
                    (stored.lo.x..stored.hi.x).map(|x| (self.code)(IVec3::new(x, y, z).clamp(IVec3::ZERO, last))),
                );
            }
        }
        BrickVoxels { stored, codes, has_holes: false }
    }

    /// The whole volume in bricks of `brick_size`.
    pub(crate) fn upload(&self, raycaster: &dyn Raycaster, brick_size: u32) -> Resident {
        let grid = BrickGrid::new(self.geometry.dims(), brick_size).unwrap();
        Resident::of(grid, |owned| raycaster.upload(owned, &BrickInput::plain(&self.cut(owned.stored(1)))).unwrap())
    }

    /// The whole volume as one job, in bricks of `brick_size`, front to back.
    pub(crate) fn job(&self, raycaster: &dyn Raycaster, view: &View, brick_size: u32) -> Job {
        self.upload(raycaster, brick_size).job(view)
    }
}

/// A volume's bricks on a backend, in the grid's order.
pub(crate) struct Resident {
    grid: BrickGrid,
    bricks: Vec<Arc<dyn ResidentBrick>>,
}

impl Resident {
    pub(crate) fn of(grid: BrickGrid, upload: impl Fn(OwnedBox) -> Arc<dyn ResidentBrick>) -> Self {
        Self { grid, bricks: grid.bricks().map(|b| upload(grid.owned_box(b))).collect() }
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.bricks.iter().map(|b| b.bytes()).sum()
    }

    /// All of them front to back into the whole picture.
    pub(crate) fn job(&self, view: &View) -> Job {
        let mut order: Vec<_> = self.grid.bricks().collect();
        sort_front_to_back(&mut order, self.grid.brick_size(), view.viewpoint());
        let bricks = order.into_iter().map(|b| self.bricks[self.grid.id(b).index()].clone()).collect();
        Job::new(bricks, view.size().full_rect())
    }
}

fn ramps(p: IVec3) -> u16 {
    let q = p.as_vec3();
    let l = (p.cmpge(IVec3::new(4, 3, 5)).all() && p.cmplt(IVec3::new(24, 7, 9)).all())
        || (p.cmpge(IVec3::new(4, 3, 5)).all() && p.cmplt(IVec3::new(8, 20, 9)).all());
    let waves = (q.x * 0.45).sin() * (q.y * 0.6).cos() + (q.z * 0.5).sin();
    let value = 0.15 + 0.006 * q.x + 0.009 * q.y + 0.012 * q.z + 0.08 * waves + if l { 0.25 } else { 0.0 };
    (value.clamp(0.0, 1.0) * 65535.0) as u16
}

/// Opacity slope 2.5 over the range: the maximum bounds bind.
pub(crate) fn table(step: f64) -> Arc<TransferTable> {
    let colors = vec![
        ColorPoint { x: 0.0, rgb: [0.1, 0.2, 0.9] },
        ColorPoint { x: 0.5, rgb: [0.2, 0.9, 0.3] },
        ColorPoint { x: 1.0, rgb: [1.0, 0.7, 0.1] },
    ];
    let opacities = vec![
        OpacityPoint { x: 0.2, opacity: 0.0 },
        OpacityPoint { x: 0.5, opacity: 0.03 },
        OpacityPoint { x: 0.6, opacity: 0.28 },
        OpacityPoint { x: 1.0, opacity: 0.4 },
    ];
    Arc::new(TransferTable::build(&TransferFunction::new(colors, opacities).unwrap(), (0.0, 1.0), step))
}

/// The same colour and opacity for every value.
pub(crate) fn flat_table(rgb: [f64; 3], opacity: f64, step: f64) -> Arc<TransferTable> {
    let function =
        TransferFunction::new(vec![ColorPoint { x: 0.0, rgb }], vec![OpacityPoint { x: 0.0, opacity }]).unwrap();
    Arc::new(TransferTable::build(&function, (0.0, 1.0), step))
}

pub(crate) fn scene(view: View, early_termination: f32, filter: Filter) -> KernelScene {
    KernelScene::plain(view, table(view.step()), early_termination, filter)
}

/// Where a camera stands, in voxels.
pub(crate) struct Viewpoint {
    pub(crate) name: &'static str,
    eye: [f64; 3],
    focus: [f64; 3],
    up: [f64; 3],
    /// Half the picture's height in voxels of the smallest spacing, or a perspective of 40 degrees.
    parallel: Option<f64>,
}

/// For volumes of 40 x 30 x 20 voxels in bricks of 8 or 16.
pub(crate) const VIEWPOINTS: [Viewpoint; 9] = [
    Viewpoint { name: "front", eye: [20.0, 15.0, 90.0], focus: [20.0, 15.0, 10.0], up: Y, parallel: None },
    Viewpoint { name: "oblique", eye: [75.0, 48.0, -28.0], focus: [20.0, 15.0, 10.0], up: TILTED, parallel: None },
    Viewpoint { name: "eye inside", eye: [21.3, 14.2, 9.7], focus: [3.0, 4.0, 5.0], up: Y, parallel: None },
    Viewpoint { name: "eye on a brick face", eye: [16.0, 13.4, 8.3], focus: [2.0, 13.0, 5.0], up: Y, parallel: None },
    Viewpoint {
        name: "eye on a brick corner",
        eye: [16.0, 16.0, 8.0],
        focus: [20.0, 3.0, 30.0],
        up: Y,
        parallel: None,
    },
    Viewpoint { name: "rays inside a face", eye: [16.0, 15.0, 70.0], focus: [16.0, 15.0, 0.0], up: Y, parallel: None },
    Viewpoint { name: "parallel", eye: [20.3, 15.2, 60.0], focus: [20.3, 15.2, 0.0], up: Y, parallel: Some(25.0) },
    Viewpoint {
        name: "parallel oblique",
        eye: [60.0, 40.0, 50.0],
        focus: [20.0, 15.0, 10.0],
        up: TILTED,
        parallel: Some(40.0),
    },
    Viewpoint {
        name: "parallel inside a face",
        eye: [16.0, 8.0, 40.0],
        focus: [16.0, 8.0, 0.0],
        up: Y,
        parallel: Some(8.5),
    },
];

const Y: [f64; 3] = [0.0, 1.0, 0.0];
const TILTED: [f64; 3] = [0.2, 1.0, 0.3];

impl Viewpoint {
    /// The same view of a volume that moved the other way.
    pub(crate) fn moved(&self, voxels: [f64; 3]) -> Self {
        let add = |p: [f64; 3]| std::array::from_fn(|a| p[a] + voxels[a]);
        Self { eye: add(self.eye), focus: add(self.focus), ..*self }
    }

    pub(crate) fn view(&self, geometry: &Geometry, size: [u32; 2], step: f64) -> View {
        let world = |voxel: [f64; 3]| geometry.world_from_voxel(DVec3::from(voxel));
        let projection = match self.parallel {
            Some(half) => Projection::Parallel { parallel_scale: half * geometry.min_spacing() },
            None => Projection::Perspective { view_angle: 40.0 },
        };
        let camera = Camera::new(world(self.eye), world(self.focus), self.up.into(), projection).unwrap();
        View::new(geometry, &camera, PictureSize::new(size[0], size[1]).unwrap(), step).unwrap()
    }
}

pub(crate) fn render_one(raycaster: &dyn Raycaster, scene: &KernelScene, job: Job) -> JobImage {
    raycaster.render(scene, &[job]).unwrap().remove(0)
}

pub(crate) fn cpu() -> CpuRaycaster {
    CpuRaycaster::new()
}

/// One GPU raycaster for all tests, doing by kernels all that there are kernels for. Where there is no driver, the test
/// is ignored.
pub(crate) fn gpu() -> &'static GpuRaycaster {
    shared_gpu().as_ref().unwrap_or_else(|error| ignore(error))
}

/// As [`gpu`], for tests that try the CPU, too: `None` where there is no driver, and the test is ignored in part.
pub(crate) fn gpu_too() -> Option<&'static GpuRaycaster> {
    shared_gpu().as_ref().inspect_err(|why| leave_out(why)).ok()
}

fn shared_gpu() -> &'static Result<GpuRaycaster, GpuError> {
    static GPU: OnceLock<Result<GpuRaycaster, GpuError>> = OnceLock::new();
    GPU.get_or_init(|| GpuRaycaster::new(GpuOptions { with_map_kernels: true, ..GpuOptions::from_env() }))
}

/// Another one; where there is none, the test is ignored.
pub(crate) fn open_gpu(options: GpuOptions) -> GpuRaycaster {
    GpuRaycaster::new(options).unwrap_or_else(|error| ignore(error))
}

/// How two pictures differ, premultiplied, over all four channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Difference {
    pub(crate) max: f32,
    pub(crate) mean: f64,
    /// Pixels beyond 2/255.
    pub(crate) beyond: usize,
}

pub(crate) fn difference(a: &impl AsRef<[RawPixel]>, b: &impl AsRef<[RawPixel]>) -> Difference {
    let (a, b) = (a.as_ref(), b.as_ref());
    assert_eq!(a.len(), b.len());
    let (mut max, mut sum, mut beyond) = (0.0_f32, 0.0, 0);
    for (p, q) in a.iter().zip(b) {
        let worst = p.iter().zip(q).fold(0.0_f32, |worst, (x, y)| {
            assert!(x.is_finite() && y.is_finite());
            sum += f64::from((x - y).abs());
            worst.max((x - y).abs())
        });
        max = max.max(worst);
        beyond += usize::from(worst > 2.0 / 255.0);
    }
    Difference { max, mean: sum / (4 * a.len()) as f64, beyond }
}

/// A projection's pixel is opaque where there is one.
pub(crate) fn most_opaque(pixels: &Pixels) -> f32 {
    pixels.raw().iter().fold(0.0, |most, p| most.max(p[3]))
}

/// Pixels `[lo, hi)`.
pub(crate) fn rect(lo: [u32; 2], hi: [u32; 2]) -> PixelRect {
    PixelRect { lo: lo.into(), hi: hi.into() }
}

#[test]
fn the_comparison_can_fail_in_every_channel() {
    let p: RawPixel = [0.2, 0.3, 0.4, 0.5];
    assert_eq!(difference(&[p; 8], &[p; 8]), Difference { max: 0.0, mean: 0.0, beyond: 0 });
    for channel in 0..4 {
        let mut q = p;
        q[channel] += 0.01;
        let mut other = [p; 8];
        other[3] = q;
        let d = difference(&[p; 8], &other);
        assert!(d.max > 0.0099 && d.mean > 0.0003 && d.beyond == 1, "{d:?}");
    }
}

//! Rays through a field's bricks: what the loop takes that leaps, and what the plain raycast of V' has there.

use brickcast_shaders::layout::{BrickUniform, CODED_SCALE, FrameUniform, NEVER};
use brickcast_shaders::twin::bindings::{Along, Bindings, BrickData, RayCounts, SceneData, Tables};
use brickcast_shaders::twin::march::march;
use brickcast_shaders::twin::ray::{Ray, owned_segment};
use brickcast_shaders::twin::run::Step;
use brickcast_shaders::twin::take::Sampled;
use brickcast_shaders::twin::walk::{CodeWalk, Leap, Uncoded, Unmapped};
use brickcast_shaders::{KernelKey, StyleUniform};
use brickcast_volume::Premul;
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::regions::code::{CodedTexel, MAX_DENSITY};
use brickcast_volume::regions::{RegionTexels, guard_width};
use bytemuck::Zeroable;
use glam::DVec3;

use super::field::Field;
use super::watch::Watched;

/// The rule that a march breaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Broken {
    Nothing,
    /// Guards one layer thinner than the step needs.
    ThinGuard,
    /// Each leap takes one sample more than it may.
    LongLeap,
    /// Slots are looked up one further.
    WrongSlot,
    /// A brick's first samples are not probed.
    NoEntryProbes,
    /// Densities that do not stretch over the whole range of codes.
    Unstretched,
    /// The paper's leap length: right, but shorter.
    Isotropic,
}

/// What one ray took from one brick.
#[derive(Debug, Default)]
pub(crate) struct Taken {
    /// (first sample, samples, value in 14-bit densities).
    pub(crate) runs: Vec<(f32, f32, f32)>,
}

/// Leaps that break a rule.
macro_rules! walks {
    ($($name:ident: $change:expr, $exit:expr;)*) => {$(
        struct $name(Leap);
        impl CodeWalk for $name {
            fn enter_code(along: &Along<'_>) -> Self {
                let change: fn(Leap) -> Leap = $change;
                Self(change(Leap::enter_code(along)))
            }
            fn ask_code(&mut self, along: &Along<'_>, step: &mut Step, p: [f32; 3]) -> u32 {
                self.0.ask_code(along, step, p)
            }
            fn leave_code(&mut self, step: &Step, code: f32) {
                self.0.leave_code(step, code);
            }
            fn exit_of(&self, along: &Along<'_>, step: &Step, k: f32) -> f32 {
                let exit: fn(&Leap, &Along<'_>, &Step, f32) -> f32 = $exit;
                exit(&self.0, along, step, k)
            }
        }
    )*};
}

walks! {
    Long: |leap| leap, |leap, along, step, k| leap.exit_of(along, step, k) + 1.0;
    Unprobed: |leap| Leap { probes: 0, ..leap }, |leap, along, step, k| leap.exit_of(along, step, k);
    Isotropic: |leap| leap, isotropic_exit;
}

/// The paper's length, isotropic, whatever the direction.
fn isotropic_exit(_: &Leap, along: &Along<'_>, step: &Step, k: f32) -> f32 {
    let h = (0..3).fold(0.0_f32, |m, a| m.max((along.bound.scene.frame.step * along.ray.direction[a]).abs()));
    k + ((step.half - 0.5) / h).floor().max(1.0)
}

/// A brick ready to be marched through.
pub(crate) struct Brick {
    uniform: BrickUniform,
    texels: Vec<u16>,
    means: Option<Vec<f32>>,
}

impl Brick {
    pub(crate) fn new(field: &Field, owned: OwnedBox, guard: u32, broken: Broken) -> Self {
        let stored = owned.stored(1);
        let mut uniform = BrickUniform::of_boxes(&owned, &stored);
        let code = |density: &u16| f32::from(*density) / f32::from(MAX_DENSITY);
        let (texels, means) = match field.texels(&owned, guard) {
            RegionTexels::Plain => (field.voxels(stored).codes, None),
            RegionTexels::Flat { codes } => (codes, None),
            RegionTexels::Uniform { mean, .. } => {
                uniform.stored_dims = [1; 3];
                (vec![CodedTexel::Leap { distance: 255, slot: 0 }.pack()], Some(vec![code(&mean)]))
            }
            RegionTexels::Coded { texels, means, .. } => {
                let mut means: Vec<f32> = means.iter().map(code).collect();
                if broken == Broken::WrongSlot {
                    means.rotate_left(1);
                }
                (texels, Some(means))
            }
        };
        if means.is_some() {
            uniform.code_scale = if broken == Broken::Unstretched { 2.0 } else { CODED_SCALE };
        }
        Self { uniform, texels, means }
    }

    pub(crate) fn march(&self, frame: &FrameUniform, ray: &Ray, broken: Broken) -> (Taken, RayCounts) {
        let table = [[1.0, 0.5, 0.25, 1e-4]; 2];
        let tables = Tables { table: &table, region: None };
        let scene = SceneData { frame, style: &StyleUniform::PLAIN, tables, slabs: None };
        let data = BrickData { texels: &self.texels, means: self.means.as_deref(), map: None, flags: &[] };
        let key = KernelKey { leaps: self.means.is_some(), ..KernelKey::PLAIN };
        let bound = Bindings { scene: &scene, brick: &self.uniform, data, key };
        match broken {
            _ if !key.leaps => watched::<Uncoded>(&bound, ray),
            Broken::LongLeap => watched::<Long>(&bound, ray),
            Broken::NoEntryProbes => watched::<Unprobed>(&bound, ray),
            Broken::Isotropic => watched::<Isotropic>(&bound, ray),
            _ => watched::<Leap>(&bound, ray),
        }
    }
}

/// What a ray takes by a walk.
fn watched<C: CodeWalk>(bound: &Bindings<'_>, ray: &Ray) -> (Taken, RayCounts) {
    let marched = march::<Unmapped, C, Watched<Sampled>>(bound, ray, &mut Premul::CLEAR.clone());
    let Some((watched, counts)) = marched else { return <_>::default() };
    let runs = watched.runs.iter().map(|run| (run.k, run.n, run.code * f32::from(MAX_DENSITY)));
    (Taken { runs: runs.collect() }, counts)
}

/// Only what a ray reads of a frame: samples at multiples of `step`, in units of t.
pub(crate) fn frame(step: f32) -> FrameUniform {
    FrameUniform { step, stop_alpha: NEVER, table_scale: 1.0, region_scale: 1.0, shown: 3, ..FrameUniform::zeroed() }
}

/// From `origin` towards `target`, with `voxels_per_unit` as the view has it.
pub(crate) fn ray(origin: DVec3, target: DVec3, voxels_per_unit: DVec3) -> Ray {
    let d = (((target - origin) / voxels_per_unit).normalize() * voxels_per_unit).as_vec3().to_array();
    let direction = d.map(|d| if d.abs() < 1e-9 { 0.0 } else { d });
    let inverse = direction.map(|d| if d == 0.0 { 0.0 } else { 1.0 / d });
    Ray { origin: origin.as_vec3().into(), direction, inverse }
}

/// How far an accelerated march is from the plain one, in 14-bit densities; and what it took.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Comparison {
    pub(crate) worst: f64,
    pub(crate) samples: u64,
    pub(crate) positions: u64,
    pub(crate) leapt: u64,
    /// Rays through bricks that took anything.
    pub(crate) segments: u64,
}

/// The whole field in bricks of `size`, by every ray.
pub(crate) fn compare(field: &Field, size: u32, step: f32, rays: &[Ray], broken: Broken) -> Comparison {
    let frame = frame(step);
    let guard = guard_width(f64::from(step), 0) - u32::from(broken == Broken::ThinGuard);
    let mut comparison = Comparison::default();
    for owned in field.bricks(size) {
        let brick = Brick::new(field, owned, guard, broken);
        for ray in rays {
            add(field, &brick, &frame, ray, broken, &mut comparison);
        }
    }
    comparison
}

fn add(field: &Field, brick: &Brick, frame: &FrameUniform, ray: &Ray, broken: Broken, sum: &mut Comparison) {
    let (taken, counts) = brick.march(frame, ray, broken);
    let mut next = owned_segment(frame.step, &brick.uniform, ray).map(|s| s.k);
    let coded = brick.means.is_some();
    let exact = |p| {
        // Where no voxel leaps, voxels outside regions keep their 16 bits.
        if coded { field.flattened(p) } else { field.flattened_code(p) }
    };
    for (k, n, value) in taken.runs {
        assert_eq!(Some(k), next, "samples are taken in order, none twice, none left out");
        for k in (0..n as u32).map(|i| k + i as f32) {
            let t = k * frame.step;
            let p = std::array::from_fn(|a| f64::from(ray.origin[a] + t * ray.direction[a]));
            let want = Field::trilinear(p, exact);
            sum.worst = sum.worst.max((f64::from(value) - want).abs());
        }
        next = Some(k + n);
    }
    if let Some(segment) = owned_segment(frame.step, &brick.uniform, ray) {
        let k = next.unwrap_or(0.0);
        assert!(
            k * frame.step >= segment.t_out && (k - 1.0) * frame.step < segment.t_out,
            "all owned samples are taken"
        );
        sum.segments += 1;
    }
    sum.samples += u64::from(counts.samples);
    sum.positions += u64::from(counts.positions);
    sum.leapt += u64::from(counts.leapt);
}

/// The lowest value that an accelerated ray takes, in 14-bit densities.
pub(crate) fn lowest(field: &Field, size: u32, step: f32, ray: &Ray) -> f32 {
    let frame = frame(step);
    let guard = guard_width(f64::from(step), 0);
    let brick = |owned| Brick::new(field, owned, guard, Broken::Nothing).march(&frame, ray, Broken::Nothing).0;
    field.bricks(size).into_iter().flat_map(|b| brick(b).runs).fold(f32::MAX, |low, (.., value)| low.min(value))
}

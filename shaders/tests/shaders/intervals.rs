//! Whatever volume has the regions, its pixels lie within their intervals, and so do those of V': the twin's rays
//! through random volumes, in every style; and intervals from ranges a code too narrow, to show that the comparison
//! notices.

use std::sync::Arc;

use brickcast_shaders::interval::{BrickSpans, Interval, IntervalTables, RaySamples, Spans, walk_brick};
use brickcast_shaders::layout::{BrickUniform, CODED_SCALE, FrameUniform, PLAIN_SCALE};
use brickcast_shaders::twin::bindings::{Bindings, BrickData, SceneData, SlabTable, Tables};
use brickcast_shaders::twin::march::march_ray;
use brickcast_shaders::twin::ray::Ray;
use brickcast_shaders::{KernelKey, StyleUniform, TakeKind};
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::regions::code::MAX_DENSITY;
use brickcast_volume::regions::{CodeSpans, RegionTexels, code_spans, codes_of_region, guard_width, region_texels};
use brickcast_volume::scene::Look;
use brickcast_volume::style::{Clip, ClipPlane, Integration, Lighting, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{Geometry, OwnedBox, Premul};
use glam::{DVec3, UVec3};
use proptest::prelude::*;

use super::leaping::field::Field;
use super::leaping::march::{frame, ray};
use super::leaping::property::{Dice, random_rays, volume};

/// What sums in f32 may round, here and there.
const SLACK: f32 = 2e-5;

fn styles() -> Vec<(&'static str, Style)> {
    let integral = Style { integration: Integration::Preintegrated(TableSize::N256), ..Style::default() };
    let phong =
        |lighting, light| Some(Phong { lighting, light, light_from: Some(0.02), shininess: 5.0, ..Phong::default() });
    let aslant = Some(DVec3::new(1.0, 2.0, -0.5));
    let planes = vec![ClipPlane { normal: DVec3::new(-1.0, 0.6, 0.3), offset: -9.0 }];
    let clip = Clip { bounds: None, planes };
    vec![
        ("sampled", Style::default()),
        ("preintegrated", integral.clone()),
        ("sampled and lit", Style { shading: phong(Lighting::Interpolated, aslant), ..Style::default() }),
        ("interpolated light", Style { shading: phong(Lighting::Interpolated, None), ..integral.clone() }),
        ("light in the middle", Style { shading: phong(Lighting::Center, aslant), ..integral.clone() }),
        ("light where it comes from", Style { shading: phong(Lighting::Centroid, None), ..integral.clone() }),
        ("lit cut", Style { clip: clip.clone(), shading: phong(Lighting::Interpolated, aslant), ..integral }),
        ("lit cut of samples", Style { clip, shading: phong(Lighting::Interpolated, None), ..Style::default() }),
    ]
}

/// How the ranges of regions are got wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Narrowed {
    Not,
    Below(u16),
    Above(u16),
}

/// One brick that holds a field, in one style and under one function.
struct Scene<'a> {
    field: &'a Field,
    style: Style,
    table: TransferTable,
    slabs: Option<Arc<Preintegrated>>,
    intervals: IntervalTables,
    style_uniform: StyleUniform,
    frame: FrameUniform,
    uniform: BrickUniform,
    owned: OwnedBox,
    step: f32,
}

impl<'a> Scene<'a> {
    fn new(field: &'a Field, style: &Style, function: &TransferFunction, step: f32, spacing: DVec3) -> Self {
        let range = (0.0, 1.0);
        let geometry = Geometry::new(field.dims.into(), spacing.into(), [0.0; 3]).unwrap();
        let table = TransferTable::build(function, range, f64::from(step));
        let lit = style.shading.is_some_and(|phong| phong.lighting.needs_weights());
        let slabs = style
            .integrates_slabs()
            .then(|| Arc::new(Preintegrated::build(function, range, f64::from(step), TableSize::N256, lit)));
        let both = slabs.clone().map(|slabs| [slabs.clone(), slabs]);
        let intervals = IntervalTables::new(&Look::new(function.clone(), 1.0), range, (&table, None), both.as_ref());
        let owned = OwnedBox { lo: UVec3::ZERO, hi: field.dims };
        let frame = FrameUniform {
            table_first: table.c_first,
            table_scale: table.scale(),
            region_first: table.c_first,
            region_scale: table.scale(),
            voxels_per_unit: (spacing.min_element() / spacing).as_vec3().into(),
            ..frame(step)
        };
        let uniform = BrickUniform::of_boxes(&owned, &owned.stored(style.ghost(f64::from(step))));
        let style_uniform = StyleUniform::new(style, &geometry, range);
        Self { field, style: style.clone(), table, slabs, intervals, style_uniform, frame, uniform, owned, step }
    }

    fn with<T>(&self, run: impl FnOnce(&SceneData<'_>) -> T) -> T {
        let slabs = self.slabs.as_ref().map(|slabs| {
            let entries = match &slabs.lit {
                Some(lit) => [&lit.front[..], &lit.back[..]],
                None => [&slabs.total[..], &[][..]],
            };
            [SlabTable::new(slabs, entries), SlabTable::new(slabs, entries)]
        });
        let tables = Tables { table: &self.table.entries, region: None };
        run(&SceneData { frame: &self.frame, style: &self.style_uniform, tables, slabs })
    }

    fn march(&self, texels: &[u16], means: Option<&[f32]>, uniform: BrickUniform, rays: &[Ray]) -> Vec<Premul> {
        let key = KernelKey { leaps: means.is_some(), take: TakeKind::of(&self.style), ..KernelKey::PLAIN };
        let data = BrickData { texels, means, map: None, flags: &[] };
        self.with(|scene| {
            let bound = Bindings { scene, brick: &uniform, data, key };
            rays.iter().map(|ray| march_ray(&bound, ray, Premul::CLEAR).0).collect()
        })
    }

    /// Pictures of V', and of volumes whose voxels in regions are anything that these allow.
    fn pictures(&self, dice: &mut Dice, rays: &[Ray]) -> Vec<Vec<Premul>> {
        let stored = self.owned.stored(self.style.ghost(f64::from(self.step)));
        let (voxels, radius) = (self.field.voxels(stored), self.style.gradient_radius());
        let regions = self.field.regions_around(stored, 1 + radius as i32);
        let guard = guard_width(f64::from(self.step), radius);
        let code = |density: &u16| f32::from(*density) / f32::from(MAX_DENSITY);
        let (mut uniform, plain) = (self.uniform, self.uniform);
        let flat = match region_texels(&voxels, &regions, &self.field.table, guard, radius).unwrap() {
            RegionTexels::Plain => self.march(&voxels.codes, None, uniform, rays),
            RegionTexels::Flat { codes } => self.march(&codes, None, uniform, rays),
            RegionTexels::Uniform { mean, .. } => {
                let codes = vec![brickcast_volume::regions::code::code_of_density(mean); voxels.codes.len()];
                self.march(&codes, None, uniform, rays)
            }
            RegionTexels::Coded { texels, means, .. } => {
                uniform.code_scale = CODED_SCALE;
                let means: Vec<f32> = means.iter().map(code).collect();
                self.march(&texels, Some(&means), uniform, rays)
            }
        };
        let mut pictures = vec![flat, self.march(&voxels.codes, None, plain, rays)];
        for way in 0..4 {
            let mut other = self.field.clone();
            for (code, label) in other.codes.iter_mut().zip(&self.field.labels) {
                if let Some(region) = self.field.table.get(*label) {
                    let [low, high] = codes_of_region(region);
                    *code = match way {
                        0 => low,
                        1 => high,
                        _ => low + dice.roll(u32::from(high - low) + 1) as u16,
                    };
                }
            }
            pictures.push(self.march(&other.voxels(stored).codes, None, plain, rays));
        }
        pictures
    }

    fn spans(&self, narrowed: Narrowed) -> CodeSpans {
        let stored = self.owned.stored(self.style.ghost(f64::from(self.step)));
        let regions = self.field.regions_around(stored, 1);
        let mut spans = code_spans(&self.field.voxels(stored), &regions, &self.field.table).unwrap();
        let of_region = spans.distances.iter().map(|&d| d > 0).collect::<Vec<_>>();
        match narrowed {
            Narrowed::Not => {}
            Narrowed::Below(by) => spans.low.iter_mut().zip(of_region).filter(|(_, r)| *r).for_each(|(c, _)| *c += by),
            Narrowed::Above(by) => spans.high.iter_mut().zip(of_region).filter(|(_, r)| *r).for_each(|(c, _)| *c -= by),
        }
        spans
    }

    fn intervals(&self, narrowed: Narrowed, rays: &[Ray]) -> Vec<Interval> {
        let spans = self.spans(narrowed);
        let key = KernelKey { take: TakeKind::of(&self.style), ..KernelKey::PLAIN };
        let uniform = BrickUniform { code_scale: PLAIN_SCALE, ..self.uniform };
        let data = BrickData { texels: &spans.low, means: None, map: None, flags: &[] };
        self.with(|scene| {
            let bound = Bindings { scene, brick: &uniform, data, key };
            let spans = Some(Spans { high: Some(&spans.high), distances: Some(&spans.distances), blur: 0.0 });
            let brick = BrickSpans { bound, spans };
            let mut samples = RaySamples::default();
            let of = |ray: &Ray| {
                samples.clear();
                walk_brick(&brick, &self.intervals, ray, &mut samples);
                samples.interval()
            };
            rays.iter().map(of).collect()
        })
    }

    /// By how much the worst pixel of any picture lies outside, and the mean width.
    fn outside(&self, dice: &mut Dice, rays: &[Ray], narrowed: Narrowed) -> (f32, f32) {
        let intervals = self.intervals(narrowed, rays);
        let mut worst = f32::MIN;
        for picture in self.pictures(dice, rays) {
            for (pixel, Interval { lo, hi }) in picture.iter().zip(&intervals) {
                let beyond = |c: usize, value: f32| (lo[c] - value).max(value - hi[c]);
                worst = pixel.to_array().into_iter().enumerate().map(|(c, v)| beyond(c, v)).fold(worst, f32::max);
            }
        }
        let width = intervals.iter().map(|i| i.hi[3] - i.lo[3]).sum::<f32>() / intervals.len() as f32;
        (worst, width)
    }
}

fn function(dice: &mut Dice) -> TransferFunction {
    let count = 2 + dice.roll(5);
    let mut xs: Vec<f64> = (0..count).map(|_| dice.unit()).collect();
    xs.sort_by(f64::total_cmp);
    xs.dedup_by(|a, b| *a - *b < 1e-3);
    let colors = xs.iter().map(|&x| ColorPoint { x, rgb: [dice.unit(), dice.unit(), dice.unit()] }).collect();
    let top = [0.05, 0.3, 1.0][dice.roll(3) as usize];
    let opacity = |dice: &mut Dice| if dice.roll(3) == 0 { 0.0 } else { dice.unit() * top };
    let opacities = xs.iter().map(|&x| OpacityPoint { x, opacity: opacity(dice) }).collect();
    TransferFunction::new(colors, opacities).unwrap()
}

fn outside(seed: u64) -> (f32, String) {
    let mut dice = Dice(seed);
    let field = volume(&mut dice);
    let spacing = [DVec3::ONE, DVec3::ONE, DVec3::new(1.0, 1.7, 2.6)][dice.roll(3) as usize];
    let rays = random_rays(&mut dice, field.dims.as_dvec3().into(), spacing.min_element() / spacing);
    let styles = styles();
    let (name, style) = &styles[dice.roll(styles.len() as u32) as usize];
    let (function, step) = (function(&mut dice), [0.5, 0.7, 1.0, 2.0][dice.roll(4) as usize]);
    let scene = Scene::new(&field, style, &function, step, spacing);
    let (worst, width) = scene.outside(&mut dice, &rays, Narrowed::Not);
    (worst, format!("seed {seed}, {name}, step {step}, dims {}: outside by {worst}, width {width}", field.dims))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(250))]
    #[test]
    fn any_volume_with_the_regions_is_drawn_within(seed: u64) {
        let (worst, what) = outside(seed);
        prop_assert!(worst <= SLACK, "{what}");
    }
}

/// A ball of a region in another, and noise in a corner.
fn ball() -> Field {
    Field::new([24; 3], |p| {
        let jitter = ((p.x * 7 + p.y * 13 + p.z * 29) % 101) as u16 * 8;
        match (p - 12).length_squared() < 60 {
            _ if p.min_element() > 18 => (jitter * 60, 0),
            true => (40_000 + jitter, 1),
            false => (10_000 + jitter, 2),
        }
    })
}

/// Steep where the ball's values are.
fn steep() -> TransferFunction {
    let at = |code: f64| code / 65535.0;
    let colors = vec![ColorPoint { x: at(39_900.0), rgb: [0.2; 3] }, ColorPoint { x: at(40_900.0), rgb: [0.9; 3] }];
    let opacities =
        vec![OpacityPoint { x: at(39_900.0), opacity: 0.0 }, OpacityPoint { x: at(40_900.0), opacity: 0.3 }];
    TransferFunction::new(colors, opacities).unwrap()
}

fn through_the_ball() -> Vec<Ray> {
    let targets = (0..5).map(|i| DVec3::new(9.0 + f64::from(i), 12.3, 11.0));
    targets.map(|target| ray(DVec3::new(-30.0, 20.0, 5.0), target, DVec3::ONE)).collect()
}

/// One code less on either side is noticed in single samples (the inner bit takes two of those above), and a few in
/// slabs, whose ends vary each for itself.
#[test]
fn ranges_a_code_too_narrow_are_noticed() {
    let (field, function, rays) = (ball(), steep(), through_the_ball());
    for (name, style) in styles() {
        let scene = Scene::new(&field, &style, &function, 0.5, DVec3::ONE);
        let codes = if style.integration == Integration::Sampled { 1 } else { 4 };
        for (narrowed, holds) in [
            (Narrowed::Not, true),
            (Narrowed::Below(codes), false),
            (Narrowed::Above(codes + 2), false),
            (Narrowed::Below(40), false),
        ] {
            let (worst, width) = scene.outside(&mut Dice(1), &rays, narrowed);
            assert_eq!(worst <= SLACK, holds, "{name}, {narrowed:?}: outside by {worst}, width {width}");
        }
    }
}

/// One region from end to end, sampled: n steps, each with the ramp's opacity at its smallest or largest value.
#[test]
fn an_interval_of_one_region_is_the_analytic_one() {
    let field = Field::new([20; 3], |p| (40_000 + ((p.x * 7 + p.y * 13 + p.z * 29) % 101) as u16 * 8, 1));
    let function = steep();
    let scene = Scene::new(&field, &Style::default(), &function, 0.5, DVec3::ONE);
    let rays = [ray(DVec3::new(-30.0, 9.9, 10.1), DVec3::new(50.0, 9.9, 10.1), DVec3::ONE)];
    let Interval { lo, hi } = scene.intervals(Narrowed::Not, &rays)[0];
    let [low, high] = codes_of_region(field.table.get(1).unwrap());
    let alpha = |code: f64| 1.0 - (1.0 - function.opacity(code / 65535.0)).powf(0.5 * 40.0);
    assert!((f64::from(lo[3]) - alpha(f64::from(low))).abs() < 1e-3, "{lo:?} {}", alpha(f64::from(low)));
    assert!((f64::from(hi[3]) - alpha(f64::from(high) + 2.0)).abs() < 1e-3, "{hi:?} {}", alpha(f64::from(high)));
}

/// Nothing that is known is blurred: without regions the width is that of rounding, and of 14 bits.
#[test]
fn where_nothing_is_flattened_there_is_hardly_any_width() {
    let field = Field::new([24; 3], |p| (20_000 + ((p.x * 700 + p.y * 130 + p.z * 290) % 20_000) as u16, 0));
    let colors = vec![ColorPoint { x: 0.2, rgb: [0.1; 3] }, ColorPoint { x: 0.8, rgb: [0.9; 3] }];
    let opacities = vec![OpacityPoint { x: 0.2, opacity: 0.0 }, OpacityPoint { x: 0.8, opacity: 0.1 }];
    let function = TransferFunction::new(colors, opacities).unwrap();
    for (name, style) in styles() {
        let scene = Scene::new(&field, &style, &function, 0.5, DVec3::ONE);
        for Interval { lo, hi } in scene.intervals(Narrowed::Not, &through_the_ball()) {
            let widest = (0..4).map(|c| hi[c] - lo[c]).fold(0.0, f32::max);
            // Light turns with gradients of few codes, and a centroid is somewhere within its slab.
            let most = if style.shading.is_some() { 0.15 } else { 2e-3 };
            assert!(hi[3] > 0.1 && widest < most, "{name}: {lo:?} to {hi:?}");
        }
    }
}

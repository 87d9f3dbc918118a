//! Slabs, light, surfaces, projections: GPU against twin, acceleration on against off, one brick against many, for
//! every style.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use brickcast_node::kernel::{BrickInput, JobImage, KernelScene, KernelStyle, Raycaster, Recipe};
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::scene::Filter;
use brickcast_volume::style::{Clip, ClipPlane, Integration, Isosurface, Lighting, Mode, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{BrickGrid, PixelKind, RawPixel, View};
use glam::DVec3;

use super::labelled::Labelled;
use super::scene::{BOTH_FILTERS, Resident, VIEWPOINTS, cpu, difference, gpu, gpu_too, most_opaque, render_one};

const DIMS: [u32; 3] = [40, 30, 20];
/// Every kind of view, at steps from a quarter to two voxels.
const VIEWS: [(usize, f64); 5] = [(0, 0.5), (1, 1.0), (2, 0.25), (4, 0.5), (7, 2.0)];

/// Air below 0.15 is clear; slopes of at most 2.5, so that the maximum bounds bind.
fn function() -> TransferFunction {
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.1, 0.2, 0.3] }, ColorPoint { x: 1.0, rgb: [0.7, 0.7, 0.1] }];
    let opacities = vec![
        OpacityPoint { x: 0.15, opacity: 0.0 },
        OpacityPoint { x: 0.4, opacity: 0.05 },
        OpacityPoint { x: 1.0, opacity: 0.21 },
    ];
    TransferFunction::new(colors, opacities).unwrap()
}

fn surface(value: f64, color: [f32; 3], opacity: f32) -> Isosurface {
    Isosurface { value, color, opacity }
}

/// All that the kernel can do, each with what it goes with.
fn styles() -> Vec<(&'static str, Style)> {
    let integral = Style { integration: Integration::Preintegrated(TableSize::N1024), ..Style::default() };
    let phong = |lighting, light| Some(Phong { lighting, light, ..Phong::default() });
    let aslant = Some(DVec3::new(1.0, 2.0, -0.5));
    let surfaces = vec![surface(0.33, [1.0, 0.2, 0.1], 0.6), surface(0.52, [0.2, 0.4, 1.0], 0.7)];
    let clip = Clip {
        bounds: Some((DVec3::new(3.3, 2.2, -1.0), DVec3::new(33.1, 24.9, 50.0))),
        planes: vec![ClipPlane { normal: DVec3::new(-1.0, 0.6, 0.3), offset: -19.0 }],
    };
    vec![
        ("preintegrated", integral.clone()),
        ("interpolated light", Style { shading: phong(Lighting::Interpolated, None), ..integral.clone() }),
        ("light in the middle", Style { shading: phong(Lighting::Center, aslant), ..integral.clone() }),
        ("light where it comes from", Style { shading: phong(Lighting::Centroid, aslant), ..integral.clone() }),
        ("sampled and lit", Style { shading: phong(Lighting::Interpolated, aslant), ..Style::default() }),
        ("surfaces", Style { surfaces: surfaces.clone(), shading: phong(Lighting::Center, None), ..Style::default() }),
        (
            "surfaces in a lit volume",
            Style { surfaces, shading: phong(Lighting::Interpolated, aslant), ..integral.clone() },
        ),
        ("clipped", Style { clip: clip.clone(), ..integral.clone() }),
        ("lit cut", Style { clip: clip.clone(), shading: phong(Lighting::Interpolated, aslant), ..integral.clone() }),
        (
            "lit cut, light where it comes from",
            Style { clip: clip.clone(), shading: phong(Lighting::Centroid, aslant), ..integral.clone() },
        ),
        (
            "lit cut of samples",
            Style { clip: clip.clone(), shading: phong(Lighting::Interpolated, None), ..Style::default() },
        ),
        (
            "clipped surface",
            Style {
                clip,
                surfaces: vec![surface(0.4, [0.9; 3], 1.0)],
                shading: phong(Lighting::Center, None),
                ..integral
            },
        ),
        ("maximum", Style { mode: Mode::Maximum, ..Style::default() }),
        ("minimum", Style { mode: Mode::Minimum, ..Style::default() }),
        ("average", Style { mode: Mode::Average, ..Style::default() }),
    ]
}

#[derive(Debug, Clone, Copy, Default)]
struct Way {
    leaps: bool,
    skips: bool,
    homogeneous: Option<u16>,
}

/// Tables of slabs cost more than most pictures: each is made once.
fn slabs(function: &TransferFunction, is_alone: bool, step: f64, entries: usize, lit: bool) -> Arc<Preintegrated> {
    type Key = (bool, u64, usize, bool);
    static MADE: Mutex<BTreeMap<Key, Arc<Preintegrated>>> = Mutex::new(BTreeMap::new());
    let mut made = MADE.lock().unwrap();
    let make = || Arc::new(Preintegrated::with_entries(function, (0.0, 1.0), step, entries, lit));
    made.entry((is_alone, step.to_bits(), entries, lit)).or_insert_with(make).clone()
}

fn scene(volume: &Labelled, style: &Style, way: Way, view: View, filter: Filter) -> KernelScene {
    let (step, range, entries) = (view.step(), (0.0, 1.0), style.table_entries());
    // Isosurfaces by themselves, too.
    let is_alone = !style.surfaces.is_empty() && style.integration == Integration::Sampled;
    let function = if is_alone { TransferFunction::nothing() } else { function() };
    let lit = style.shading.is_some_and(|phong| phong.lighting.needs_weights());
    let slabs = style.integrates_slabs().then(|| {
        let slabs = slabs(&function, is_alone, step, entries, lit);
        [slabs.clone(), slabs]
    });
    let table = Arc::new(TransferTable::with_entries(&function, range, step, entries));
    KernelScene {
        skip_empty: way.skips,
        style: KernelStyle::new(style, step, &volume.geometry, range, slabs),
        ..KernelScene::plain(view, table, 0.999, filter)
    }
}

struct Case<'a> {
    volume: &'a Labelled,
    style: &'a Style,
    at: usize,
    step: f64,
    brick_size: u32,
    filter: Filter,
}

impl Case<'_> {
    fn view(&self) -> View {
        VIEWPOINTS[self.at].view(&self.volume.geometry, [41, 31], self.step)
    }

    fn render(&self, raycaster: &dyn Raycaster, way: Way) -> JobImage {
        let radius = self.style.gradient_radius();
        let recipe = Recipe {
            guard: way.leaps.then(|| brickcast_volume::regions::guard_width(self.step, radius) as u8),
            radius: radius as u8,
            macrocell: (way.skips || way.homogeneous.is_some()).then_some(4),
            homogeneous: way.homogeneous,
            region_flags: false,
            interval: false,
        };
        let ghost = self.style.ghost(self.step);
        let bricks = self.resident(|owned| {
            let stored = owned.stored(ghost);
            let (voxels, regions) = (self.volume.voxels(stored), self.volume.regions(stored));
            let input = BrickInput { voxels: &voxels, regions: Some((&regions, &self.volume.table)), recipe };
            raycaster.upload(owned, &input).unwrap()
        });
        let scene = scene(self.volume, self.style, way, self.view(), self.filter);
        render_one(raycaster, &scene, bricks.job(&self.view()))
    }

    /// V' written out as a volume, without acceleration.
    fn render_flattened(&self, raycaster: &dyn Raycaster) -> JobImage {
        let ghost = self.style.ghost(self.step);
        let bricks = self.resident(|owned| {
            raycaster.upload(owned, &BrickInput::plain(&self.volume.flattened(owned.stored(ghost)))).unwrap()
        });
        let scene = scene(self.volume, self.style, Way::default(), self.view(), self.filter);
        render_one(raycaster, &scene, bricks.job(&self.view()))
    }

    fn resident(
        &self,
        upload: impl Fn(brickcast_volume::OwnedBox) -> Arc<dyn brickcast_node::kernel::ResidentBrick>,
    ) -> Resident {
        Resident::of(BrickGrid::new(self.volume.dims(), self.brick_size).unwrap(), upload)
    }
}

/// Projections as their codes, so that a difference is one of what shows.
fn shown(image: &JobImage) -> Vec<RawPixel> {
    let shown = |pixel: &RawPixel| match image.pixels.kind() {
        PixelKind::Over => *pixel,
        kind => kind.code(*pixel).map_or([0.0; 4], |code| [code, 0.0, 0.0, 1.0]),
    };
    image.pixels.raw().iter().map(shown).collect()
}

fn volumes() -> [Labelled; 3] {
    [Labelled::part(DIMS, [1.0; 3]), Labelled::part(DIMS, [1.0, 2.0, 3.0]), Labelled::balls(DIMS, [1.0; 3])]
}

const ALL: Way = Way { leaps: true, skips: true, homogeneous: None };
const SKIP: Way = Way { leaps: false, skips: true, homogeneous: None };
const MACRO: Way = Way { leaps: false, skips: true, homogeneous: Some(900) };

#[test]
fn integral_gpu_and_twin_agree() {
    let gpu = gpu();
    let cpu = cpu();
    let (mut pixels, mut beyond) = (0, 0);
    for volume in &volumes() {
        for (name, style) in &styles() {
            for way in [Way::default(), ALL, MACRO] {
                if way.homogeneous.is_some() && (style.shading.is_some() || !style.surfaces.is_empty()) {
                    continue;
                }
                for &(at, step) in &VIEWS[..3] {
                    let case = Case { volume, style, at, step, brick_size: 16, filter: Filter::Exact };
                    let twin = case.render(&cpu, way);
                    for filter in BOTH_FILTERS {
                        let image = Case { filter, ..case }.render(gpu, way);
                        let what = format!("{name}, {way:?}, {}, step {step}, {filter:?}", VIEWPOINTS[at].name);
                        let d = difference(&shown(&image), &shown(&twin));
                        assert!(d.mean < 0.05 / 255.0, "{what}: {d:?}");
                        pixels += image.pixels.len();
                        beyond += d.beyond;
                        let (a, b) = (image.total(), twin.total());
                        for (a, b) in [(a.positions, b.positions), (a.leapt, b.leapt), (a.skips, b.skips)] {
                            assert!(a.abs_diff(b) as f64 <= 0.02 * b as f64 + 40.0, "{what}: {a} {b}");
                        }
                        // The twin's loop of slabs reads some values in vain.
                        let [a, b] = [a, b].map(|counts| counts.samples as f64);
                        assert!(a <= 1.02 * b + 40.0 && b <= 1.25 * a + 40.0, "{what}: {a} {b} samples");
                    }
                }
            }
        }
    }
    assert!(beyond * 10_000 <= pixels, "{beyond} of {pixels} pixels differ by more than 2/255");
}

/// To the bit: what is skipped has no opacity, and nothing next to it is missed.
#[test]
fn skipping_changes_no_integral() {
    let cpu = cpu();
    let mut saved = 0;
    // Its brick is cut to the cells of the ball, and the slabs that enter them start outside.
    let [dot, halves] = [Labelled::dot(DIMS), Labelled::halves(DIMS)];
    for volume in volumes().iter().chain([&dot, &halves]) {
        for (name, style) in &styles() {
            for (at, step) in VIEWS {
                let case = Case { volume, style, at, step, brick_size: 16, filter: Filter::Exact };
                let [off, on] = [Way::default(), SKIP].map(|way| case.render(&cpu, way));
                let what = format!("{name}, {}, step {step}", VIEWPOINTS[at].name);
                // A run of many zeros adds up as one.
                assert!(shown(&on) == shown(&off), "{what}");
                saved += off.total().samples.saturating_sub(on.total().samples);
            }
        }
    }
    assert!(saved > 40_000, "{saved}");
}

/// The accelerated picture is that of V'.
#[test]
fn leaping_is_the_integral_of_the_flattened_volume() {
    let check = |raycaster: &dyn Raycaster, filters: &[Filter]| {
        let mut leapt = 0;
        for volume in &volumes()[..2] {
            for (name, style) in &styles() {
                for (at, step) in VIEWS {
                    for &filter in filters {
                        let case = Case { volume, style, at, step, brick_size: 16, filter };
                        let (plain, leaping) = (case.render_flattened(raycaster), case.render(raycaster, ALL));
                        let what = format!("{name}, {}, step {step}, {filter:?}", VIEWPOINTS[at].name);
                        let d = difference(&shown(&leaping), &shown(&plain));
                        // Half a 14-bit code a sample, and how a run is summed.
                        assert!(d.mean < 0.05 / 255.0 && d.beyond <= 1, "{what}: {d:?}");
                        leapt += leaping.total().leapt;
                    }
                }
            }
        }
        assert!(leapt > 40_000, "{leapt}");
    };
    check(&cpu(), &[Filter::Exact]);
    if let Some(gpu) = gpu_too() {
        check(gpu, &[Filter::Hardware]);
    }
}

/// Light, surfaces and slabs know nothing of bricks; nor do projections and clips.
#[test]
fn one_brick_or_many_make_one_picture() {
    let check = |raycaster: &dyn Raycaster, filter: Filter, volumes: usize| {
        for volume in &self::volumes()[..volumes] {
            for (name, style) in &styles() {
                for (at, step) in VIEWS {
                    let case = Case { volume, style, at, step, brick_size: 64, filter };
                    let whole = case.render(raycaster, Way::default());
                    let what = format!("{name}, {}, step {step}", VIEWPOINTS[at].name);
                    assert!(most_opaque(&whole.pixels) > 0.3, "{what}: nothing to see");
                    for brick_size in [8, 16] {
                        let many = Case { brick_size, ..case }.render(raycaster, SKIP);
                        let d = difference(&shown(&many), &shown(&whole));
                        assert!(d.max <= 1.0 / 255.0, "{what}, bricks of {brick_size}: {d:?}");
                    }
                }
            }
        }
    };
    check(&cpu(), Filter::Exact, 3);
    if let Some(gpu) = gpu_too() {
        check(gpu, Filter::Hardware, 1);
    }
}

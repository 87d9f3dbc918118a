//! Bricks that leap, skip and tell regions apart: GPU against twin, acceleration on against off.

use std::sync::Arc;

use brickcast_node::gpu::GpuOptions;
use brickcast_node::kernel::{BrickInput, JobImage, KernelKey, KernelScene, LookTraits, Raycaster, Recipe};
use brickcast_volume::BrickGrid;
use brickcast_volume::regions::code::{MAX_DENSITY, code_of_density};
use brickcast_volume::scene::{Filter, RegionView};
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};

use super::labelled::Labelled;
use super::scene::{
    BOTH_FILTERS, Resident, VIEWPOINTS, cpu, difference, gpu, gpu_too, most_opaque, open_gpu, render_one,
};

const DIMS: [u32; 3] = [40, 30, 20];

/// Air below 0.15 is clear; slopes of at most 2.5, so that the maximum bounds bind.
fn table(step: f64, hue: f64) -> Arc<TransferTable> {
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.1, 0.2, hue] }, ColorPoint { x: 1.0, rgb: [1.0 - hue, 0.7, 0.1] }];
    let opacities = vec![
        OpacityPoint { x: 0.15, opacity: 0.0 },
        OpacityPoint { x: 0.4, opacity: 0.05 },
        OpacityPoint { x: 1.0, opacity: 0.15 + 0.2 * hue },
    ];
    Arc::new(TransferTable::build(&TransferFunction::new(colors, opacities).unwrap(), (0.0, 1.0), step))
}

/// One way to accelerate.
#[derive(Debug, Clone, Copy)]
struct Way {
    name: &'static str,
    leaps: bool,
    macrocell: Option<u8>,
    homogeneous: Option<u16>,
    skip_empty: bool,
    view: RegionView,
    has_region_table: bool,
}

const NONE: Way = Way {
    name: "none",
    leaps: false,
    macrocell: None,
    homogeneous: None,
    skip_empty: false,
    view: RegionView::All,
    has_region_table: false,
};
const ALL: Way = Way { name: "all", leaps: true, macrocell: Some(4), skip_empty: true, ..NONE };

const WAYS: [Way; 10] = [
    Way { name: "leap", leaps: true, ..NONE },
    Way { name: "skip", macrocell: Some(4), skip_empty: true, ..NONE },
    Way { name: "skip cells of 8", macrocell: Some(8), skip_empty: true, ..NONE },
    ALL,
    Way { name: "macro", macrocell: Some(4), homogeneous: Some(900), ..NONE },
    Way { name: "macro and skip", macrocell: Some(4), homogeneous: Some(900), skip_empty: true, ..NONE },
    Way { name: "residual", view: RegionView::Residual, ..ALL },
    Way { name: "regions", view: RegionView::Regions, ..ALL },
    Way { name: "regions by a table of their own", has_region_table: true, ..ALL },
    Way { name: "residual without leaps", view: RegionView::Residual, ..NONE },
];

impl Way {
    fn recipe(&self, step: f64) -> Recipe {
        Recipe {
            guard: self.leaps.then(|| brickcast_volume::regions::guard_width(step, 0) as u8),
            radius: 0,
            macrocell: self.macrocell,
            homogeneous: self.homogeneous,
            region_flags: self.view != RegionView::All || self.has_region_table,
            interval: false,
        }
    }

    fn scene(&self, view: brickcast_volume::View, filter: Filter) -> KernelScene {
        let step = view.step();
        KernelScene {
            skip_empty: self.skip_empty,
            region_view: self.view,
            region_table: self.has_region_table.then(|| table(step, 0.9)),
            ..KernelScene::plain(view, table(step, 0.3), 0.999, filter)
        }
    }
}

fn upload(raycaster: &dyn Raycaster, volume: &Labelled, brick_size: u32, recipe: Recipe) -> Resident {
    Resident::of(BrickGrid::new(volume.dims(), brick_size).unwrap(), |owned| {
        let stored = owned.stored(1);
        let (voxels, regions) = (volume.voxels(stored), volume.regions(stored));
        let input = BrickInput { voxels: &voxels, regions: Some((&regions, &volume.table)), recipe };
        raycaster.upload(owned, &input).unwrap()
    })
}

fn render(raycaster: &dyn Raycaster, volume: &Labelled, way: &Way, at: usize, step: f64, filter: Filter) -> JobImage {
    let view = VIEWPOINTS[at].view(&volume.geometry, [61, 47], step);
    let bricks = upload(raycaster, volume, 16, way.recipe(step));
    render_one(raycaster, &way.scene(view, filter), bricks.job(&view))
}

fn volumes() -> [Labelled; 2] {
    [Labelled::part(DIMS, [1.0; 3]), Labelled::part(DIMS, [1.0, 2.0, 3.0])]
}

fn assert_twins(gpu: &dyn Raycaster, filters: &[Filter]) {
    let cpu = cpu();
    let (mut pixels, mut beyond, mut skips) = (0, 0, 0);
    let [part, stretched] = volumes();
    for volume in [part, stretched, Labelled::balls(DIMS, [1.0; 3])] {
        for way in &WAYS {
            for (at, step) in [(0, 0.5), (1, 1.0), (2, 0.25), (4, 0.5), (7, 2.0)] {
                let twin = render(&cpu, &volume, way, at, step, Filter::Exact);
                for &filter in filters {
                    let image = render(gpu, &volume, way, at, step, filter);
                    let what = format!("{}, {}, step {step}, {filter:?}", way.name, VIEWPOINTS[at].name);
                    let d = difference(&image.pixels, &twin.pixels);
                    assert!(d.mean < 0.05 / 255.0, "{what}: {d:?}");
                    pixels += image.pixels.len();
                    beyond += d.beyond;
                    // Rays do the same but for rounding.
                    let (a, b) = (image.total(), twin.total());
                    skips += b.skips;
                    for (a, b) in
                        [(a.samples, b.samples), (a.positions, b.positions), (a.leapt, b.leapt), (a.skips, b.skips)]
                    {
                        assert!(
                            a.abs_diff(b) as f64 <= 0.02 * b as f64 + 40.0,
                            "{what}: {image:?} {twin:?}",
                            image = image.total(),
                            twin = twin.total()
                        );
                    }
                }
            }
        }
    }
    assert!(skips > 10_000, "{skips}");
    assert!(beyond * 10_000 <= pixels, "{beyond} of {pixels} pixels differ by more than 2/255");
}

#[test]
fn accelerated_gpu_and_twin_agree() {
    let gpu = gpu();
    assert_twins(gpu, &BOTH_FILTERS);
}

/// Texels decoded from 32-bit floats.
#[test]
fn accelerated_voxels_as_floats_agree() {
    let options = GpuOptions { without_norm16: true, ..GpuOptions::from_env() };
    let gpu = open_gpu(options);
    assert_twins(&gpu, &[Filter::Hardware]);
}

/// V' written out as a volume, by the plain kernel.
fn flattened(raycaster: &dyn Raycaster, volume: &Labelled, at: usize, step: f64, filter: Filter) -> JobImage {
    let view = VIEWPOINTS[at].view(&volume.geometry, [61, 47], step);
    let bricks = Resident::of(BrickGrid::new(volume.dims(), 16).unwrap(), |owned| {
        let voxels: BrickVoxels = volume.flattened(owned.stored(1));
        raycaster.upload(owned, &BrickInput::plain(&voxels)).unwrap()
    });
    render_one(raycaster, &NONE.scene(view, filter), bricks.job(&view))
}

fn assert_flattened(raycaster: &dyn Raycaster, filters: &[Filter]) {
    for volume in &volumes() {
        for (at, step) in [(0, 0.5), (1, 1.0), (2, 0.25), (5, 0.5), (8, 2.0)] {
            for &filter in filters {
                let plain = flattened(raycaster, volume, at, step, filter);
                assert!(most_opaque(&plain.pixels) > 0.3);
                for way in [&WAYS[0], &ALL] {
                    let leaping = render(raycaster, volume, way, at, step, filter);
                    let d = difference(&leaping.pixels, &plain.pixels);
                    // Half a 14-bit code a sample at slopes of 1, and other rounding.
                    let what = format!("{}, {}, step {step}, {filter:?}: {d:?}", way.name, VIEWPOINTS[at].name);
                    assert!(d.max < 0.5 / 255.0, "{what}");
                    let (few, many) = (leaping.total(), plain.total());
                    // In so small a volume probes pay where steps are short.
                    assert!(step > 0.5 || few.samples < many.samples, "{what}, {few:?} {many:?}");
                    if way.name == "leap" {
                        // Rays may end within a leap in place of at a sample; wide steps need guards as wide as this
                        // volume's walls.
                        assert!(few.positions >= many.positions, "{what}, {few:?}");
                        assert!(step > 1.0 || few.leapt > few.positions / 4, "{what}, {few:?}");
                    }
                }
            }
        }
    }
}

/// The invariant: the accelerated picture is the plain raycast of V', also for bricks that are plain, flat or uniform.
#[test]
fn leaping_is_the_plain_raycast_of_the_flattened_volume() {
    assert_flattened(&cpu(), &[Filter::Exact]);
    if let Some(gpu) = gpu_too() {
        assert_flattened(gpu, &BOTH_FILTERS);
    }
}

#[test]
fn skipping_changes_nothing() {
    let raycasters: [Option<(&dyn Raycaster, f32)>; 2] =
        [Some((&cpu(), 0.0)), gpu_too().map(|gpu| (gpu as &dyn Raycaster, 1.0 / 255.0))];
    for (raycaster, bound) in raycasters.into_iter().flatten() {
        let mut skipped = 0;
        for volume in &volumes() {
            for edge in [4, 8] {
                for (at, step) in [(0, 0.5), (1, 1.0), (2, 0.25)] {
                    let skip = Way { macrocell: Some(edge), skip_empty: true, ..NONE };
                    let [off, on] = [NONE, skip].map(|way| render(raycaster, volume, &way, at, step, Filter::Hardware));
                    let d = difference(&on.pixels, &off.pixels);
                    assert!(d.max <= bound, "{}, cells of {edge}, step {step}: {d:?}", raycaster.info().backend);
                    assert!(on.total().samples <= off.total().samples);
                    skipped += off.total().samples - on.total().samples;
                }
            }
        }
        assert!(skipped > 10_000);
    }
}

/// A brick given by its mean alone looks like the one whose voxels all are that mean.
#[test]
fn uniform_bricks_need_no_voxels() {
    let check = |raycaster: &dyn Raycaster| {
        let volume = Labelled::solid(DIMS, 9000);
        let grid = BrickGrid::new(volume.dims(), 16).unwrap();
        let mean = Resident::of(grid, |owned| raycaster.upload_uniform(owned, 9000).unwrap());
        let voxels = upload(raycaster, &volume, 16, ALL.recipe(0.5));
        for way in [ALL, Way { view: RegionView::Residual, ..ALL }, Way { view: RegionView::Regions, ..ALL }] {
            let view = VIEWPOINTS[1].view(&volume.geometry, [61, 47], 0.5);
            let scene = way.scene(view, Filter::Hardware);
            let [mean, voxels] = [&mean, &voxels].map(|bricks| render_one(raycaster, &scene, bricks.job(&view)));
            assert_eq!((&mean.pixels, &mean.counts), (&voxels.pixels, &voxels.counts));
            assert_eq!(most_opaque(&mean.pixels) > 0.3, way.view != RegionView::Residual);
        }
        let code = f64::from(code_of_density(9000)) / 65535.0;
        assert!((code - 9000.0 / f64::from(MAX_DENSITY)).abs() < 1e-4);
        assert!(mean.bytes() < 200 && voxels.bytes() < 200);
    };
    check(&cpu());
    if let Some(gpu) = gpu_too() {
        check(gpu);
    }
}

/// Regions and residual alone leave out what the other shows, and nothing is in neither.
#[test]
fn region_views_are_each_others_complement() {
    let cpu = cpu();
    let [volume, _] = volumes();
    let counts = [RegionView::All, RegionView::Regions, RegionView::Residual].map(|view| {
        let image = render(&cpu, &volume, &Way { view, ..NONE }, 1, 0.5, Filter::Exact);
        image.pixels.raw().iter().map(|p| f64::from(p[3])).sum::<f64>()
    });
    assert!(counts[1] > 0.2 * counts[0] && counts[2] > 0.2 * counts[0], "{counts:?}");
    assert!(counts[1] < counts[0] && counts[2] < counts[0] && counts[1] + counts[2] > counts[0], "{counts:?}");
}

/// A map that was built for one transfer function must not serve another.
#[test]
fn maps_follow_the_transfer_function() {
    let check = |raycaster: &dyn Raycaster| {
        let [volume, _] = volumes();
        let bricks = upload(raycaster, &volume, 16, ALL.recipe(0.5));
        let view = VIEWPOINTS[1].view(&volume.geometry, [61, 47], 0.5);
        let scene = ALL.scene(view, Filter::Hardware);
        let everything = KernelScene { table: super::scene::flat_table([1.0; 3], 0.02, 0.5), ..scene.clone() };
        let first = render_one(raycaster, &scene, bricks.job(&view));
        let all = render_one(raycaster, &everything, bricks.job(&view));
        let again = render_one(raycaster, &scene, bricks.job(&view));
        assert_eq!((&first.pixels, &first.counts), (&again.pixels, &again.counts));
        assert!(all.total().positions > first.total().positions);
        assert!(difference(&all.pixels, &first.pixels).max > 0.1);
    };
    check(&cpu());
    if let Some(gpu) = gpu_too() {
        check(gpu);
    }
}

#[test]
fn everything_warms_up() {
    let gpu = gpu();
    let recipe = Recipe { guard: Some(2), macrocell: Some(4), ..Recipe::default() };
    for tells_regions_apart in [false, true] {
        let look = LookTraits { tells_regions_apart, ..LookTraits::default() };
        let keys: Vec<_> = recipe.traits(true).into_iter().map(|brick| KernelKey::of(look, brick)).collect();
        assert!(keys.iter().any(|key| key.leaps && key.skips) && keys.iter().any(|key| key.holes));
        BOTH_FILTERS.iter().for_each(|&filter| gpu.warm_up(filter, &keys).unwrap());
    }
}

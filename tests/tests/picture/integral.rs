//! Slabs, light, isosurfaces, projections and clips against the referee, which knows no tables and no bricks.

use std::cell::OnceCell;

use brickcast_node::kernel::Raycaster;
use brickcast_tests::compare::{Tolerance, assert_within_where, compare_where};
use brickcast_tests::product::{self, Backend};
use brickcast_tests::referee::{self, LightAt, Mistake, Projection, render_styled};
use brickcast_tests::scenes::{self, Scene};
use brickcast_volume::scene::Filter;
use brickcast_volume::style::{Clip, ClipPlane, Integration, Isosurface, Lighting, Mode, Phong, Style, TableSize};
use glam::DVec3;

/// The same style for the referee and for the product.
struct Case {
    name: &'static str,
    truth: referee::Style,
    style: Style,
    filter: Filter,
}

/// A share of the range, in data units.
fn at(scene: &Scene, share: f64) -> f64 {
    scene.range.0 + (scene.range.1 - scene.range.0) * share
}

/// Everything alone, and what goes together.
fn cases(scene: &Scene) -> Vec<Case> {
    let filter = Filter::default();
    let plain = || Case { name: "sampled", truth: referee::Style::default(), style: Style::default(), filter };
    let slabs = |name| {
        let style = Style { integration: Integration::Preintegrated(TableSize::N1024), ..Style::default() };
        Case { name, truth: referee::Style { preintegrated: true, ..Default::default() }, style, filter }
    };
    let lit = |mut case: Case, name, lighting: Lighting, direction: Option<DVec3>| {
        let at = match lighting {
            Lighting::Interpolated => LightAt::Ends,
            Lighting::Center => LightAt::Middle,
            Lighting::Centroid => LightAt::Centroid,
        };
        let phong = Phong { lighting, light: direction, ambient: 0.25, diffuse: 0.6, ..Phong::default() };
        case.style.shading = Some(Phong { specular: 0.4, shininess: 12.0, ..phong });
        case.truth.light = Some(referee::Light {
            at,
            direction,
            ambient: 0.25,
            diffuse: 0.6,
            specular: 0.4,
            shininess: 12.0,
            range: scene.range,
            from: 0.0,
        });
        Case { name, ..case }
    };
    // The scenes' ramps rise by somewhat more than 0.005 of the range a voxel, edges by far more.
    let above = |mut case: Case, name, share: f64| {
        let from = share * (scene.range.1 - scene.range.0);
        case.style.shading = case.style.shading.map(|phong| Phong { light_from: Some(from), ..phong });
        case.truth.light = case.truth.light.map(|light| referee::Light { from, ..light });
        Case { name, ..case }
    };
    let labels = |mut case: Case, name| {
        case.truth.nearest = true;
        Case { name, filter: Filter::Nearest, ..case }
    };
    let surfaces = |mut case: Case, name, all: &[(f64, [f64; 4])]| {
        for &(share, color) in all {
            let value = at(scene, share);
            let [r, g, b, opacity] = color.map(|c| c as f32);
            case.style.surfaces.push(Isosurface { value, color: [r, g, b], opacity });
            case.truth.surfaces.push((value, color));
        }
        Case { name, ..case }
    };
    let projected = |name, mode, projection| Case {
        name,
        truth: referee::Style { projection: Some(projection), ..Default::default() },
        style: Style { mode, ..Style::default() },
        filter,
    };
    let clipped = |mut case: Case, name| {
        let volume = &scene.truth.volume;
        let place =
            |share: [f64; 3]| volume.world_from_index(DVec3::from(share) * DVec3::from(volume.dims.map(|n| n as f64)));
        let (lo, hi) = (place([0.13, 0.07, -0.5]), place([0.91, 0.88, 0.83]));
        let normal = DVec3::new(0.3, -0.5, 0.7);
        let offset = normal.dot(place([0.45, 0.5, 0.4]));
        case.style.clip = Clip { bounds: Some((lo, hi)), planes: vec![ClipPlane { normal, offset }] };
        case.truth.planes.push((normal, offset));
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            case.truth.planes.extend([(axis, axis.dot(lo)), (-axis, -axis.dot(hi))]);
        }
        Case { name, ..case }
    };
    let aslant = Some(DVec3::new(-0.4, 1.0, 0.7));
    let two = [(0.37, [0.9, 0.3, 0.2, 0.5]), (0.52, [0.2, 0.5, 0.9, 0.8])];
    vec![
        slabs("slabs"),
        lit(slabs(""), "interpolated headlight", Lighting::Interpolated, None),
        lit(slabs(""), "interpolated light aslant", Lighting::Interpolated, aslant),
        lit(slabs(""), "light in the middle", Lighting::Center, aslant),
        lit(slabs(""), "light where it comes from", Lighting::Centroid, aslant),
        lit(plain(), "lit samples", Lighting::Interpolated, aslant),
        surfaces(slabs(""), "surfaces in slabs", &two),
        lit(surfaces(slabs(""), "", &two), "lit surfaces in lit slabs", Lighting::Interpolated, aslant),
        lit(surfaces(plain(), "", &two), "lit surfaces among samples", Lighting::Center, None),
        clipped(slabs(""), "clipped slabs"),
        clipped(lit(surfaces(plain(), "", &two[..1]), "", Lighting::Center, None), "clipped surface"),
        above(lit(slabs(""), "", Lighting::Interpolated, aslant), "light above noise", 0.005),
        above(lit(plain(), "", Lighting::Interpolated, None), "lit samples above noise", 0.05),
        clipped(above(lit(slabs(""), "", Lighting::Interpolated, aslant), "", 0.05), "lit cut"),
        clipped(lit(slabs(""), "", Lighting::Center, None), "lit cut, light in the middle"),
        clipped(above(lit(slabs(""), "", Lighting::Centroid, aslant), "", 0.02), "lit cut, light where it comes from"),
        clipped(lit(plain(), "", Lighting::Interpolated, aslant), "lit cut of samples"),
        clipped(lit(surfaces(slabs(""), "", &two), "", Lighting::Interpolated, None), "lit cut through surfaces"),
        labels(plain(), "labels"),
        labels(clipped(plain(), ""), "clipped labels"),
        labels(projected("", Mode::Maximum, Projection::Maximum), "greatest label"),
        projected("maximum", Mode::Maximum, Projection::Maximum),
        clipped(projected("", Mode::Minimum, Projection::Minimum), "clipped minimum"),
        clipped(projected("", Mode::Average, Projection::Average), "clipped average"),
    ]
}

fn scenes_of(step: f64) -> Vec<Scene> {
    let small = |scene| scenes::resized(scene, [40, 32]);
    vec![
        small(scenes::oblique(step)),
        small(scenes::parallel_oblique(step)),
        small(scenes::eye_inside(step)),
        scenes::resized(scenes::eye_on_a_brick_corner(step), [32, 32]),
        small(scenes::holed(scenes::oblique(step))),
        small(scenes::holed(scenes::eye_inside(step))),
    ]
}

/// Where a sample may lie on either side of a plane, or a slab hold several crossings, single pixels may differ.
fn tolerance(backend: Backend, filter: Filter) -> Tolerance {
    // A sample within rounding of a voxel's face may be either voxel's: some in a hundred thousand, of each of three
    // axes.
    let outlier_share = if filter == Filter::Nearest { 1e-2 } else { 2e-3 };
    match backend {
        Backend::Cpu => Tolerance { outlier_share, ..Tolerance::CPU_AGAINST_REFEREE },
        Backend::Gpu => Tolerance { outlier_share, ..Tolerance::GPU_AGAINST_TWIN },
    }
}

/// The referee is slow: all kernels are held to one picture of it.
fn check_all(kernels: &[Kernel], step: f64) {
    for scene in scenes_of(step) {
        for Case { name, truth, style, filter } in cases(&scene) {
            let want = render_styled(&scene.truth, &truth);
            let excused = scene.excused(&want);
            let least = if truth.projection.is_some() { 0.01 } else { 0.2 };
            assert!(want.picture.max_alpha() > least, "{name}: {}: nothing to see", scene.name);
            for (&(backend, raycaster), brick_size) in kernels.iter().flat_map(|kernel| [(kernel, 8), (kernel, 64)]) {
                let what = format!("{backend:?}, {name}, bricks of {brick_size}: {}", scene.name);
                let (picture, _) =
                    product::load_styled(raycaster, &scene, brick_size, &style).with_filter(filter).render(&scene);
                let mut tolerance = tolerance(backend, filter);
                if scene.has_holes {
                    // Light ends at once where a gradient meets no data: rounding of its place decides (4 of 1,279
                    // pixels).
                    tolerance.outlier_share = 8e-3;
                }
                let d = assert_within_where(&what, &want.picture, &picture, &tolerance, |i| !excused[i]);
                eprintln!("{what}: max {:.3}/255, mean {:.4}/255", d.max * 255.0, d.mean * 255.0);
            }
        }
    }
}

/// Which it is, and it.
type Kernel = (Backend, &'static dyn Raycaster);

fn cpu() -> Kernel {
    (Backend::Cpu, product::raycaster(Backend::Cpu))
}

fn all() -> Vec<Kernel> {
    product::raycasters().collect()
}

#[test]
fn cpu_styles_agree_at_half_a_step() {
    check_all(&[cpu()], 0.5);
}

#[test]
fn styles_agree_at_a_whole_step() {
    check_all(&all(), 1.0);
}

#[test]
fn cpu_styles_agree_at_two_steps() {
    check_all(&[cpu()], 2.0);
}

/// Functions that no table of evenly spaced entries carries, in a volume of ramps and in one of alloys: sampled, in
/// slabs, lit in each way. In full precision the maximum bounds hold for all of them.
fn check_functions(kernels: &[(Kernel, Filter)], step: f64) {
    let mut shown = 0;
    for scene in [scenes::resized(scenes::oblique(step), [40, 32]), scenes::alloys(step)] {
        for (function, transfer) in scenes::functions() {
            let mut scene = scene.clone();
            scene.truth.transfer = transfer;
            let filter = Filter::Exact;
            let sampled = Case { name: "sampled", truth: referee::Style::default(), style: Style::default(), filter };
            let slabs =
                cases(&scene).into_iter().filter(|case| case.truth.preintegrated && case.truth.planes.is_empty());
            for Case { name, truth, style, .. } in slabs.filter(|c| c.truth.surfaces.is_empty()).chain([sampled]) {
                let want = render_styled(&scene.truth, &truth);
                let excused = scene.excused(&want);
                shown += usize::from(want.picture.max_alpha() > 0.02);
                for &((backend, raycaster), filter) in kernels {
                    let loaded = product::load_styled(raycaster, &scene, 16, &style).with_filter(filter);
                    let what = format!("{backend:?}, {filter:?}, {function}, {name}: {}", scene.name);
                    let (picture, _) = loaded.render(&scene);
                    // A single sample within rounding (1e-5 voxel) of a jump is on either side of it, and on a peak's
                    // flank elsewhere.
                    let is_steep = name == "sampled" || filter == Filter::Hardware;
                    let tolerance = if is_steep { &Tolerance::STEEP_HARDWARE_FILTER } else { &STEEP };
                    let d = assert_within_where(&what, &want.picture, &picture, tolerance, |i| !excused[i]);
                    eprintln!("{what}: max {:.3}/255, mean {:.4}/255", d.max * 255.0, d.mean * 255.0);
                }
            }
        }
    }
    assert!(shown > 40, "{shown} pictures show something");
}

const STEEP: Tolerance = Tolerance { outlier_share: 2e-3, ..Tolerance::GPU_AGAINST_TWIN };

#[test]
fn cpu_functions_agree_at_half_a_step() {
    check_functions(&[(cpu(), Filter::Exact)], 0.5);
}

#[test]
fn functions_agree_at_a_whole_step() {
    let mut kernels: Vec<_> = all().into_iter().map(|kernel| (kernel, Filter::Exact)).collect();
    let hardware = kernels.iter().filter(|(kernel, _)| kernel.0 == Backend::Gpu).map(|gpu| (gpu.0, Filter::Hardware));
    kernels.extend(hardware.collect::<Vec<_>>());
    check_functions(&kernels, 1.0);
}

/// The comparison would notice what is easily got wrong: each mistake is far outside the tolerance in some case.
#[test]
fn mistakes_are_noticed() {
    let all = [scenes::oblique(1.0), scenes::steep(1.0), scenes::holed(scenes::oblique(1.0))];
    let scenes = all.map(|scene| scenes::resized(scene, [40, 32]));
    let cases: Vec<_> =
        scenes.iter().flat_map(|scene| cases(scene).into_iter().map(move |case| (scene, case))).collect();
    let rights: Vec<_> = cases.iter().map(|_| OnceCell::new()).collect();
    for mistake in [
        Mistake::FrontOnly,
        Mistake::Swapped,
        Mistake::LastSlab,
        Mistake::OneSided,
        Mistake::FrontLight,
        Mistake::SurfaceFirst,
        Mistake::RoughCuts,
        Mistake::RoughSurfaces,
        Mistake::FacesAreCuts,
        Mistake::LitNoise,
        Mistake::StraightFade,
        Mistake::Between,
        Mistake::CubicVoxels,
        Mistake::FilledHoles,
    ] {
        let noticed = cases.iter().zip(&rights).any(|((scene, case), right)| {
            let right = right.get_or_init(|| render_styled(&scene.truth, &case.truth));
            let wrong = render_styled(&scene.truth, &referee::Style { mistake: Some(mistake), ..case.truth.clone() });
            let bound = tolerance(Backend::Cpu, case.filter);
            let d = compare_where(&right.picture, &wrong.picture, bound.max, |_| true).unwrap();
            d.mean > bound.mean && d.outliers as f64 > 5.0 * bound.outlier_share * d.pixels as f64
        });
        assert!(noticed, "{mistake:?}");
    }
}

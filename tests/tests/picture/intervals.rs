//! Intervals end to end (docs/adr/0016-intervals.md): both pictures lie within them at every pixel, they are the same
//! bits from any number of nodes, and what is too narrow is noticed.

use std::time::Duration;

use brickcast::picture::Picture;
use brickcast::session::Frame;
use brickcast::session::audit::{self, Audit};
use brickcast::session::interval::Intervals;
use brickcast_volume::camera::Orbit;
use brickcast_volume::scene::{Acceleration, Extreme, Filter, Leap, RegionView, Scene, SceneParts, Transport};
use brickcast_volume::store::Store;
use brickcast_volume::style::{Clip, ClipPlane, Integration, Isosurface, Lighting, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use glam::DVec3;

use crate::rig::{Rig, bits, kernels, orbit, phantom, prepared, runtime, scene};

const LEAPS: Acceleration = Acceleration {
    skip_empty: true,
    leap: Leap::Regions,
    macrocell: brickcast_volume::scene::MacrocellEdge::Four,
    leap_tolerance: None,
};

/// A share of the store's range.
fn window(store: &Store, from: f64, to: f64, opacity: f64) -> TransferFunction {
    let (lo, hi) = store.manifest().range;
    TransferFunction::window(lo + from * (hi - lo), lo + to * (hi - lo), opacity, Colormap::Viridis).unwrap()
}

fn looking(store: &Store, azimuth: f64, function: TransferFunction) -> Scene {
    let view = Orbit { azimuth, elevation: 24.0, ..Orbit::default() };
    scene(store, orbit(store, view), function).with(|s| s.quality.acceleration = LEAPS).unwrap()
}

/// What makes a scene one of another style.
type Change = Box<dyn Fn(&mut SceneParts)>;

/// All that intervals are of.
fn changes(store: &Store) -> Vec<(&'static str, Change)> {
    let integral = Style { integration: Integration::Preintegrated(TableSize::N256), ..Style::default() };
    let phong = |lighting| Some(Phong { lighting, ..Phong::default() });
    let (lo, hi) = store.manifest().range;
    // A few voxels of noise: other bricks are still flattened.
    let surfaces = vec![Isosurface { value: lo + 0.98 * (hi - lo), color: [0.9, 0.5, 0.2], opacity: 0.6 }];
    let center = store.manifest().geometry.center_world();
    let clip = Clip { planes: vec![ClipPlane { normal: DVec3::X, offset: center.x }], ..Clip::default() };
    let styled = |style: Style| -> Change { Box::new(move |s| s.look.style = style.clone()) };
    let residual = window(store, 0.1, 0.9, 0.2);
    vec![
        ("sampled", Box::new(|_: &mut SceneParts| ())),
        ("preintegrated", styled(integral.clone())),
        ("interpolated light", styled(Style { shading: phong(Lighting::Interpolated), ..integral.clone() })),
        ("light in the middle", styled(Style { shading: phong(Lighting::Center), ..integral.clone() })),
        ("light where it comes from", styled(Style { shading: phong(Lighting::Centroid), ..integral.clone() })),
        ("lit cut", styled(Style { clip, shading: phong(Lighting::Interpolated), ..integral.clone() })),
        ("surfaces", styled(Style { surfaces, shading: phong(Lighting::Interpolated), ..integral.clone() })),
        (
            "regions of their own",
            Box::new(move |s| {
                (s.look.region_transfer_function, s.look.style) = (Some(residual.clone()), integral.clone());
            }),
        ),
        ("residual", Box::new(|s| s.look.region_view = RegionView::Residual)),
        ("large steps", Box::new(|s| s.quality.step = 1.5)),
    ]
}

struct Proof {
    with: Frame,
    without: Frame,
    intervals: Intervals,
}

impl Proof {
    async fn of(rig: &mut Rig, scene: &Scene) -> Self {
        let (with, without) = (rig.render(scene).await, rig.render(&scene.without_leaping()).await);
        let bounded = rig.session.intervals(scene, Duration::from_secs(300)).await.unwrap();
        Self { with, without, intervals: bounded.intervals.unwrap() }
    }

    fn audit(&self, scene: &Scene, on_gpu: bool) -> Audit {
        let slack = audit::slack(scene, Transport::F32, on_gpu);
        audit::compare(&self.with.picture, &self.without.picture, &self.intervals, slack)
    }
}

#[test]
fn both_pictures_lie_within_at_every_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let input = phantom(folder.path(), "part", [72, 64, 68], 16, 0.2);
    // Small ones, so that an isosurface leaves most of them alone.
    let store = prepared(&input, folder.path(), 16, Some(0.05));
    runtime().block_on(async {
        for (at, kernel) in kernels().into_iter().enumerate() {
            let mut rig = Rig::start(&kernel, &store, 2).await;
            for (name, change) in changes(&store) {
                for (azimuth, early_termination) in [(33.0, 1.0), (200.0, 0.98)] {
                    let scene = looking(&store, azimuth, window(&store, 0.3, 1.0, 0.06));
                    let exact = |s: &mut SceneParts| {
                        (s.quality.filter, s.quality.early_termination) = (Filter::Exact, early_termination);
                        change(s);
                    };
                    let scene = scene.with(exact).unwrap();
                    let proof = Proof::of(&mut rig, &scene).await;
                    let audit = proof.audit(&scene, at > 0);
                    eprintln!("kernel {at}, {name}: {}", audit.in_words());
                    assert_eq!(audit.pixels_outside, 0, "kernel {at}, {name}: {audit:?}");
                    assert!(audit.width.largest < 1.0 && audit.width.mean > 1e-6, "kernel {at}, {name}: {audit:?}");
                }
            }
        }
    });
}

/// An adapter's filter weighs in 1/256: intervals for it are wider, and hold its pictures.
#[test]
fn the_hardware_filters_pictures_lie_within() {
    let folder = tempfile::tempdir().unwrap();
    let input = phantom(folder.path(), "part", [64; 3], 12, 0.2);
    let store = prepared(&input, folder.path(), 32, Some(0.05));
    runtime().block_on(async {
        for (at, kernel) in kernels().into_iter().enumerate() {
            let mut rig = Rig::start(&kernel, &store, 1).await;
            // Steeper than what pictures of both backends are held to.
            let scene = looking(&store, 70.0, window(&store, 0.45, 0.55, 0.3));
            let audit = Proof::of(&mut rig, &scene).await.audit(&scene, at > 0);
            assert_eq!(audit.pixels_outside, 0, "kernel {at}: {audit:?}");
        }
    });
}

/// Exact intervals are the same bits whoever renders what; without, nothing but how layers are joined.
#[test]
fn intervals_depend_on_no_partition() {
    let folder = tempfile::tempdir().unwrap();
    let input = phantom(folder.path(), "part", [80, 72, 76], 16, 0.2);
    let store = prepared(&input, folder.path(), 16, Some(0.05));
    runtime().block_on(async {
        let kernel = kernels().swap_remove(0);
        let look = looking(&store, 33.0, window(&store, 0.3, 1.0, 0.05));
        let lit = Style {
            integration: Integration::Preintegrated(TableSize::N256),
            shading: Some(Phong::default()),
            ..Style::default()
        };
        let scene = look.with(|s| (s.quality.exact, s.look.style) = (true, lit.clone())).unwrap();
        let mut known: Option<[Vec<[u32; 4]>; 2]> = None;
        for count in [1, 2, 4] {
            let mut rig = Rig::start(&kernel, &store, count).await;
            let bounded = rig.session.intervals(&scene, Duration::from_secs(300)).await.unwrap();
            let got = [bits(&bounded.lowest.picture), bits(&bounded.highest.picture)];
            assert!(*known.get_or_insert_with(|| got.clone()) == got, "{count} nodes");
        }
    });
}

/// Intervals narrower by a hundredth of their width about their middle, and pictures of another store, are noticed.
#[test]
fn the_comparison_can_fail() {
    let folder = tempfile::tempdir().unwrap();
    let input = phantom(folder.path(), "part", [64; 3], 12, 0.2);
    let store = prepared(&input, folder.path(), 32, Some(0.2));
    runtime().block_on(async {
        let kernel = kernels().swap_remove(0);
        let mut rig = Rig::start(&kernel, &store, 1).await;
        let scene = looking(&store, 33.0, window(&store, 0.0, 1.0, 0.3));
        let proof = Proof::of(&mut rig, &scene).await;
        assert_eq!(proof.audit(&scene, false).pixels_outside, 0);
        let shrunk = |part: f32| {
            let (mut lo, mut hi) = (Vec::new(), Vec::new());
            for (a, b) in proof.intervals.lo().pixels().iter().zip(proof.intervals.hi().pixels()) {
                let (a, b) = (a.to_array(), b.to_array());
                let end = |from: [f32; 4], to: [f32; 4]| std::array::from_fn(|c| from[c] + (to[c] - from[c]) * part);
                lo.push(brickcast_volume::Premul::from_array(end(a, b)));
                hi.push(brickcast_volume::Premul::from_array(end(b, a)));
            }
            let picture = |pixels| Picture::new(scene.view.size, pixels).unwrap();
            // As frames are: opacities the other way round.
            let cross = |a: &Picture, b: &Picture| {
                let pairs = a.pixels().iter().zip(b.pixels());
                picture(pairs.map(|(a, b)| brickcast_volume::Premul { a: b.a, ..*a }).collect())
            };
            let (lo, hi) = (picture(lo), picture(hi));
            Intervals::new(&cross(&lo, &hi), &cross(&hi, &lo), &scene).unwrap()
        };
        let audit = |intervals: &Intervals| {
            audit::compare(&proof.with.picture, &proof.without.picture, intervals, 1e-4).pixels_outside
        };
        assert_eq!(audit(&shrunk(0.0)), 0);
        assert!(audit(&shrunk(0.45)) > 100, "{} pixels", audit(&shrunk(0.45)));
        // Half an interval is none: frames of the other extreme.
        let highest = scene.extreme(Extreme::Highest).unwrap();
        let frame = rig.render(&highest).await;
        let degenerate = Intervals::new(&frame.picture, &frame.picture, &scene).unwrap();
        assert!(audit(&degenerate) > 100);
    });
}

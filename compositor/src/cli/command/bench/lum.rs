//! `brickcast bench --table lum`: how fast a picture converges with the step, sampled and pre-integrated, or lit in two
//! ways.

use std::time::Duration;

use anyhow::anyhow;
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::store::Store;
use brickcast_volume::style::{Lighting, ShadingKind};
use comfy_table::Table;
use serde::Serialize;
use serde_json::json;

use crate::cli::args::{BenchArgs, IntegrationArg, Unasked};
use crate::cli::failure::Failure;
use crate::cli::progress::Bar;
use crate::cli::say::tell;
use crate::cli::source::Source;
use crate::embedded::{Backend, EmbeddedNodes, parse_size};
use crate::output::write_json;
use crate::picture::Picture;
use crate::plan::StoreFacts;
use crate::session::{Session, StoreChoice};

/// The step that counts as converged, in voxels.
const REFERENCE_STEP: f64 = 1.0 / 64.0;
const STEPS: [f64; 4] = [2.0, 1.0, 0.5, 0.25];
/// Where the second difference of the converged picture is larger, there is an edge.
const SMOOTH: f32 = 1.0 / 255.0;

#[derive(Debug, Clone, Serialize)]
struct Row {
    kind: &'static str,
    step: f64,
    frame_ms: f64,
    samples: u64,
    /// Against the converged picture, premultiplied, over the pixels that are not empty in both.
    rms_error: f64,
    largest_error: f32,
    /// Root mean square over the pixels that count for `banding`.
    smooth_error: f64,
    /// The largest second difference along a scanline where the converged picture is smooth.
    banding: f32,
    /// Times as fast as the first kind at the smallest step.
    speedup: f64,
}

struct Timed {
    kind: &'static str,
    scene: Scene,
    times: Vec<f64>,
    samples: u64,
    picture: Picture,
}

/// # Errors
/// As a render.
pub(super) async fn run(args: &BenchArgs, quiet: bool) -> Result<(), Failure> {
    let budget = parse_size(&args.memory_budget).map_err(|e| Failure::usage(anyhow!(e)))?;
    let opened = Backend::open(args.backend.choice())?;
    let (backend, adapter, _) = opened.describe();
    let regions_for = args.scene.plan(Unasked::Plain)?.shows_regions();
    let prepare = args.prepare.clone().with_regions_for(&args.path, regions_for.as_deref(), quiet)?;
    let Source::Store(store) = prepare.open(&args.path, false)? else {
        return Err(anyhow!("{}: no such store", args.path.display()).into());
    };
    let rows = measure(args, &opened, &store, budget).await?;
    let (w, h) = args.scene.size;
    tell(&format!(
        "{backend}: {adapter}\n{w} x {h}{}, median of {} frames; errors against step 1/64, /255\n{}\n",
        args.scene.quality.samples_in_words(),
        args.repeat,
        table_of(&rows)
    ))?;
    if let Some(path) = &args.json {
        write_json(
            path,
            &json!({
                "brickcast": env!("CARGO_PKG_VERSION"), "table": "lum", "backend": backend, "adapter": adapter,
                "size": [w, h], "pixel_samples": args.scene.quality.samples.count(),
                "repeat": args.repeat, "rows": rows,
            }),
        )?;
    }
    Ok(())
}

/// The scene with its step and its kind changed.
fn scene(
    args: &BenchArgs,
    store: &Store,
    step: f64,
    change: impl Fn(&mut crate::cli::args::StyleArgs),
) -> Result<Scene, Failure> {
    let mut scene_args = args.scene.clone();
    scene_args.step = step;
    change(&mut scene_args.style);
    Ok(scene_args.plan(Unasked::Plain)?.on(&StoreFacts::of(store))?.scene)
}

async fn measure(args: &BenchArgs, opened: &Backend, store: &Store, budget: u64) -> Result<Vec<Row>, Failure> {
    let nodes = EmbeddedNodes::start(opened, 1, &store.path(), budget).await?;
    let mut session = Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash())).await?;
    let limit = Duration::from_secs(3600);
    let is_lit = args.scene.style.shading == Some(ShadingKind::Phong);
    let kinds: Vec<(&'static str, IntegrationArg, Lighting)> = if is_lit {
        vec![
            ("center", IntegrationArg::Preintegrated, Lighting::Center),
            ("interpolated", IntegrationArg::Preintegrated, Lighting::Interpolated),
            ("centroid", IntegrationArg::Preintegrated, Lighting::Centroid),
        ]
    } else {
        vec![
            ("sampled", IntegrationArg::Sampled, Lighting::default()),
            ("preintegrated", IntegrationArg::Preintegrated, Lighting::default()),
        ]
    };
    let of_kind = |(_, integration, lighting): (&str, IntegrationArg, Lighting), step: f64| {
        scene(args, store, step, |style| (style.integration, style.lighting) = (integration, Some(lighting)))
    };
    let bar = Bar::counting("frames", "frames");
    bar.at(0, 1 + (kinds.len() * STEPS.len()) as u64 * u64::from(args.repeat + 1));
    let converged = of_kind(kinds[1], REFERENCE_STEP)?;
    session.load(&converged).await?;
    let converged = session.render(&converged, Transport::F32, limit).await?.picture;
    bar.step();
    let mut timed = Vec::new();
    for kind in kinds {
        for step in STEPS {
            let scene = of_kind(kind, step)?;
            session.load(&scene).await?;
            // The first frame pays for caches and lazy pages: it is not timed.
            let frame = session.render(&scene, Transport::F32, limit).await?;
            if !frame.complete {
                return Err(anyhow!("a frame was not complete: {}", frame.problems.join("; ")).into());
            }
            let (samples, picture) = (frame.stats.samples, frame.picture);
            timed.push(Timed { kind: kind.0, scene, times: Vec::new(), samples, picture });
            bar.step();
        }
    }
    // In turns, so that a machine that slows down slows all of them.
    for _ in 0..args.repeat {
        for one in &mut timed {
            // Nodes keep the tables of the last scenes only: the first of two frames builds them.
            session.render(&one.scene, Transport::F32, limit).await?;
            let frame = session.render(&one.scene, Transport::F32, limit).await?;
            if frame.stats.nodes.iter().any(|n| n.load_ms > 0.0) {
                return Err(anyhow!("bricks were loaded in a timed frame: raise --memory-budget").into());
            }
            one.times.push(frame.stats.frame_ms);
            bar.step();
        }
    }
    let median = |one: &Timed| {
        let mut sorted = one.times.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let base_ms = timed.get(STEPS.len() - 1).map_or(f64::NAN, &median);
    let row = |one: &Timed| {
        let (rms_error, largest_error) = errors(&one.picture, &converged);
        let frame_ms = median(one);
        Row {
            kind: one.kind,
            step: one.scene.quality.step,
            frame_ms,
            samples: one.samples,
            rms_error,
            largest_error,
            smooth_error: smooth_error(&one.picture, &converged),
            banding: banding(&one.picture, &converged),
            speedup: base_ms / frame_ms,
        }
    };
    Ok(timed.iter().map(row).collect())
}

/// Root mean square and largest difference of any channel, over the pixels that are not empty in both.
fn errors(a: &Picture, b: &Picture) -> (f64, f32) {
    let (mut sum, mut count, mut largest) = (0.0, 0_usize, 0.0_f32);
    for (p, q) in a.pixels().iter().zip(b.pixels()).filter(|(p, q)| !(p.is_clear() && q.is_clear())) {
        for (x, y) in p.to_array().into_iter().zip(q.to_array()) {
            sum += f64::from(x - y).powi(2);
            largest = largest.max((x - y).abs());
            count += 1;
        }
    }
    ((sum / count.max(1) as f64).sqrt(), largest)
}

/// The largest second difference of a colour along a scanline of `a`, where that of `converged` is no edge.
fn banding(a: &Picture, converged: &Picture) -> f32 {
    smooth(converged).fold(0.0, |worst, i| worst.max(second(a, i)))
}

/// The second difference of the colours along a scanline.
fn second(picture: &Picture, i: usize) -> f32 {
    let [l, m, r] = [i - 1, i, i + 1].map(|i| picture.pixels()[i].to_array());
    (0..3).fold(0.0, |worst: f32, c| worst.max((l[c] - 2.0 * m[c] + r[c]).abs()))
}

/// Where the converged picture shows something, and no edge.
fn smooth(converged: &Picture) -> impl Iterator<Item = usize> + '_ {
    let width = converged.size().width() as usize;
    (0..converged.pixels().len())
        .filter(move |i| (1..width.saturating_sub(1)).contains(&(i % width)))
        .filter(|&i| !converged.pixels()[i].is_clear() && second(converged, i) <= SMOOTH)
}

fn smooth_error(a: &Picture, converged: &Picture) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for i in smooth(converged) {
        for (x, y) in a.pixels()[i].to_array().into_iter().zip(converged.pixels()[i].to_array()) {
            sum += f64::from(x - y).powi(2);
            count += 1;
        }
    }
    (sum / count.max(1) as f64).sqrt()
}

fn table_of(rows: &[Row]) -> Table {
    let mut table = Table::new();
    table.set_header([
        "kind",
        "step",
        "ms a frame",
        "M samples",
        "RMS error",
        "largest error",
        "error where smooth",
        "banding",
        "speed-up",
    ]);
    for row in rows {
        table.add_row([
            row.kind.to_owned(),
            row.step.to_string(),
            format!("{:.1}", row.frame_ms),
            format!("{:.2}", row.samples as f64 / 1e6),
            format!("{:.3}", row.rms_error * 255.0),
            format!("{:.2}", row.largest_error * 255.0),
            format!("{:.3}", row.smooth_error * 255.0),
            format!("{:.2}", row.banding * 255.0),
            format!("{:.2}", row.speedup),
        ]);
    }
    table
}

//! `brickcast bench --table`: the papers' tables, every acceleration on one view of one volume in one run.

use std::time::Duration;

use anyhow::anyhow;
use brickcast_volume::scene::Scene;
use brickcast_volume::store::Store;
use comfy_table::Table;
use serde::Serialize;
use serde_json::json;

use crate::cli::args::{AccelArg, BenchArgs, TableArg, Unasked};
use crate::cli::failure::Failure;
use crate::cli::progress::Bar;
use crate::cli::say::{say, tell};
use crate::cli::source::Source;
use crate::embedded::{Backend, EmbeddedNodes, parse_size};
use crate::output::write_json;
use crate::picture::Picture;
use crate::plan::StoreFacts;
use crate::session::{Session, StoreChoice};

/// A row's name and its accelerations.
type Mode = (&'static str, &'static [AccelArg]);

const NONE: Mode = ("none", &[AccelArg::None]);
const ERT: Mode = ("ert", &[AccelArg::Ert]);
const ESS: Mode = ("ess", &[AccelArg::Ess]);
const ERT_ESS: Mode = ("ert,ess", &[AccelArg::Ert, AccelArg::Ess]);
const FREY: [Mode; 8] = [
    NONE,
    ERT,
    ESS,
    ERT_ESS,
    ("leap", &[AccelArg::Leap]),
    ("macro", &[AccelArg::Macro]),
    ("all", &[AccelArg::All]),
    ("auto", &[AccelArg::Auto]),
];
const KRUEGER: [Mode; 4] = [NONE, ERT, ESS, ERT_ESS];

/// One acceleration at one segmentation range.
#[derive(Debug, Clone, Serialize)]
struct Row {
    /// Share of the store's range; 0 without regions.
    segmentation_range: f64,
    accel: &'static str,
    frame_ms: f64,
    /// Reads of the volume, probes included.
    samples: u64,
    positions: u64,
    leapt_positions: u64,
    /// Against `none` of the same range, times and reads.
    speedup: f64,
    fewer_samples: f64,
    /// Against the picture of `none`, premultiplied.
    largest_difference: f32,
    mean_difference: f64,
    load_ms: f64,
}

/// # Errors
/// As a render.
pub(super) async fn run(args: &BenchArgs, which: TableArg, quiet: bool) -> Result<(), Failure> {
    let (modes, ranges) = match which {
        TableArg::Frey => (&FREY[..], args.ranges.clone()),
        TableArg::Krueger => (&KRUEGER[..], vec![0.0]),
        TableArg::Lum => return super::lum::run(args, quiet).await,
    };
    // A store has the range that it was prepared with.
    let ranges = if args.path.is_file() { ranges } else { ranges[..1.min(ranges.len())].to_vec() };
    if args.prepare.regions.labels.is_some() {
        return Err(Failure::usage(anyhow!("--table segments anew for every range: leave --labels out")));
    }
    if ranges.is_empty() || ranges.iter().any(|r| !(0.0..=1.0).contains(r)) {
        return Err(Failure::usage(anyhow!("--ranges: every segmentation range must lie between 0 and 1")));
    }
    let budget = parse_size(&args.memory_budget).map_err(|e| Failure::usage(anyhow!(e)))?;
    let opened = Backend::open(args.backend.choice())?;
    let (backend, adapter, notes) = opened.describe();
    for note in notes {
        say(quiet, note)?;
    }
    let mut rows = Vec::new();
    let mut dims = [0; 3];
    for range in ranges {
        let Source::Store(store) = prepared(args, range)? else {
            return Err(anyhow!("{}: no such store", args.path.display()).into());
        };
        dims = store.manifest().geometry.dims().to_array();
        rows.extend(measure(args, &opened, &store, modes, budget).await?);
    }
    let (w, h) = args.scene.size;
    tell(&format!(
        "{backend}: {adapter}\n{w} x {h}{}, step {}, median of {} frames; speed-up and difference against none\n{}\n",
        args.scene.quality.samples_in_words(),
        args.scene.step,
        args.repeat,
        table_of(&rows)
    ))?;
    if let Some(path) = &args.json {
        write_json(
            path,
            &json!({
                "brickcast": env!("CARGO_PKG_VERSION"), "table": format!("{which:?}").to_lowercase(), "dims": dims,
                "backend": backend, "adapter": adapter, "size": [w, h],
                "pixel_samples": args.scene.quality.samples.count(), "step": args.scene.step, "repeat": args.repeat,
                "rows": rows,
            }),
        )?;
    }
    Ok(())
}

/// The store at a segmentation range: an input is prepared for it; a store has its own.
fn prepared(args: &BenchArgs, range: f64) -> Result<Source, Failure> {
    let mut prepare = args.prepare.clone();
    if args.path.is_file() {
        prepare.regions.segmentation_range = (range > 0.0).then_some(range);
    }
    prepare.open(&args.path, false)
}

struct Timed {
    scene: Scene,
    times: Vec<f64>,
    load_ms: f64,
    counts: [u64; 3],
    picture: Option<Picture>,
}

async fn measure(
    args: &BenchArgs,
    opened: &Backend,
    store: &Store,
    modes: &[Mode],
    budget: u64,
) -> Result<Vec<Row>, Failure> {
    let nodes = EmbeddedNodes::start(opened, 1, &store.path(), budget).await?;
    let mut session = Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash())).await?;
    let limit = Duration::from_secs(3600);
    let mut timed = Vec::new();
    let bar = Bar::counting("frames", "frames");
    bar.at(0, modes.len() as u64 * u64::from(args.repeat + 1));
    let mut transport = brickcast_volume::scene::Transport::F16;
    for (_, accel) in modes {
        let mut scene_args = args.scene.clone();
        scene_args.accel.accel = accel.to_vec();
        let choice = scene_args.plan(Unasked::Plain)?.on(&StoreFacts::of(store))?;
        transport = choice.transport;
        let load = session.load(&choice.scene).await?;
        // The first frame pays for caches and lazy pages: it is not timed.
        let frame = session.render(&choice.scene, transport, limit).await?;
        if !(frame.complete && load.fits) {
            let why = "a frame was not complete, or not all bricks fit at once: raise --memory-budget";
            return Err(anyhow!("{why}; {}", frame.problems.join("; ")).into());
        }
        let s = &frame.stats;
        timed.push(Timed {
            scene: choice.scene,
            times: Vec::new(),
            load_ms: load.load_ms,
            counts: [s.samples, s.positions, s.leapt_positions],
            picture: Some(frame.picture),
        });
        bar.step();
    }
    // In turns, so that a machine that slows down slows all of them.
    for _ in 0..args.repeat {
        for one in &mut timed {
            let frame = session.render(&one.scene, transport, limit).await?;
            if !frame.complete {
                return Err(anyhow!("a frame was not complete: {}", frame.problems.join("; ")).into());
            }
            if frame.stats.nodes.iter().any(|n| n.load_ms > 0.0) {
                return Err(anyhow!("bricks were loaded in a timed frame: raise --memory-budget").into());
            }
            one.times.push(frame.stats.frame_ms);
            bar.step();
        }
    }
    let median = |times: &[f64]| {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let Some(base) = timed.first() else { return Ok(Vec::new()) };
    let (base_ms, base_samples) = (median(&base.times), base.counts[0]);
    let range = store.manifest().regions.as_ref().and_then(|r| r.segmentation_range).unwrap_or(0.0);
    let row = |(one, (accel, _)): (&Timed, &Mode)| {
        let frame_ms = median(&one.times);
        let [samples, positions, leapt_positions] = one.counts;
        let (largest_difference, mean_difference) = difference(base.picture.as_ref(), one.picture.as_ref());
        Row {
            segmentation_range: range,
            accel,
            frame_ms,
            samples,
            positions,
            leapt_positions,
            speedup: base_ms / frame_ms,
            fewer_samples: base_samples as f64 / samples.max(1) as f64,
            largest_difference,
            mean_difference,
            load_ms: one.load_ms,
        }
    };
    Ok(timed.iter().zip(modes).map(row).collect())
}

/// Largest and mean difference of any channel.
fn difference(a: Option<&Picture>, b: Option<&Picture>) -> (f32, f64) {
    let (Some(a), Some(b)) = (a, b) else { return (0.0, 0.0) };
    let channels = |p: &Picture| p.pixels().iter().flat_map(|p| p.to_array()).collect::<Vec<_>>();
    let (a, b) = (channels(a), channels(b));
    let each = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
    let largest = each.clone().fold(0.0, f32::max);
    (largest, each.map(f64::from).sum::<f64>() / a.len().max(1) as f64)
}

fn table_of(rows: &[Row]) -> Table {
    let mut table = Table::new();
    table.set_header([
        "range",
        "accel",
        "ms a frame",
        "M samples",
        "M positions",
        "leapt",
        "speed-up",
        "fewer samples",
        "max difference",
        "mean difference",
    ]);
    for row in rows {
        table.add_row([
            format!("{:.0} %", row.segmentation_range * 100.0),
            row.accel.to_owned(),
            format!("{:.1}", row.frame_ms),
            format!("{:.2}", row.samples as f64 / 1e6),
            format!("{:.2}", row.positions as f64 / 1e6),
            format!("{:.0} %", 100.0 * row.leapt_positions as f64 / row.positions.max(1) as f64),
            format!("{:.2}", row.speedup),
            format!("{:.2}", row.fewer_samples),
            format!("{:.1}/255", row.largest_difference * 255.0),
            format!("{:.3}/255", row.mean_difference * 255.0),
        ]);
    }
    table
}

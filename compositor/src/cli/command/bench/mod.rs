//! `brickcast bench`: backends and node counts on one view, as ratios in one run.

mod lum;
mod table;

use anyhow::anyhow;
use brickcast_volume::small_file::system_text;
use brickcast_volume::store::Store;
use comfy_table::Table;
use serde_json::json;

use crate::cli::args::{BenchArgs, Unasked};
use crate::cli::failure::Failure;
use crate::cli::progress::Bar;
use crate::cli::say::{say, tell};
use crate::cli::scene::SceneChoice;
use crate::cli::source::Source;
use crate::embedded::{Backend, BackendChoice, EmbeddedNodes, parse_size};
use crate::output::write_json;
use crate::plan::StoreFacts;
use crate::session::{Session, StoreChoice};
use crate::words::bytes;

struct Row {
    backend: &'static str,
    nodes: usize,
    frame_ms: f64,
    load_ms: f64,
    samples: u64,
    cpu_seconds: f64,
    bytes_received: u64,
}

/// # Errors
/// As a render.
pub async fn run(args: BenchArgs, quiet: bool) -> Result<(), Failure> {
    let plan = args.scene.plan(Unasked::Chosen)?;
    if !(1..=1000).contains(&args.repeat) {
        return Err(Failure::usage(anyhow!("--repeat {}: must lie between 1 and 1000", args.repeat)));
    }
    if args.counts.is_empty() || args.counts.iter().any(|n| !(1..=64).contains(n)) {
        return Err(Failure::usage(anyhow!("--counts: every count must lie between 1 and 64")));
    }
    if let Some(which) = args.table {
        return table::run(&args, which, quiet).await;
    }
    let budget = parse_size(&args.memory_budget).map_err(|e| Failure::usage(anyhow!(e)))?;
    let prepare = args.prepare.clone().with_regions_for(&args.path, plan.shows_regions().as_deref(), quiet)?;
    let Source::Store(store) = prepare.open(&args.path, false)? else {
        return Err(anyhow!("{}: no such store", args.path.display()).into());
    };
    let choice = plan.on(&StoreFacts::of(&store))?;
    for note in &choice.notes {
        say(quiet, note)?;
    }
    let mut rows = Vec::new();
    let mut adapters = Vec::new();
    for backend in [BackendChoice::Gpu, BackendChoice::Cpu] {
        let opened = match Backend::open(backend) {
            Ok(opened) => opened,
            Err(error) => {
                tracing::warn!("left out: {error}");
                continue;
            }
        };
        let (name, adapter, notes) = opened.describe();
        let limits: serde_json::Map<_, _> =
            opened.limits().iter().map(|(name, most)| ((*name).to_owned(), json!(most))).collect();
        adapters.push(json!({ "backend": name, "adapter": adapter, "notes": notes, "limits": limits }));
        let bar = Bar::counting(&format!("frames on {name}"), "frames");
        bar.at(0, args.counts.len() as u64 * u64::from(args.repeat + 1));
        for &nodes in &args.counts {
            rows.push(measure(&args, &opened, &store, &choice, (name, nodes), budget, &bar).await?);
        }
    }
    report(&args, &store, &rows, &adapters)
}

async fn measure(
    args: &BenchArgs,
    opened: &Backend,
    store: &Store,
    choice: &SceneChoice,
    (backend, count): (&'static str, usize),
    budget: u64,
    bar: &Bar,
) -> Result<Row, Failure> {
    let nodes = EmbeddedNodes::start(opened, count, &store.path(), budget).await?;
    let mut session = Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(store.hash())).await?;
    let load = session.load(&choice.scene).await?;
    let limit = std::time::Duration::from_secs(3600);
    // The first frame pays for caches and lazy pages: it is not timed.
    session.render(&choice.scene, choice.transport, limit).await?;
    bar.step();
    let mut times = Vec::new();
    let (mut samples, mut received) = (0, 0);
    let cpu = cpu_seconds();
    for _ in 0..args.repeat {
        let frame = session.render(&choice.scene, choice.transport, limit).await?;
        if !frame.complete {
            return Err(anyhow!("a frame was not complete: {}", frame.problems.join("; ")).into());
        }
        times.push(frame.stats.frame_ms);
        bar.step();
        (samples, received) = (frame.stats.samples, frame.stats.bytes_received);
    }
    let cpu_seconds = (cpu_seconds() - cpu) / f64::from(args.repeat);
    times.sort_by(f64::total_cmp);
    let frame_ms = times[times.len() / 2];
    Ok(Row { backend, nodes: count, frame_ms, load_ms: load.load_ms, samples, cpu_seconds, bytes_received: received })
}

fn report(args: &BenchArgs, store: &Store, rows: &[Row], adapters: &[serde_json::Value]) -> Result<(), Failure> {
    let Some(base) = rows.first() else { return Err(anyhow!("no backend could be opened").into()) };
    let mut table = Table::new();
    table.set_header([
        "backend",
        "nodes",
        "ms a frame",
        "M samples/s",
        "M samples/s/core",
        "ratio",
        "load ms",
        "received",
    ]);
    let mut list = Vec::new();
    for row in rows {
        let rate = row.samples as f64 / row.frame_ms / 1e3;
        let per_core = row.samples as f64 / row.cpu_seconds.max(1e-9) / 1e6;
        let ratio = base.frame_ms / row.frame_ms;
        table.add_row([
            row.backend.to_owned(),
            row.nodes.to_string(),
            format!("{:.1}", row.frame_ms),
            format!("{rate:.1}"),
            format!("{per_core:.1}"),
            format!("{ratio:.2}"),
            format!("{:.0}", row.load_ms),
            bytes(row.bytes_received),
        ]);
        list.push(json!({
            "backend": row.backend, "nodes": row.nodes, "frame_ms": row.frame_ms, "samples": row.samples,
            "samples_per_second": rate * 1e6, "samples_per_cpu_second": per_core * 1e6, "ratio": ratio,
            "load_ms": row.load_ms, "bytes_received": row.bytes_received,
        }));
    }
    let (w, h) = args.scene.size;
    tell(&format!(
        "{w} x {h}{}, step {}, median of {} frames; ratio: {} with {} node = 1\n{table}\n",
        args.scene.quality.samples_in_words(),
        args.scene.step,
        args.repeat,
        base.backend,
        base.nodes
    ))?;
    if let Some(path) = &args.json {
        let d = store.manifest().geometry.dims();
        write_json(
            path,
            &json!({
                "brickcast": env!("CARGO_PKG_VERSION"), "store": store.hash().to_string(), "dims": [d.x, d.y, d.z],
                "size": [w, h], "pixel_samples": args.scene.quality.samples.count(),
                "step": args.scene.step, "repeat": args.repeat, "adapters": adapters, "rows": list,
            }),
        )?;
    }
    Ok(())
}

/// CPU time of this process and its threads, seconds; 0 where the system does not say.
fn cpu_seconds() -> f64 {
    // Fields 14 and 15 of /proc/self/stat, in ticks of 1/100 s; the process's name (field 2) may hold spaces.
    let read = || {
        let text = system_text("/proc/self/stat")?;
        let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
        Some((fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?) / 100.0)
    };
    read().unwrap_or(0.0)
}

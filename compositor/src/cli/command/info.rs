//! `brickcast info`: what an input or a store holds, in the file's own units.

use brickcast_volume::regions::code::MAX_DENSITY;
use brickcast_volume::shown::shown;
use brickcast_volume::store::{Manifest, QUANTILES, Series, StepEntry, Store};
use brickcast_volume::transfer_function::default_opacities;
use brickcast_volume::{Geometry, MergeTree};
use serde_json::{Value, json};

use crate::cli::args::InfoArgs;
use crate::cli::failure::Failure;
use crate::cli::say::{print, region_words, tell};
use crate::cli::source::{Surveyed, surveyed};

/// # Errors
/// Neither an input nor a store; what the reader finds wrong.
pub fn run(args: &InfoArgs) -> Result<(), Failure> {
    let Surveyed { manifest, source_of, store, view, series } = surveyed(&args.path, &args.raw)?;
    if let Some((_, error)) = store.as_ref().and_then(Store::lacking) {
        tracing::warn!("{error}; `brickcast verify` names all that is broken");
    }
    let mut value = describe(&manifest, store.as_ref());
    value["source_of"] = source_of.iter().map(|(fact, by)| ((*fact).to_owned(), json!(by.name()))).collect();
    if let Some(view) = view {
        value["store"]["view_of"] = json!(view);
    }
    if let Some(series) = &series {
        value["kind"] = json!("series");
        value["series"] = describe_series(series);
    }
    if args.json {
        print(&format!("{value:#}\n"))
    } else {
        tell(&text(&shown(&args.path.display().to_string()), &manifest, &value))
    }
}

/// Facts by who says them: `tags: dims, type; default: spacing, origin`.
fn said_by(source_of: &Value) -> Option<String> {
    let mut by: Vec<(&str, Vec<&str>)> = Vec::new();
    for (fact, source) in source_of.as_object()? {
        let source = source.as_str()?;
        match by.iter_mut().find(|(known, _)| *known == source) {
            Some((_, facts)) => facts.push(fact),
            None => by.push((source, vec![fact])),
        }
    }
    let by: Vec<String> = by.iter().map(|(source, facts)| format!("{source}: {}", facts.join(", "))).collect();
    Some(by.join("; "))
}

fn describe(m: &Manifest, store: Option<&Store>) -> Value {
    let g = &m.geometry;
    let quantiles: serde_json::Map<String, Value> =
        QUANTILES.iter().zip(m.quantiles).map(|(share, value)| (share.to_string(), json!(value))).collect();
    let mut out = json!({
        "kind": if store.is_some() { "store" } else { "input" },
        "format": m.source.format,
        "dims": g.dims().to_array(),
        "spacing": g.spacing().to_array(),
        "origin": g.origin().to_array(),
        "directions": g.directions().to_cols_array_2d(),
        "mirrored": g.is_mirrored(),
        "bounds": bounds(g),
        "center": g.center_world().to_array(),
        "suggested": { "window": window(m), "isosurface": m.otsu },
        "unit": m.space_unit,
        "type": m.source.voxel_type.name(),
        "voxels": g.voxel_count(),
        "range": [m.data_range.0, m.data_range.1],
        "min": m.min,
        "max": m.max,
        "mean": m.mean,
        "otsu": m.otsu,
        "quantiles": quantiles,
        "histogram": m.histogram,
        "not_finite": {
            "nan": m.not_finite.nan,
            "negative_infinity": m.not_finite.negative_infinity,
            "positive_infinity": m.not_finite.positive_infinity,
        },
        "notes": m.notes,
    });
    if let Some(no_data) = &m.no_data {
        out["no_data"] = json!({ "voxels": no_data.voxels, "nan": m.not_finite.nan, "fill": no_data.fill });
    }
    if let Some(store) = store {
        let tree = MergeTree::of(m.grid);
        out["store"] = json!({
            "hash": store.hash().to_string(),
            "writer": m.writer,
            "lossless": m.lossless,
            "scale": m.scale,
            "offset": m.offset,
            "brick_size": m.grid.brick_size(),
            "bricks": m.grid.brick_count(),
            "chunks": tree.chunk_count(),
            "bricks_per_chunk_edge": tree.chunk_bricks(),
        });
    }
    if let Some(store) = store {
        out["levels"] = json!(levels(store));
    }
    if let Some(r) = &m.regions {
        let table = store.and_then(Store::region_table);
        let deviation = table.map(|t| t.0.iter().map(|r| r.deviation()).max().unwrap_or(0));
        out["regions"] = json!({
            "method": r.method.name(),
            "segmentation_range": r.segmentation_range,
            "min_region": r.min_region,
            "min_region_asked": r.min_region_asked,
            "count": r.count,
            "voxels": r.voxels,
            "share": r.voxels as f64 / g.voxel_count() as f64,
            "largest": r.largest,
            "leap_voxels": r.leap_voxels,
            "largest_deviation": deviation.map(|d| (m.range.1 - m.range.0) * f64::from(d) / f64::from(MAX_DENSITY)),
        });
    }
    out
}

fn describe_series(series: &Series) -> Value {
    let m = series.manifest();
    let step = |(i, step): (usize, &StepEntry)| {
        let hash = step.hash.to_string();
        json!({ "step": i, "path": i.to_string(), "hash": hash, "time": step.time })
    };
    json!({
        "hash": series.hash().to_string(),
        "time_unit": m.time_unit,
        "steps": m.steps.iter().enumerate().map(step).collect::<Vec<_>>(),
    })
}

/// The steps of a series and their times, some of many.
fn steps(series: &serde_json::Map<String, Value>) -> Vec<String> {
    const SHOWN: usize = 8;
    let all = series["steps"].as_array().map(Vec::as_slice).unwrap_or_default();
    let hash = series["hash"].as_str().unwrap_or_default();
    let mut lines = vec![format!("  series     {} steps, {hash}; the store told of here is step 0", all.len())];
    let times: Vec<String> = all.iter().filter_map(|step| step["time"].as_f64()).map(|t| t.to_string()).collect();
    if let (Some(last), unit) = (times.last(), series["time_unit"].as_str().unwrap_or_default()) {
        let some = match times.len() {
            n if n > SHOWN => format!("{}, ... {last}", times[..SHOWN - 1].join(", ")),
            _ => times.join(", "),
        };
        lines.push(format!("  times      {some} {}", shown(unit)).trim_end().to_owned());
    }
    lines
}

/// Voxels per axis of every level, the finest first.
fn levels(store: &Store) -> Vec<[u32; 3]> {
    let of = |level| Some(store.level(level)?.manifest().geometry.dims().to_array());
    (0..store.level_count()).filter_map(of).collect()
}

/// Where the default transfer function rises.
fn window(m: &Manifest) -> [f64; 2] {
    let ramp = default_opacities(m.otsu, m.quantile_999);
    [ramp[0].x, ramp[1].x]
}

/// The box along x, y, z around the volume, in the order of `--clip`.
fn bounds(g: &Geometry) -> [f64; 6] {
    let (lo, hi) = g.bounds_world();
    [lo.x, hi.x, lo.y, hi.y, lo.z, hi.z]
}

fn text(path: &str, m: &Manifest, value: &Value) -> String {
    let g = &m.geometry;
    let (d, s, o) = (g.dims(), g.spacing(), g.origin());
    let unit = shown(m.space_unit.as_deref().unwrap_or("units"));
    let mut lines = vec![
        format!("{path}: {} {}", m.source.format, if value["store"].is_null() { "" } else { "as a brick store" })
            .trim_end()
            .to_owned(),
        format!(
            "  dims       {} x {} x {} = {} voxels of {}",
            d.x,
            d.y,
            d.z,
            g.voxel_count(),
            m.source.voxel_type.name()
        ),
        format!("  spacing    {} x {} x {} {unit}, origin {}, {}, {}", s.x, s.y, s.z, o.x, o.y, o.z),
    ];
    if !g.is_straight() {
        let axes = g.directions().to_cols_array_2d().map(|[x, y, z]| format!("({x},{y},{z})"));
        lines.push(format!("  directions {}{}", axes.join(" "), if g.is_mirrored() { ", mirrored" } else { "" }));
    }
    let ([x0, x1, y0, y1, z0, z1], c) = (bounds(g), g.center_world());
    lines.push(format!("  box        {x0},{y0},{z0} to {x1},{y1},{z1} {unit}, centre {},{},{}", c.x, c.y, c.z));
    if value["store"].is_null() {
        lines.extend(said_by(&value["source_of"]).map(|by| format!("  from       {by}")));
    }
    lines.extend([
        format!("  values     {} to {}, mean {:.6}", m.min, m.max, m.mean),
        format!(
            "  range      {} to {} (codes {} and 65535)",
            m.data_range.0,
            m.data_range.1,
            u32::from(m.no_data.is_some())
        ),
        format!("  Otsu       {}", m.otsu),
    ]);
    let quantiles: Vec<String> =
        QUANTILES.iter().zip(m.quantiles).map(|(share, v)| format!("{} %: {v}", share * 100.0)).collect();
    lines.push(format!("  quantiles  {}", quantiles.join(", ")));
    if let Some(no_data) = &m.no_data {
        lines.push(format!("  no data    {}", no_data.words(m.not_finite.nan)));
    }
    if m.not_finite.total() > 0 {
        let n = &m.not_finite;
        lines.push(format!("  not finite {} NaN, {} -Inf, {} +Inf", n.nan, n.negative_infinity, n.positive_infinity));
    }
    if let Some(store) = value["store"].as_object() {
        lines.push(format!(
            "  bricks     {} of {}^3 voxels, {} chunks of {}^3 bricks",
            store["bricks"], store["brick_size"], store["chunks"], store["bricks_per_chunk_edge"]
        ));
        let how = if m.lossless { "exact" } else { "mapped to 16 bits" };
        lines.push(format!("  store      {} ({how}, {})", store["hash"].as_str().unwrap_or_default(), m.writer));
        if let Some(array) = store.get("view_of").and_then(Value::as_str) {
            lines.push(format!("  voxels     stay where they lie: it is a view of {}", shown(array)));
        }
    }
    if let Some(series) = value["series"].as_object() {
        lines.extend(steps(series));
    }
    if let Some(levels) = value["levels"].as_array() {
        let dims = levels.iter().filter_map(Value::as_array).map(|dims| words(dims)).collect::<Vec<_>>();
        lines.push(format!("  levels     {}: {}", dims.len(), dims.join(", ")));
    }
    if let Some(regions) = &m.regions {
        lines.push(format!("  regions    {}", region_words(regions, g.voxel_count()).replacen(" regions", "", 1)));
    }
    let [lo, hi] = window(m);
    lines.extend([
        format!("  try        --window {lo},{hi}, or --isosurface otsu (at {})", m.otsu),
        "             --up z where z points up, as in a patient (the default is y)".to_owned(),
    ]);
    for note in value["notes"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        lines.push(format!("  note       {}", shown(note)));
    }
    lines.push(format!("  histogram  {} to {}, logarithmic", m.data_range.0, m.data_range.1));
    lines.extend(chart(&m.histogram));
    lines.join("\n") + "\n"
}

/// Voxels per axis.
fn words(dims: &[Value]) -> String {
    dims.iter().map(Value::to_string).collect::<Vec<_>>().join(" x ")
}

/// The histogram as rows of characters, heights logarithmic.
fn chart(histogram: &[u64]) -> Vec<String> {
    const COLUMNS: usize = 64;
    const ROWS: usize = 6;
    const BLOCKS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let per = histogram.len().div_ceil(COLUMNS).max(1);
    let heights: Vec<f64> = histogram.chunks(per).map(|c| (c.iter().sum::<u64>() as f64).ln_1p()).collect();
    let top = heights.iter().copied().fold(1e-9, f64::max);
    (0..ROWS)
        .rev()
        .map(|row| {
            let cells = heights.iter().map(|h| {
                let eighths = (h / top * (ROWS * 8) as f64).round() as usize;
                BLOCKS[eighths.saturating_sub(row * 8).min(8)]
            });
            format!("    {}", cells.collect::<String>().trim_end())
        })
        .collect()
}

//! `brickcast balance --simulate`: every strategy on a modelled cluster, as a table.

use std::path::Path;

use comfy_table::Table;

use crate::balance::simulate::{Outcome, Recovery, Row, Spec, simulate};
use crate::cli::failure::Failure;
use crate::cli::progress::Bar;
use crate::cli::say::{say, tell};
use crate::output::write_json;
use crate::words::bytes;

/// # Errors
/// Usage: a specification that cannot be. The JSON file cannot be written.
pub(super) fn run(specification: &str, json: Option<&Path>, quiet: bool) -> Result<(), Failure> {
    let spec: Spec = specification.parse().map_err(|error| Failure::usage(anyhow::Error::new(error)))?;
    let bar = Bar::new("views");
    let outcome = simulate(&spec, &mut |done, total| bar.at(done, total));
    bar.finish();
    tell(&text(&outcome))?;
    if let Some(path) = json {
        write_json(path, &serde_json::json!({ "brickcast": env!("CARGO_PKG_VERSION"), "simulation": outcome }))?;
        say(quiet, &format!("wrote {}", path.display()))?;
    }
    Ok(())
}

fn text(outcome: &Outcome) -> String {
    let [x, y, z] = outcome.dims;
    let Spec { nodes, views, size, .. } = outcome.spec;
    let head = format!(
        "{nodes} nodes with memory for {}, {x} x {y} x {z} chunks ({} show something), {views} views of {size} x \
         {size} pixels\nmax/mean: largest load over the mean of the present nodes, without the first {} views; total: \
         time of all these views over that of even nodes; as usual: max/mean at most 1.10, or the strategy's mean\n",
        bytes(outcome.budget),
        outcome.shown,
        outcome.warm_up,
    );
    let mut table = Table::new();
    table.set_header([
        "strategy",
        "max/mean",
        "worst",
        "total",
        "with warm-up",
        "worst",
        "layers",
        "a frame",
        "handovers",
        "loaded",
    ]);
    table.add_rows(outcome.rows.iter().map(cells));
    let recoveries: String = outcome.rows.iter().flat_map(|r| r.recoveries.iter().map(|e| recovered(r, e))).collect();
    format!("{head}{table}\n{recoveries}")
}

fn cells(row: &Row) -> [String; 10] {
    [
        row.strategy.to_owned(),
        format!("{:.2}", row.mean),
        format!("{:.2}", row.worst),
        format!("{:.2}", row.overall),
        format!("{:.2}", row.mean_with_warm_up),
        format!("{:.2}", row.worst_with_warm_up),
        format!("{:.0}", row.layers),
        bytes(row.bytes as u64),
        row.handovers.to_string(),
        bytes(row.bytes_loaded),
    ]
}

fn recovered(row: &Row, event: &Recovery) -> String {
    let words = match (event.views, event.peak) {
        (Some(views), Some(peak)) => format!("as usual after {views} views, until then at most {peak:.2}"),
        (Some(_), None) => "as usual at once".to_owned(),
        (None, peak) => format!("not as usual again; at most {:.2}", peak.unwrap_or(1.0)),
    };
    format!("{}: {} before view {}: {words}\n", row.strategy, event.event, event.view)
}

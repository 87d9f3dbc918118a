//! `brickcast nodes`

use brickcast_proto::{NodeDescription, StoreName, Throttle};
use brickcast_volume::shown::shown;
use comfy_table::Table;
use serde_json::json;

use crate::cli::args::NodesArgs;
use crate::cli::failure::Failure;
use crate::cli::say::{print, tell};
use crate::cluster::{CallError, NodeList};
use crate::words::bytes;

/// Asks every node; those that do not answer are listed with the reason, and make the command fail.
///
/// # Errors
/// Usage: no nodes are named. A node that did not answer.
pub async fn run(args: NodesArgs) -> Result<(), Failure> {
    let mut list = NodeList::parse(&args.nodes).map_err(Failure::usage)?;
    if list.is_empty() {
        return Err(Failure::usage(anyhow::anyhow!(
            "no nodes are named: give --nodes HOST:PORT,..., BRICKCAST_NODES, or `nodes` in the configuration file"
        )));
    }
    let (targets, problems) = list.resolve().await;
    let dial = args.access.dial()?;
    let answers = futures_util::future::join_all(targets.iter().map(async |target| {
        let mut node = dial.connect(target.clone()).await?;
        node.describe().await
    }))
    .await;
    let mut failed: Vec<String> = problems.iter().map(ToString::to_string).collect();
    failed.extend(answers.iter().filter_map(|a: &Result<_, CallError>| a.as_ref().err().map(ToString::to_string)));
    let named = targets.iter().map(|t| &t.address).zip(&answers);
    if args.json {
        let list: Vec<_> = named
            .map(|(address, answer)| match answer {
                Err(error) => json!({ "address": address, "state": "unreachable", "error": error.to_string() }),
                Ok(n) => json!({
                    "address": address, "node_id": n.node_id, "state": n.state.as_str(), "version": n.version,
                    "protocol": n.protocol, "backend": n.backend, "adapter": n.adapter, "threads": n.threads,
                    "throttle": n.throttle.get(),
                    "memory_budget": n.memory_budget, "memory_used": n.memory_used,
                    "resident_bricks": n.resident_bricks, "max_resident_set": n.max_resident_set, "notes": n.notes,
                    "stores": n.stores.iter()
                        .map(|s| json!({ "name": s.name, "hash": s.hash.to_string() }))
                        .collect::<Vec<_>>(),
                }),
            })
            .collect();
        print(&format!("{:#}\n", json!(list)))?;
    } else {
        let mut table = Table::new();
        table.set_header(["node", "state", "backend", "adapter", "memory", "bricks", "stores", "version"]);
        for (address, answer) in named {
            match answer {
                Err(_) => table.add_row([&*shown(address), "unreachable", "", "", "", "", "", ""]),
                Ok(n) => table.add_row([
                    shown(address).into_owned(),
                    n.state.as_str().to_owned(),
                    backend(n),
                    shown(&n.adapter).into_owned(),
                    format!("{} of {}", bytes(n.memory_used), bytes(n.memory_budget)),
                    n.resident_bricks.to_string(),
                    shown(&store_names(&n.stores)).into_owned(),
                    format!("{} (protocol {})", n.version, n.protocol),
                ]),
            };
        }
        tell(&format!("{table}\n"))?;
    }
    if failed.is_empty() { Ok(()) } else { Err(anyhow::anyhow!(failed.join("; ")).into()) }
}

/// With its throttle, if it has one.
fn backend(node: &NodeDescription) -> String {
    let throttle = (node.throttle > Throttle::NONE).then(|| format!(" (throttle {})", node.throttle.get()));
    [&node.backend, throttle.as_deref().unwrap_or_default()].concat()
}

/// The first few names; `--json` has them all.
fn store_names(stores: &[StoreName]) -> String {
    const SHOWN: usize = 4;
    let more = (stores.len() > SHOWN).then(|| format!("and {} more", stores.len() - SHOWN));
    stores.iter().take(SHOWN).map(|s| s.name.clone()).chain(more).collect::<Vec<_>>().join(", ")
}

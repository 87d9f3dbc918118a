//! `brickcast nodes`

use std::time::Duration;

use brickcast_proto::certificate::{DAY, Moment};
use brickcast_proto::{NodeDescription, NodeLife, StoreName, Throttle};
use brickcast_volume::shown::shown;
use comfy_table::Table;
use serde_json::{Value, json};

use crate::cli::args::NodesArgs;
use crate::cli::failure::Failure;
use crate::cli::say::{print, tell};
use crate::cluster::{CallError, NodeList};
use crate::words::bytes;

type Answer = Result<NodeDescription, CallError>;

const HEADER: [&str; 11] =
    ["node", "state", "backend", "adapter", "memory", "bricks", "frames", "uptime", "certificate", "stores", "version"];

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
    failed.extend(answers.iter().filter_map(|a: &Answer| a.as_ref().err().map(ToString::to_string)));
    let named = targets.iter().map(|target| target.address.as_str()).zip(&answers);
    let now = Moment::now();
    if args.json {
        let list: Vec<Value> = named.map(|(address, answer)| object(address, answer, now)).collect();
        print(&format!("{:#}\n", json!(list)))?;
    } else {
        let mut table = Table::new();
        table.set_header(HEADER);
        for (address, answer) in named.clone() {
            table.add_row(row(address, answer, now));
        }
        let errors: Vec<String> = named.filter_map(|(address, answer)| last_error(address, answer)).collect();
        tell(&format!("{table}\n{}", errors.concat()))?;
    }
    if failed.is_empty() { Ok(()) } else { Err(anyhow::anyhow!(failed.join("; ")).into()) }
}

/// For programs. What a node does not tell is null.
fn object(address: &str, answer: &Answer, now: Moment) -> Value {
    let node = match answer {
        Ok(node) => node,
        Err(error) => {
            let (reason, error) = (error.in_brief(), error.to_string());
            return json!({ "address": address, "state": "unreachable", "reason": reason, "error": error });
        }
    };
    let NodeLife { uptime, frames, last_error, certificate_ends, commit } = &node.life;
    let stores = node.stores.iter().map(|s| json!({ "name": s.name, "hash": s.hash.to_string() }));
    json!({
        "address": address, "node_id": node.node_id, "state": node.state.as_str(), "version": node.version,
        "protocol": node.protocol, "backend": node.backend, "adapter": node.adapter, "threads": node.threads,
        "throttle": node.throttle.get(),
        "memory_budget": node.memory_budget, "memory_used": node.memory_used,
        "resident_bricks": node.resident_bricks, "max_resident_set": node.max_resident_set, "notes": node.notes,
        "stores": stores.collect::<Vec<_>>(),
        "uptime_s": uptime, "frames": frames,
        "last_error": last_error.as_ref().map(|error| &error.message),
        "last_error_s": last_error.as_ref().and_then(|error| error.age),
        "certificate_days": certificate_ends.map(|ends| days(ends, now)),
        "commit": Some(commit).filter(|commit| !commit.is_empty()),
    })
}

/// For people.
fn row(address: &str, answer: &Answer, now: Moment) -> [String; HEADER.len()] {
    let address = shown(address).into_owned();
    let node = match answer {
        Ok(node) => node,
        Err(error) => {
            let mut row = [const { String::new() }; HEADER.len()];
            (row[0], row[1]) = (address, shown(&error.in_brief()).into_owned());
            return row;
        }
    };
    let life = &node.life;
    [
        address,
        node.state.as_str().to_owned(),
        backend(node),
        shown(&node.adapter).into_owned(),
        format!("{} of {}", bytes(node.memory_used), bytes(node.memory_budget)),
        node.resident_bricks.to_string(),
        life.frames.map_or_else(String::new, |frames| frames.to_string()),
        life.uptime.map_or_else(String::new, for_people),
        life.certificate_ends.map_or_else(String::new, |ends| match days(ends, now) {
            ..=-1 => "ended".to_owned(),
            1 => "1 day".to_owned(),
            days => format!("{days} days"),
        }),
        shown(&store_names(&node.stores)).into_owned(),
        format!("{} (protocol {})", node.version, node.protocol),
    ]
}

/// A line below the table.
fn last_error(address: &str, answer: &Answer) -> Option<String> {
    let error = answer.as_ref().ok()?.life.last_error.as_ref()?;
    let ago = error.age.map_or_else(String::new, |age| format!(", {} ago", for_people(age)));
    Some(format!("{}: last error{ago}: {}\n", shown(address), shown(&error.message)))
}

/// Whole days that are left; less than none where it has ended.
fn days(ends: i64, now: Moment) -> i64 {
    ends.saturating_sub(now.0).div_euclid(DAY)
}

/// A time in its two largest units.
fn for_people(seconds: f64) -> String {
    // Beyond what a duration holds, nobody counts.
    let whole = Duration::from_secs(seconds.clamp(0.0, 1e12) as u64);
    humantime::format_duration(whole).to_string().split(' ').take(2).collect::<Vec<_>>().join(" ")
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

#[cfg(test)]
mod tests {
    use brickcast_proto::{LastError, NodeState};

    use super::*;

    fn node(life: NodeLife) -> NodeDescription {
        NodeDescription {
            node_id: "n".to_owned(),
            version: "0.1.0".to_owned(),
            protocol: 7,
            backend: "cpu".to_owned(),
            adapter: "a processor".to_owned(),
            memory_budget: 1 << 30,
            memory_used: 0,
            resident_bricks: 0,
            state: NodeState::Serving,
            stores: Vec::new(),
            notes: Vec::new(),
            threads: 1,
            max_resident_set: 0,
            throttle: Throttle::NONE,
            life,
        }
    }

    #[test]
    fn what_a_node_tells_of_its_life_is_listed() {
        let now = Moment(1_800_000_000);
        let last_error = Some(LastError { message: "a disk\x1b[2J".to_owned(), age: Some(75.0) });
        let life = NodeLife {
            uptime: Some(93_784.9),
            frames: Some(12),
            last_error,
            certificate_ends: Some(now.0 + 29 * DAY + 5),
            commit: "0123456 of 2026-11-30".to_owned(),
        };
        let told = Ok(node(life));
        let row = row("a:1", &told, now);
        assert_eq!(row[6..9], ["12", "1day 2h", "29 days"].map(str::to_owned));
        assert_eq!(last_error_of(&told), "a:1: last error, 1m 15s ago: a disk\\u{1b}[2J\n");
        let object = object("a:1", &told, now);
        assert_eq!((&object["frames"], &object["certificate_days"]), (&json!(12), &json!(29)));
        assert_eq!((&object["last_error_s"], &object["uptime_s"]), (&json!(75.0), &json!(93_784.9)));
        assert_eq!((&object["last_error"], &object["throttle"]), (&json!("a disk\x1b[2J"), &json!(1.0)));
    }

    fn last_error_of(answer: &Answer) -> String {
        last_error("a:1", answer).unwrap_or_default()
    }

    /// Of a node of an older build of this protocol.
    #[test]
    fn what_is_not_told_is_left_empty() {
        let silent = Ok(node(NodeLife::default()));
        assert_eq!(row("a:1", &silent, Moment(0))[6..9], [const { String::new() }; 3]);
        assert_eq!(last_error_of(&silent), "");
        let object = object("a:1", &silent, Moment(0));
        assert!(
            ["uptime_s", "frames", "last_error", "certificate_days", "commit"].iter().all(|key| object[key].is_null())
        );
    }

    #[test]
    fn a_certificate_that_has_ended_is_told_as_such() {
        assert_eq!((days(5, Moment(0)), days(-1, Moment(0)), days(DAY, Moment(0))), (0, -1, 1));
        let ended = Ok(node(NodeLife { certificate_ends: Some(9), ..NodeLife::default() }));
        assert_eq!(row("a:1", &ended, Moment(10))[8], "ended");
    }
}

//! `brickcast config`: what holds, and where it came from.

use brickcast_proto::credentials::token_file;
use comfy_table::Table;
use serde_json::{Value, json};

use crate::cli::args::ConfigArgs;
use crate::cli::failure::Failure;
use crate::cli::invocation::{Origin, Origins};
use crate::cli::say::{print, tell};
use crate::cluster::LOAD_DEADLINE;

/// One value that holds.
struct Setting {
    key: &'static str,
    value: Value,
    origin: Origin,
    /// What should be known of it.
    note: &'static str,
}

/// Paths are shown; what is in the files, never.
///
/// # Errors
/// stdout cannot be written.
pub fn run(args: &ConfigArgs, origins: &Origins) -> Result<(), Failure> {
    let settings = settings(args, origins);
    let file = origins.file.as_ref().map(|path| path.display().to_string());
    if args.json {
        let list: serde_json::Map<_, _> = settings
            .iter()
            .map(|s| {
                let from = (s.origin != Origin::Default).then(|| s.origin.in_words(s.key));
                (s.key.to_owned(), json!({ "value": s.value, "source": s.origin.kind(), "from": from, "note": s.note }))
            })
            .collect();
        return print(&format!("{:#}\n", json!({ "file": file, "settings": list })));
    }
    let mut table = Table::new();
    table.set_header(["setting", "value", "from", ""]);
    for s in &settings {
        table.add_row([s.key.to_owned(), words(&s.value), s.origin.in_words(s.key), s.note.to_owned()]);
    }
    let file = file.unwrap_or_else(|| "none".to_owned());
    tell(&format!("configuration file: {file}\n{table}\n"))
}

fn settings(args: &ConfigArgs, origins: &Origins) -> Vec<Setting> {
    let nodes = &args.nodes;
    let elsewhere = !nodes.nodes.is_empty();
    let (only_inside, only_elsewhere) = match elsewhere {
        true => ("not used: nodes run elsewhere", ""),
        false => ("", "not used: nodes run inside this process"),
    };
    let path = |path: &std::path::Path| json!(path.display().to_string());
    let tls = nodes.access.tls.as_deref();
    let token = token_file(nodes.access.token_file.as_deref(), tls);
    let token_note = if nodes.access.token_file.is_none() && token.is_some() { "in the folder of tls" } else { "" };
    let given = |key| origins.get(key);
    // Where the environment or the file names nodes and there are none, `--local` has ruled them out.
    let ruled_out = !elsewhere && matches!(given("local"), Origin::Flag(_));
    let nodes_from = given(if ruled_out { "local" } else { "nodes" });
    let backend = format!("{:?}", nodes.backend).to_lowercase();
    let deadline = humantime::format_duration(nodes.deadline).to_string();
    let load_deadline = nodes.access.load_deadline.unwrap_or(LOAD_DEADLINE);
    let load_deadline = humantime::format_duration(load_deadline).to_string();
    let setting = |key, value, note| Setting { key, value, origin: given(key), note };
    let note = |more: &'static str| if more.is_empty() || !elsewhere { only_elsewhere } else { more };
    vec![
        Setting {
            key: "nodes",
            value: json!(nodes.nodes),
            origin: nodes_from,
            note: if elsewhere { "" } else { "inside this process" },
        },
        setting("tls", tls.map_or(Value::Null, path), only_elsewhere),
        setting("token_file", token.as_deref().map_or(Value::Null, path), note(token_note)),
        setting("local", json!(nodes.local.unwrap_or(1)), only_inside),
        setting("backend", json!(backend), only_inside),
        setting("memory_budget", json!(nodes.memory_budget), only_inside),
        setting("deadline", json!(deadline), ""),
        setting("load_deadline", json!(load_deadline), only_elsewhere),
        setting("cache_dir", path(&args.cache.folder()), ""),
        setting("cache_size", json!(args.cache.cache_size), ""),
    ]
}

/// A value for people.
fn words(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(list) if list.is_empty() => "none".to_owned(),
        Value::Array(list) => list.iter().map(words).collect::<Vec<_>>().join(","),
        other => other.to_string(),
    }
}

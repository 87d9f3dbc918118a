//! What a node says on stderr: words for people, or JSON for programs.

use std::io::{self, IsTerminal as _, Write as _};

use brickcast_volume::shown::{ShownLog, shown};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime as _, SystemTime};

use crate::cli::{Cli, LogForm};

/// Starts the log, and says whether it is JSON.
pub(crate) fn start(cli: &Cli) -> bool {
    let is_json = match cli.log {
        LogForm::Json => true,
        LogForm::Text => false,
        LogForm::Auto => !io::stderr().is_terminal(),
    };
    // Other crates speak of what is normal here (a peer that goes away) as if it were not.
    let ours = format!("error,brickcast_node={}", cli.level());
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new(ours));
    let log = tracing_subscriber::fmt().with_env_filter(filter);
    // Fails only where a log exists already.
    let _ = if is_json {
        let log = log.json().flatten_event(true).with_current_span(false).with_span_list(false);
        log.with_writer(|| ShownLog::json(io::stderr())).try_init()
    } else {
        let colours = io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty());
        log.with_writer(move || ShownLog::new(io::stderr(), colours)).with_ansi(colours).try_init()
    };
    is_json
}

/// Why the node ends: said whatever the log filters.
pub(crate) fn last_words(is_json: bool, text: &str) {
    let mut err = io::stderr().lock();
    // A closed stderr is no reason to panic.
    let _ = if is_json {
        let mut timestamp = String::new();
        // Fails only where a clock cannot be read.
        let _ = SystemTime.format_time(&mut Writer::new(&mut timestamp));
        let entry = serde_json::json!({ "timestamp": timestamp, "level": "ERROR", "message": text });
        ShownLog::json(err).write_all(format!("{entry}\n").as_bytes())
    } else {
        writeln!(err, "brickcast-node: {}", shown(text))
    };
}

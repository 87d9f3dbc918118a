//! The command line of `brickcast-node`.

use std::path::PathBuf;
use std::sync::LazyLock;

use brickcast_node::backend::BackendChoice;
use brickcast_node::config::parse_bytes;
use brickcast_node::serve::admission::AdmissionOptions;
use brickcast_proto::{PROTOCOL_VERSION, Throttle};
use clap::{ArgAction, Parser, ValueEnum};

/// Of the software and of the protocol.
static VERSION: LazyLock<String> =
    LazyLock::new(|| format!("{} (protocol {PROTOCOL_VERSION})", env!("CARGO_PKG_VERSION")));

/// A render node: holds bricks of volumes, renders the layers that a compositor orders.
#[derive(Debug, Parser)]
#[command(
    name = "brickcast-node",
    version = VERSION.as_str(),
    after_help = "Prints `listening on ADDR` on stdout when it serves; logs go to stderr.\n\
                  Exit codes: 0 after SIGTERM or ctrl-c, 1 failure, 2 wrong usage."
)]
pub(crate) struct Cli {
    /// Where to listen, host:port; port 0 takes a free one. Beyond loopback a node wants --tls
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:7000")]
    pub(crate) listen: String,

    /// Folder with stores (made by `brickcast prepare`); nothing outside it is read
    #[arg(long, value_name = "DIR", required_unless_present = "health")]
    pub(crate) data: Option<PathBuf>,

    /// Folder with ca.pem, node.pem, node.key and token (made by `brickcast tls init`): clients must show a certificate
    /// of the same authority, and the token
    #[arg(long, value_name = "DIR", env = "BRICKCAST_TLS")]
    pub(crate) tls: Option<PathBuf>,

    /// Tokens of which clients must show one, one a line [default: `token` in the folder of --tls]
    #[arg(long, value_name = "FILE", env = "BRICKCAST_TOKEN_FILE")]
    pub(crate) token_file: Option<PathBuf>,

    /// Listen beyond loopback without TLS: everyone on the network can use the node and read pictures and data on the
    /// way
    #[arg(long)]
    pub(crate) insecure: bool,

    /// Ask the node at this address whether it serves, and end with 0 or 1 (for health checks)
    #[arg(long, value_name = "ADDR", conflicts_with_all = ["data", "listen", "insecure"])]
    pub(crate) health: Option<String>,

    /// Who renders: a real GPU, else the CPU (auto); the GPU's kernel, on a software driver too (gpu); the CPU's (cpu)
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    pub(crate) backend: Backend,

    /// Memory for resident bricks, with a unit such as 512MiB or 4GiB
    #[arg(long, value_name = "SIZE", default_value = "4GiB", value_parser = parse_bytes)]
    pub(crate) memory_budget: u64,

    /// Render at one such part of the speed, 1 to 100: after its work the node rests (to try clusters whose nodes
    /// differ)
    #[arg(long, value_name = "X", default_value = "1")]
    pub(crate) throttle: Throttle,

    /// More words on stderr; twice for still more
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "quiet")]
    pub(crate) verbose: u8,

    /// Only errors on stderr
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Backend {
    Auto,
    Gpu,
    Cpu,
}

impl From<Backend> for BackendChoice {
    fn from(backend: Backend) -> Self {
        match backend {
            Backend::Auto => Self::Auto,
            Backend::Gpu => Self::Gpu,
            Backend::Cpu => Self::Cpu,
        }
    }
}

impl Cli {
    pub(crate) fn admission(&self) -> AdmissionOptions {
        AdmissionOptions { tls: self.tls.clone(), token_file: self.token_file.clone(), insecure: self.insecure }
    }

    /// The level of the log.
    pub(crate) fn level(&self) -> tracing::Level {
        match (self.quiet, self.verbose) {
            (true, _) => tracing::Level::ERROR,
            (false, 0) => tracing::Level::INFO,
            (false, 1) => tracing::Level::DEBUG,
            (false, _) => tracing::Level::TRACE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn budgets_without_sense_are_usage_errors() {
        let parse = |budget: &str| Cli::try_parse_from(["brickcast-node", "--data", ".", "--memory-budget", budget]);
        assert_eq!(parse("2GiB").unwrap().memory_budget, 2 << 30);
        for bad in ["0", "lots", "4XB"] {
            let error = parse(bad).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{bad}");
        }
    }
}

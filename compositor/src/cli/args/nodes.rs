//! Who renders.

use std::time::Duration;

use clap::{Args, ValueEnum};

use super::access::AccessArgs;
use super::values::deadline;
use crate::embedded::BackendChoice;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum BackendArg {
    /// A real GPU, else the CPU, saying so
    #[default]
    Auto,
    /// The GPU's kernel, on a software driver where there is no GPU
    Gpu,
    /// The processor's kernel
    Cpu,
}

impl BackendArg {
    /// What nodes inside this process are asked for.
    pub(crate) fn choice(self) -> BackendChoice {
        match self {
            Self::Auto => BackendChoice::Auto,
            Self::Gpu => BackendChoice::Gpu,
            Self::Cpu => BackendChoice::Cpu,
        }
    }
}

/// Who renders.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Nodes")]
pub struct NodeArgs {
    /// Nodes: host:port, dns:NAME:PORT, file:PATH
    ///
    /// By default there is one inside this process.
    ///
    /// dns: all that the name resolves to; file: one a line. They are followed. Not with --local, --backend,
    /// --memory-budget.
    #[arg(long, value_name = "HOST:PORT,...", env = "BRICKCAST_NODES", value_delimiter = ',')]
    pub nodes: Vec<String>,
    #[command(flatten)]
    pub access: AccessArgs,
    /// Number of nodes inside this process, whatever nodes the environment or the configuration file names [default: 1]
    #[arg(long, value_name = "N")]
    pub local: Option<usize>,
    /// Which kernel the nodes inside this process use
    #[arg(long, value_enum, default_value_t)]
    pub backend: BackendArg,
    /// Memory of each node inside this process: bricks, loading them, decoded chunks
    #[arg(long, value_name = "SIZE", default_value = "4GiB")]
    pub memory_budget: String,
    /// A frame not complete by then is written as incomplete (exit code 3)
    #[arg(long, value_name = "TIME", value_parser = deadline, default_value = "30s")]
    pub deadline: Duration,
}

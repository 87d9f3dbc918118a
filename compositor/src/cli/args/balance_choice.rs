//! `--balance` and what belongs to it, of every command that renders sequences.

use clap::{Args, ValueEnum};

use crate::balance::{Balancing, LoadBy, Settings};

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BalanceArg {
    /// Equal numbers of shown bricks, whatever they cost
    Off,
    /// By the cost that the first view promises, never changed
    Static,
    /// By what frames cost: chunks change hands, hot ones are copied or shared
    Dynamic,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum LoadByArg {
    /// What nodes took to render; on software drivers their processor time
    #[default]
    Time,
    /// Samples times the declared throttle: the same in every run, for nodes that share a machine
    Samples,
}

/// Which node renders what.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Balance")]
pub struct BalanceChoice {
    /// How a sequence's work is shared out [default: dynamic on several --nodes, else off]
    #[arg(long, value_enum)]
    pub balance: Option<BalanceArg>,
    /// What a node's load is
    #[arg(long, value_enum, default_value_t)]
    pub load_by: LoadByArg,
    /// Nodes that hold each chunk where memory allows, the hottest ones more; 1: no copies
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub replicas: u32,
    /// Never share the screen tiles of one chunk
    #[arg(long)]
    pub no_split: bool,
}

impl BalanceChoice {
    /// `default` where the command line does not say.
    #[must_use]
    pub fn settings(&self, default: BalanceArg) -> Settings {
        Settings {
            mode: match self.balance.unwrap_or(default) {
                BalanceArg::Off => Balancing::Off,
                BalanceArg::Static => Balancing::Static,
                BalanceArg::Dynamic => Balancing::Dynamic,
            },
            load_by: match self.load_by {
                LoadByArg::Time => LoadBy::Time,
                LoadByArg::Samples => LoadBy::Samples,
            },
            replicas: self.replicas,
            split: !self.no_split,
            ..Settings::default()
        }
    }
}

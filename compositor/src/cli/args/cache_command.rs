//! The arguments of `brickcast cache`.

use std::time::Duration;

use clap::{Args, Subcommand};

use super::cache::CacheArgs;

#[derive(Debug, Args)]
pub struct CacheCommandArgs {
    #[command(subcommand)]
    pub command: CacheCommand,
}

#[derive(Debug, Subcommand)]
pub enum CacheCommand {
    /// Show what lies there: input, size, when it was used last
    List(CacheListArgs),
    /// Remove what nobody uses
    Clear(CacheClearArgs),
}

#[derive(Debug, Args)]
pub struct CacheListArgs {
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub cache: CacheArgs,
}

#[derive(Debug, Args)]
pub struct CacheClearArgs {
    /// Only these: an entry's name, its store, or the input that it was made of [default: all]
    #[arg(value_name = "ENTRY|INPUT")]
    pub what: Vec<String>,
    /// Only what was not used for so long, such as 30d or 12h
    #[arg(long, value_name = "AGE", value_parser = humantime::parse_duration)]
    pub older_than: Option<Duration>,
    #[command(flatten)]
    pub cache: CacheArgs,
}

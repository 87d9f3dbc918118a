//! The arguments of `brickcast tls`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

#[derive(Debug, Args)]
pub struct TlsArgs {
    #[command(subcommand)]
    pub command: TlsCommand,
}

#[derive(Debug, Subcommand)]
pub enum TlsCommand {
    /// Make a certificate authority, a certificate for nodes, one for clients, and a token
    Init(TlsInitArgs),
}

#[derive(Debug, Args)]
pub struct TlsInitArgs {
    /// Folder for the files; made where it is missing
    pub dir: PathBuf,
    /// How long the certificates are valid, days; negative ones are expired from the start (for tests)
    #[arg(long, value_name = "N", default_value_t = 365, allow_negative_numbers = true,
          value_parser = clap::value_parser!(i64).range(-3650..=36500))]
    pub days: i64,
    /// One more host name or IP address in the node's certificate, for other software that checks it; may be repeated
    #[arg(long = "name", value_name = "NAME")]
    pub names: Vec<String>,
    /// Let the folder's group read keys and token (for containers that run as several users)
    #[arg(long)]
    pub group_readable: bool,
    /// Replace what is there: certificates and tokens handed out before become worthless
    #[arg(long)]
    pub force: bool,
}

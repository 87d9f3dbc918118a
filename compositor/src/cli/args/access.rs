//! Certificates and tokens on the command line.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::values::deadline;
use crate::cli::failure::Failure;
use crate::cluster::{Access, Dial};

/// Certificates and tokens on the command line.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Nodes")]
pub struct AccessArgs {
    /// Folder with ca.pem, client.pem, client.key and token (made by `brickcast tls init`): nodes must hold a
    /// certificate of the same authority
    #[arg(long, value_name = "DIR", env = "BRICKCAST_TLS")]
    pub tls: Option<PathBuf>,
    /// The token that nodes want, on the file's first line [default: `token` in the folder of --tls]
    #[arg(long, value_name = "FILE", env = "BRICKCAST_TOKEN_FILE")]
    pub token_file: Option<PathBuf>,
    /// A node that takes longer to answer anything but a frame, loading included, is given up: what it would have
    /// rendered goes to the others [default: 10m]
    #[arg(long, value_name = "TIME", value_parser = deadline)]
    pub load_deadline: Option<Duration>,
}

impl AccessArgs {
    /// Connections as `--tls` and `--token-file` say.
    pub(crate) fn dial(&self) -> Result<Dial, Failure> {
        let access = Access::read(self.tls.as_deref(), self.token_file.as_deref(), self.load_deadline);
        Ok(access.map_err(anyhow::Error::new)?.dial())
    }
}

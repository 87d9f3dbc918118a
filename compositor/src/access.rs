//! What this client shows to nodes, and whom it takes for one.

use std::path::PathBuf;
use std::time::Duration;

use brickcast_proto::credentials::{Badge, CLIENT_FILES, CredentialError, Tls, Token, exposed, token_file, tokens};
use clap::Args;

use crate::cli_values::deadline;
use crate::dial::Dial;
use crate::service::LOAD_DEADLINE;

/// Certificates and tokens on the command line.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Nodes")]
pub struct AccessArgs {
    /// Folder with ca.pem, client.pem, client.key and token (made by `brickcast tls init`): nodes must hold a certificate of
    /// the same authority
    #[arg(long, value_name = "DIR", env = "BRICKCAST_TLS")]
    pub tls: Option<PathBuf>,
    /// The token that nodes want, on the file's first line [default: `token` in the folder of --tls]
    #[arg(long, value_name = "FILE", env = "BRICKCAST_TOKEN_FILE")]
    pub token_file: Option<PathBuf>,
    /// A node that takes longer to answer anything but a frame, loading included, is given up: what it would have rendered goes to the
    /// others [default: 10m]
    #[arg(long, value_name = "TIME", value_parser = deadline)]
    pub load_deadline: Option<Duration>,
}

/// Certificate and token of a client; the default has neither.
#[derive(Debug, Clone, Default)]
pub struct Access {
    pub tls: Option<Tls>,
    pub badge: Badge,
    /// How long anything but a frame may take; [`LOAD_DEADLINE`] where it is not said.
    pub patience: Option<Duration>,
}

impl Access {
    /// # Errors
    /// Files that are missing or hold something else.
    pub fn read(args: &AccessArgs) -> Result<Self, CredentialError> {
        let tls = args.tls.as_deref().map(Tls::of_client).transpose()?;
        let tokens = tokens(args.token_file.as_deref(), args.tls.as_deref())?;
        let key = args.tls.as_ref().map(|folder| folder.join(CLIENT_FILES[1]));
        let secrets = key.into_iter().chain(token_file(args.token_file.as_deref(), args.tls.as_deref()));
        secrets.filter_map(|path| exposed(&path)).for_each(|note| tracing::warn!("{note}"));
        Ok(Self { tls, badge: Badge::of_first(&tokens), patience: args.load_deadline })
    }

    /// With this token and no certificate.
    #[must_use]
    pub fn with_token(token: &Token) -> Self {
        Self { badge: Badge::of(token), ..Self::default() }
    }

    /// Connections that show it.
    #[must_use]
    pub fn dial(&self) -> Dial {
        Dial::with(self.clone(), self.patience.unwrap_or(LOAD_DEADLINE))
    }
}

/// A token that nobody can guess.
///
/// # Errors
/// The system has no randomness.
pub fn random_token() -> Result<Token, getrandom::Error> {
    let mut bytes = [0_u8; 32];
    getrandom::fill(&mut bytes)?;
    Ok(Token::of_bytes(&bytes))
}

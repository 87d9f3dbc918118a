//! What this client shows to nodes, and whom it takes for one.

use std::path::Path;
use std::time::Duration;

use brickcast_proto::certificate::{Moment, notes};
use brickcast_proto::credentials::{Badge, CLIENT_FILES, CredentialError, Tls, Token, exposed, token_file, tokens};

/// Certificate and token of a client; the default has neither.
#[derive(Debug, Clone, Default)]
pub struct Access {
    pub tls: Option<Tls>,
    pub badge: Badge,
    /// How long anything but a frame may take; [`LOAD_DEADLINE`](super::service::LOAD_DEADLINE) where it is not said.
    pub patience: Option<Duration>,
}

impl Access {
    /// From the folder of a client's certificate and key and from a file of tokens, whichever are named. Warns of
    /// certificates that end soon or do not hold: nodes will say the rest.
    ///
    /// # Errors
    /// Files that are missing or hold something else.
    pub fn read(
        folder: Option<&Path>,
        tokens_in: Option<&Path>,
        patience: Option<Duration>,
    ) -> Result<Self, CredentialError> {
        let tls = folder.map(Tls::of_client).transpose()?;
        let tokens = tokens(tokens_in, folder)?;
        let key = folder.map(|folder| folder.join(CLIENT_FILES[1]));
        let secrets = key.into_iter().chain(token_file(tokens_in, folder));
        secrets.filter_map(|path| exposed(&path)).for_each(|note| tracing::warn!("{note}"));
        let validities = tls.as_ref().map_or(&[][..], Tls::validities);
        notes(validities, Moment::now()).into_iter().for_each(|note| tracing::warn!("{note}"));
        Ok(Self { tls, badge: Badge::of_first(&tokens), patience })
    }

    /// With this token and no certificate.
    #[must_use]
    pub fn with_token(token: &Token) -> Self {
        Self { badge: Badge::of(token), ..Self::default() }
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

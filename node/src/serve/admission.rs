//! Who may use a node, and where it may listen.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use brickcast_proto::certificate::{Moment, Validity, ValidityError, notes};
use brickcast_proto::credentials::{CredentialError, Doorkeeper, NODE_FILES, Tls, exposed, token_file, tokens};

/// Between one word of certificates and the next.
const ONE_DAY: Duration = Duration::from_secs(86_400);

#[derive(Debug, thiserror::Error)]
pub enum AdmissionError {
    #[error(transparent)]
    Credential(#[from] CredentialError),
    #[error(transparent)]
    Validity(#[from] ValidityError),
    #[error(
        "{0} can be reached by others, and nothing would keep them out: give the node --tls DIR (`brickcast tls init \
         DIR` makes it), listen on 127.0.0.1, or say --insecure on a network that you trust altogether"
    )]
    Open(SocketAddr),
    #[error(
        "{0} can be reached by others, who could read the token on its way: give the node --tls DIR too, listen on \
         127.0.0.1, or say --insecure on a network that you trust altogether"
    )]
    TokenInClear(SocketAddr),
}

/// What a client must show. The default lets in everyone.
#[derive(Debug, Clone, Default)]
pub struct Admission {
    pub tls: Option<Tls>,
    pub tokens: Doorkeeper,
}

/// What the command line says of admission.
#[derive(Debug, Clone, Default)]
pub struct AdmissionOptions {
    /// A folder as `brickcast tls init` makes it.
    pub tls: Option<PathBuf>,
    /// Takes the place of the folder's token.
    pub token_file: Option<PathBuf>,
    pub insecure: bool,
}

impl Admission {
    /// # Errors
    /// Files that are missing or hold something else; certificates that have ended, or do not hold yet.
    pub fn read(options: &AdmissionOptions) -> Result<Self, AdmissionError> {
        let tls = options.tls.as_deref().map(Tls::of_node).transpose()?;
        let tokens = tokens(options.token_file.as_deref(), options.tls.as_deref())?;
        let key = options.tls.as_ref().map(|folder| folder.join(NODE_FILES[1]));
        let secrets = key.into_iter().chain(token_file(options.token_file.as_deref(), options.tls.as_deref()));
        secrets.filter_map(|path| exposed(&path)).for_each(|note| tracing::warn!("{note}"));
        let admission = Self { tls, tokens: Doorkeeper::new(tokens) };
        let now = Moment::now();
        admission.validities().iter().try_for_each(|one| one.check(now).map(drop))?;
        Ok(admission)
    }

    fn validities(&self) -> &[Validity] {
        self.tls.as_ref().map_or(&[], |tls| tls.validities())
    }

    /// When the first of its certificates ends, seconds since 1970.
    #[must_use]
    pub fn certificate_ends(&self) -> Option<i64> {
        self.validities().iter().map(|one| one.until.0).min()
    }

    /// Tells now and every day of certificates that end soon, or have ended meanwhile; never ends.
    pub async fn tell_daily(self, tell: impl Fn(String)) {
        daily(|| notes(self.validities(), Moment::now()).into_iter().for_each(&tell)).await;
    }

    /// # Errors
    /// An address beyond this machine without TLS, unless that was asked for.
    pub fn may_listen(&self, address: SocketAddr, options: &AdmissionOptions) -> Result<(), AdmissionError> {
        if address.ip().is_loopback() || self.tls.is_some() || options.insecure {
            return Ok(());
        }
        Err(if options.token_file.is_some() {
            AdmissionError::TokenInClear(address)
        } else {
            AdmissionError::Open(address)
        })
    }
}

async fn daily(mut work: impl FnMut()) {
    loop {
        work();
        tokio::time::sleep(ONE_DAY).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn certificates_are_looked_at_at_once_and_every_day() {
        let mut times = 0;
        assert!(tokio::time::timeout(ONE_DAY * 5 / 2, daily(|| times += 1)).await.is_err());
        assert_eq!(times, 3);
    }

    #[test]
    fn beyond_loopback_only_with_tls_or_when_told() {
        let open = Admission::default();
        let told = AdmissionOptions { insecure: true, ..AdmissionOptions::default() };
        let token = AdmissionOptions { token_file: Some("t".into()), ..AdmissionOptions::default() };
        for address in ["127.0.0.1:7000", "[::1]:7000", "127.8.9.1:1"] {
            assert!(open.may_listen(address.parse().unwrap(), &AdmissionOptions::default()).is_ok(), "{address}");
        }
        for address in ["0.0.0.0:7000", "[::]:7000", "10.0.0.1:7000", "192.168.1.2:1"] {
            let address = address.parse().unwrap();
            let error = open.may_listen(address, &AdmissionOptions::default()).unwrap_err().to_string();
            assert!(error.contains("--tls") && error.contains("--insecure"), "{error}");
            assert!(matches!(open.may_listen(address, &token), Err(AdmissionError::TokenInClear(_))));
            assert!(open.may_listen(address, &told).is_ok());
        }
    }
}

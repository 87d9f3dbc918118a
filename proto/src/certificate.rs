//! What certificates say of themselves: whose they are and how long they hold; and a node's side of TLS.

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::{NoServerSessionStorage, WebPkiClientVerifier};
use rustls::{RootCertStore, ServerConfig};
use x509_parser::certificate::X509Certificate;
use x509_parser::prelude::FromDer as _;

use crate::credentials::Tls;

/// Who holds a certificate is told from here on that it ends, seconds.
pub const ENDS_SOON: i64 = 30 * DAY;
/// Seconds.
pub const DAY: i64 = 86_400;
/// The longest name of a certificate that is told, bytes.
const MAX_NAME: usize = 64;

/// Why a certificate is of no use now.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ValidityError {
    #[error(
        "certificate {}: it ended on {until}; make new ones with `brickcast tls init DIR --force`, and hand them out",
        path.display()
    )]
    Ended { path: PathBuf, until: Moment },
    #[error(
        "certificate {}: it holds only from {from} on; set the clock of this machine, or make new ones with \
         `brickcast tls init DIR --force`",
        path.display()
    )]
    NotYet { path: PathBuf, from: Moment },
}

/// Seconds since 1970, UTC; shown as a date.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moment(pub i64);

impl Moment {
    #[must_use]
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self(i64::try_from(since.as_secs()).unwrap_or(i64::MAX))
    }
}

impl fmt::Display for Moment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match time::OffsetDateTime::from_unix_timestamp(self.0) {
            Ok(at) => write!(f, "{} {:02}:{:02} UTC", at.date(), at.hour(), at.minute()),
            Err(_) => write!(f, "{} s since 1970", self.0),
        }
    }
}

/// From when until when the certificates of a file hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Validity {
    pub path: PathBuf,
    pub from: Moment,
    pub until: Moment,
}

impl Validity {
    /// What to tell of it: nothing, or that it ends soon.
    ///
    /// # Errors
    /// A certificate that has ended, or does not hold yet.
    pub fn check(&self, now: Moment) -> Result<Option<String>, ValidityError> {
        let (path, until) = (&self.path, self.until);
        if now > until {
            return Err(ValidityError::Ended { path: path.clone(), until });
        }
        if now < self.from {
            return Err(ValidityError::NotYet { path: path.clone(), from: self.from });
        }
        let left = until.0 - now.0;
        Ok((left < ENDS_SOON).then(|| {
            format!(
                "certificate {}: it ends on {until}, in {}; make new ones with `brickcast tls init DIR --force` in \
                 time",
                path.display(),
                if left < DAY { "less than a day".to_owned() } else { format!("{} days", left / DAY) },
            )
        }))
    }
}

/// The notes and errors of all of them, for whoever goes on with what does not hold; of those that end together, as
/// `brickcast tls init` makes them, the first one's.
#[must_use]
pub fn notes(of: &[Validity], now: Moment) -> Vec<String> {
    let is_first = |&at: &usize| of[..at].iter().all(|other| other.until != of[at].until);
    let note = |at: usize| of[at].check(now).unwrap_or_else(|error| Some(error.to_string()));
    (0..of.len()).filter(is_first).filter_map(note).collect()
}

fn ders(pem: &[u8]) -> Vec<CertificateDer<'static>> {
    CertificateDer::pem_slice_iter(pem).filter_map(Result::ok).collect()
}

/// From when until when, of each certificate; what is none is left out, and told of by whoever uses it.
fn spans(pem: &[u8]) -> Vec<(Moment, Moment)> {
    let span = |der: &CertificateDer<'_>| {
        let (_, certificate) = X509Certificate::from_der(der).ok()?;
        let validity = certificate.validity();
        Some((Moment(validity.not_before.timestamp()), Moment(validity.not_after.timestamp())))
    };
    ders(pem).iter().filter_map(span).collect()
}

/// Of one's own certificate and those between it and the authority: all must hold.
pub(crate) fn of_chain(path: &Path, pem: &[u8]) -> Option<Validity> {
    let spans = spans(pem);
    let (from, until) = (spans.iter().map(|s| s.0).max()?, spans.iter().map(|s| s.1).min()?);
    Some(Validity { path: path.to_path_buf(), from, until })
}

/// Of the authority; where there are several, an old one may have ended.
pub(crate) fn of_authority(path: &Path, pem: &[u8]) -> Option<Validity> {
    let (from, until) = spans(pem).into_iter().max_by_key(|span| span.1)?;
    Some(Validity { path: path.to_path_buf(), from, until })
}

/// Whose a certificate is, as far as it says so. Made by others: to be shown as such.
#[must_use]
pub fn name(der: &[u8]) -> Option<String> {
    let (_, certificate) = X509Certificate::from_der(der).ok()?;
    let name = certificate.subject().iter_common_name().next()?.as_str().ok()?;
    Some(crate::convert::clip(name, MAX_NAME))
}

impl Tls {
    /// A server that lets in only those with a client's certificate of the same authority.
    ///
    /// # Errors
    /// Files that hold no certificate or key, or such that do not belong together.
    pub fn server(&self) -> Result<ServerConfig, Box<dyn Error + Send + Sync>> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let mut roots = RootCertStore::empty();
        roots.add_parsable_certificates(ders(&self.authority));
        let verifier = WebPkiClientVerifier::builder_with_provider(roots.into(), provider.clone()).build()?;
        let key = PrivateKeyDer::from_pem_slice(&self.key)?;
        let mut config = ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()?
            .with_client_cert_verifier(verifier)
            .with_single_cert(ders(&self.chain), key)?;
        config.alpn_protocols.push(b"h2".to_vec());
        // Who resumes a session shows no certificate again, though it may have ended meanwhile.
        config.session_storage = Arc::new(NoServerSessionStorage {});
        config.send_tls13_tickets = 0;
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use rcgen::{CertificateParams, DnType, KeyPair};
    use time::OffsetDateTime;

    use super::*;

    /// 2026-11-30 00:00 UTC.
    const NOW: Moment = Moment(1_796_000_000 - 1_796_000_000 % DAY);

    fn pem(name: &str, from: i64, until: i64) -> String {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.distinguished_name.push(DnType::CommonName, name);
        params.not_before = OffsetDateTime::from_unix_timestamp(NOW.0 + from).unwrap();
        params.not_after = OffsetDateTime::from_unix_timestamp(NOW.0 + until).unwrap();
        params.self_signed(&KeyPair::generate().unwrap()).unwrap().pem()
    }

    fn checked(from: i64, until: i64) -> Result<Option<String>, String> {
        let pem = pem("x", from, until);
        of_chain(Path::new("tls/node.pem"), pem.as_bytes()).unwrap().check(NOW).map_err(|error| error.to_string())
    }

    #[test]
    fn what_ended_and_what_does_not_hold_yet_are_errors_with_file_date_and_way_out() {
        let ended = checked(-10 * DAY, -2 * DAY).unwrap_err();
        let yet = checked(DAY, 9 * DAY).unwrap_err();
        for (text, day) in [(ended, NOW.0 - 2 * DAY), (yet, NOW.0 + DAY)] {
            let want = ["tls/node.pem", &Moment(day).to_string(), "brickcast tls init"];
            assert!(want.iter().all(|word| text.contains(word)), "{text}");
        }
    }

    #[test]
    fn what_ends_within_30_days_is_told_of_with_the_days() {
        assert_eq!(checked(-DAY, 31 * DAY), Ok(None));
        let soon = checked(-DAY, 29 * DAY + 60).unwrap().unwrap();
        assert!(soon.contains("tls/node.pem") && soon.contains("29 days"), "{soon}");
        assert!(checked(-DAY, DAY / 2).unwrap().unwrap().contains("less than a day"));
        let validities = [(-DAY, 31 * DAY), (-DAY, DAY), (-2 * DAY, DAY), (-9 * DAY, -DAY)].map(|(from, until)| {
            Validity { path: "p".into(), from: Moment(NOW.0 + from), until: Moment(NOW.0 + until) }
        });
        let notes = notes(&validities, NOW);
        assert!(notes.len() == 2 && notes[0].contains("it ends on") && notes[1].contains("it ended on"), "{notes:?}");
    }

    /// A chain is as good as its worst, authorities as their best.
    #[test]
    fn several_certificates_in_a_file() {
        let both = [pem("old", -20 * DAY, -DAY), pem("new", -2 * DAY, 90 * DAY)].concat();
        let path = Path::new("p");
        assert_eq!(of_chain(path, both.as_bytes()).unwrap().until, Moment(NOW.0 - DAY));
        assert_eq!(of_authority(path, both.as_bytes()).unwrap().until, Moment(NOW.0 + 90 * DAY));
        assert_eq!(of_chain(path, b"-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n"), None);
        assert_eq!(of_authority(path, b"no certificate"), None);
    }

    #[test]
    fn names_are_told_and_clipped() {
        let named = |text: &str| name(&ders(pem(text, 0, DAY).as_bytes())[0]);
        assert_eq!(named("brickcast client").as_deref(), Some("brickcast client"));
        assert!(named(&"long ".repeat(40)).unwrap().len() <= MAX_NAME + 3);
        assert_eq!(name(b"no certificate"), None);
    }

    #[test]
    fn dates_are_for_people() {
        assert_eq!(Moment(0).to_string(), "1970-01-01 00:00 UTC");
        assert_eq!(Moment(1_796_000_000).to_string().len(), "2026-11-29 22:13 UTC".len());
        assert!(Moment(i64::MAX).to_string().contains("since 1970"));
    }
}

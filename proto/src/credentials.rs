//! Who may talk to whom: certificates of one private authority on both sides (mutual TLS), and bearer tokens.
//!
//! A certificate names a role, not a host: every node's holds [`SERVER_NAME`], which clients demand whatever the
//! address was. So addresses may come from a name service or change, and yet nobody without a node's key can play node;
//! a client's certificate is for clients only, so it cannot either.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use brickcast_volume::small_file::{FileError, read};
use tonic::metadata::{Ascii, MetadataMap, MetadataValue};
use tonic::service::Interceptor;
use tonic::transport::{Certificate, ClientTlsConfig, Identity};
use tonic::{Request, Status};

use crate::certificate::{Validity, of_authority, of_chain};

/// The name in every node's certificate.
pub const SERVER_NAME: &str = "brickcast-node";
/// Files of a folder made by `brickcast tls init`.
pub const CA_FILE: &str = "ca.pem";
pub const NODE_FILES: [&str; 2] = ["node.pem", "node.key"];
pub const CLIENT_FILES: [&str; 2] = ["client.pem", "client.key"];
pub const TOKEN_FILE: &str = "token";

/// A handshake takes no longer, or the connection is given up.
pub const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(5);
/// Shorter tokens can be guessed.
pub const MIN_TOKEN: usize = 16;
pub const MAX_TOKEN: usize = 512;
const MAX_FILE_BYTES: u64 = 1 << 20;

#[derive(Debug, thiserror::Error)]
pub enum CredentialError {
    #[error("{0}; `brickcast tls init DIR` makes what is needed")]
    Read(#[from] FileError),
    #[error(
        "token file {}, line {line}: a token is {MIN_TOKEN} to {MAX_TOKEN} visible ASCII characters", path.display()
    )]
    Token { path: PathBuf, line: usize },
    #[error("token file {} holds no token: write one a line (# starts a comment)", path.display())]
    NoToken { path: PathBuf },
}

/// One side's certificate and key, and the authority that both sides trust.
#[derive(Clone)]
pub struct Tls {
    folder: PathBuf,
    /// PEM, as are the others.
    pub(crate) authority: Vec<u8>,
    pub(crate) chain: Vec<u8>,
    pub(crate) key: Vec<u8>,
    validities: Vec<Validity>,
}

impl fmt::Debug for Tls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Tls({})", self.folder.display())
    }
}

impl Tls {
    /// A node's, from a folder made by `brickcast tls init`.
    ///
    /// # Errors
    /// A file that is missing or cannot be read. What is in them is looked at when a connection is made.
    pub fn of_node(folder: &Path) -> Result<Self, CredentialError> {
        Self::read(folder, NODE_FILES)
    }

    /// A client's.
    ///
    /// # Errors
    /// As [`Tls::of_node`].
    pub fn of_client(folder: &Path) -> Result<Self, CredentialError> {
        Self::read(folder, CLIENT_FILES)
    }

    fn read(folder: &Path, [certificate, key]: [&str; 2]) -> Result<Self, CredentialError> {
        let read = |what, file: &str| read(what, &folder.join(file), MAX_FILE_BYTES);
        let (authority, chain) = (read("certificate authority", CA_FILE)?, read("certificate", certificate)?);
        let key = read("private key", key)?;
        let own = of_chain(&folder.join(certificate), &chain);
        let validities = own.into_iter().chain(of_authority(&folder.join(CA_FILE), &authority)).collect();
        Ok(Self { folder: folder.to_path_buf(), authority, chain, key, validities })
    }

    /// How long its own certificate and the authority's hold, as they were read.
    #[must_use]
    pub fn validities(&self) -> &[Validity] {
        &self.validities
    }

    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// A client that talks only to nodes of the same authority.
    #[must_use]
    pub fn client(&self) -> ClientTlsConfig {
        ClientTlsConfig::new()
            .domain_name(SERVER_NAME)
            .ca_certificate(Certificate::from_pem(&self.authority))
            .identity(Identity::from_pem(&self.chain, &self.key))
            .timeout(HANDSHAKE_TIMEOUT)
    }
}

/// A bearer token; never printed.
#[derive(Clone)]
pub struct Token(String);

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

impl Token {
    /// `None` where the text is no token.
    #[must_use]
    pub fn new(text: &str) -> Option<Self> {
        let fits = (MIN_TOKEN..=MAX_TOKEN).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_graphic());
        fits.then(|| Self(text.to_owned()))
    }

    /// Of random bytes.
    #[must_use]
    pub fn of_bytes(bytes: &[u8; 32]) -> Self {
        Self(bytes.iter().map(|b| format!("{b:02x}")).collect())
    }

    /// The secret itself, for writing it to its file.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// Takes as long for every wrong token of the same length.
    fn is(&self, given: &[u8]) -> bool {
        let own = self.0.as_bytes();
        own.len() == given.len() && own.iter().zip(given).fold(0, |unlike, (a, b)| unlike | (a ^ b)) == 0
    }
}

/// The tokens of a file: one a line, blank lines and comments (`#`) aside.
///
/// # Errors
/// A file that cannot be read, holds no token, or something that is none.
pub fn read_tokens(path: &Path) -> Result<Vec<Token>, CredentialError> {
    let text = read("token file", path, MAX_FILE_BYTES)?;
    let text = String::from_utf8_lossy(&text);
    let lines = text.lines().map(str::trim).enumerate().filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let tokens = lines
        .map(|(i, line)| {
            Token::new(line).ok_or_else(|| CredentialError::Token { path: path.to_path_buf(), line: i + 1 })
        })
        .collect::<Result<Vec<_>, _>>()?;
    if tokens.is_empty() { Err(CredentialError::NoToken { path: path.to_path_buf() }) } else { Ok(tokens) }
}

/// The file of tokens: the one given, else the one in the folder of certificates.
#[must_use]
pub fn token_file(given: Option<&Path>, tls: Option<&Path>) -> Option<PathBuf> {
    given.map(Path::to_path_buf).or_else(|| Some(tls?.join(TOKEN_FILE)))
}

/// The tokens of [`token_file`]; none where there is no file.
///
/// # Errors
/// As [`read_tokens`].
pub fn tokens(given: Option<&Path>, tls: Option<&Path>) -> Result<Vec<Token>, CredentialError> {
    token_file(given, tls).map_or(Ok(Vec::new()), |path| read_tokens(&path))
}

/// What to tell of a secret's file that others may read or change; nothing where its owner alone may, or a group may
/// read it: that is what `brickcast tls init --group-readable` is for.
#[must_use]
pub fn exposed(path: &Path) -> Option<String> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        const OTHERS: u32 = 0o037;
        let mode = std::fs::metadata(path).ok()?.permissions().mode() & 0o777;
        (mode & OTHERS != 0).then(|| {
            format!(
                "{} (mode {mode:03o}) can be read or changed by others, who can then pass for its owner: chmod 600 it, \
                 and make new ones where they may have been read",
                path.display()
            )
        })
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        None
    }
}

/// What a client shows with every call.
#[derive(Debug, Clone, Default)]
pub struct Badge(Option<MetadataValue<Ascii>>);

impl Badge {
    /// A client shows the first of its tokens, and nothing where it has none.
    #[must_use]
    pub fn of_first(tokens: &[Token]) -> Self {
        tokens.first().map_or_else(Self::default, Self::of)
    }

    #[must_use]
    pub fn of(token: &Token) -> Self {
        let value =
            MetadataValue::try_from(format!("Bearer {}", token.0)).ok().map(|mut value: MetadataValue<Ascii>| {
                value.set_sensitive(true);
                value
            });
        Self(value)
    }
}

impl Interceptor for Badge {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(value) = &self.0 {
            request.metadata_mut().insert("authorization", value.clone());
        }
        Ok(request)
    }
}

/// The tokens that a server admits; without any it admits everyone.
#[derive(Debug, Clone, Default)]
pub struct Doorkeeper(Arc<[Token]>);

impl Doorkeeper {
    #[must_use]
    pub fn new(tokens: Vec<Token>) -> Self {
        Self(tokens.into())
    }

    fn admits(&self, metadata: &MetadataMap) -> Result<(), Status> {
        if self.0.is_empty() {
            return Ok(());
        }
        let Some(shown) = metadata.get("authorization") else {
            return Err(Status::unauthenticated(
                "this node wants a token, and none was shown: give the client --token-file FILE (or --tls DIR, whose \
                 token is taken)",
            ));
        };
        let shown = shown.as_bytes();
        let token = shown.strip_prefix(b"Bearer ").or_else(|| shown.strip_prefix(b"bearer ")).unwrap_or_default();
        // All of them, so that the time does not tell which.
        if self.0.iter().fold(false, |found, known| found | known.is(token)) {
            Ok(())
        } else {
            Err(Status::unauthenticated(
                "the token shown is none of this node's: compare the token files of both sides",
            ))
        }
    }
}

impl Interceptor for Doorkeeper {
    fn call(&mut self, request: Request<()>) -> Result<Request<()>, Status> {
        self.admits(request.metadata()).map(|()| request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "0123456789abcdef";

    fn shown(value: &str) -> MetadataMap {
        let mut metadata = MetadataMap::new();
        metadata.insert("authorization", value.parse().unwrap());
        metadata
    }

    #[test]
    fn only_known_tokens_are_admitted() {
        let keeper = Doorkeeper::new(vec![Token::new(GOOD).unwrap(), Token::new("another-token-of-old").unwrap()]);
        for good in ["Bearer 0123456789abcdef", "bearer another-token-of-old"] {
            assert!(keeper.admits(&shown(good)).is_ok(), "{good}");
        }
        for bad in ["Bearer 0123456789abcdeg", "Bearer 0123456789abcde", "Bearer ", "0123456789abcdef", "Basic x", ""] {
            assert_eq!(keeper.admits(&shown(bad)).unwrap_err().code(), tonic::Code::Unauthenticated, "{bad}");
        }
        assert_eq!(keeper.admits(&MetadataMap::new()).unwrap_err().code(), tonic::Code::Unauthenticated);
        assert!(Doorkeeper::default().admits(&MetadataMap::new()).is_ok());
    }

    #[test]
    fn token_files_that_hold_none_are_refused_with_the_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        for (text, want) in [
            ("", "no token"),
            ("# only a comment\n\n", "no token"),
            ("0123456789abcdef\nshort\n", "line 2"),
            ("with space 0123456789\n", "line 1"),
            ("umlaut-ü-0123456789\n", "line 1"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = read_tokens(&path).unwrap_err().to_string();
            assert!(error.contains(want), "{text:?}: {error}");
        }
        std::fs::write(&path, format!("# old\n{GOOD}\r\n  another-token-of-old\n")).unwrap();
        assert_eq!(read_tokens(&path).unwrap().len(), 2);
        let missing = read_tokens(&folder.path().join("none")).unwrap_err().to_string();
        assert!(missing.contains("tls init"), "{missing}");
    }

    #[cfg(unix)]
    #[test]
    fn a_key_that_others_can_read_is_told_of() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node.key");
        std::fs::write(&path, "secret").unwrap();
        for (mode, told) in
            [(0o600, false), (0o400, false), (0o640, false), (0o644, true), (0o660, true), (0o604, true)]
        {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
            let note = exposed(&path);
            assert_eq!(note.is_some(), told, "{mode:o}");
            assert!(note.is_none_or(|n| n.contains("node.key") && n.contains(&format!("{mode:03o}"))));
        }
        assert_eq!(exposed(&folder.path().join("none")), None);
    }

    #[test]
    fn secrets_are_not_printed() {
        let token = Token::new(GOOD).unwrap();
        for text in
            [format!("{token:?}"), format!("{:?}", Badge::of(&token)), format!("{:?}", Doorkeeper::new(vec![token]))]
        {
            assert!(!text.contains(GOOD), "{text}");
        }
    }
}

//! What can go wrong on the way to a store.

use std::io;
use std::path::PathBuf;

use brickcast_volume::store::StoreError;

/// Why something that lies behind a network was not read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RemoteError {
    #[error("there is nothing at this place")]
    NotFound,
    #[error(
        "the server refuses it (status {status}); an object store's keys are read from AWS_ACCESS_KEY_ID, \
         AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN, AWS_REGION and AWS_ENDPOINT_URL, and AWS_SKIP_SIGNATURE=true asks \
         without any; a place that does not exist may be refused, too"
    )]
    Refused { status: u16 },
    #[error("no whole answer in {seconds} s, at try {tries}; the last one: {last}; look at the server and the network")]
    Late { tries: u32, seconds: u64, last: String },
    #[error("{tries} tries failed in {seconds} s, the last one: {last}; look at the server and the network")]
    Failed { tries: u32, seconds: u64, last: String },
    #[error("the server cannot be asked: {0}")]
    Setting(String),
    #[error("it was replaced since it was opened; ask again")]
    Replaced,
    #[error(
        "the server does not answer for a range of bytes, which stores are read by; serve it by one that does, such as \
         nginx, or from an object store"
    )]
    NoRanges,
    #[error("the server has {got} bytes of it, {want} are due")]
    Length { got: u64, want: u64 },
    #[error("it ends before the bytes that were asked for")]
    BeyondEnd,
    #[error("what was to be put there cannot be read: {0}")]
    Unread(String),
    #[error("no threads for the network: {0}")]
    Threads(String),
}

impl RemoteError {
    /// As an error of a store: what was to be done, and with what.
    pub(crate) fn of(self, action: &'static str, path: PathBuf) -> StoreError {
        let kind = match &self {
            Self::Length { got, want } => return StoreError::FileLength { path, got: *got, want: *want },
            Self::NotFound => io::ErrorKind::NotFound,
            Self::Refused { .. } => io::ErrorKind::PermissionDenied,
            Self::Late { .. } => io::ErrorKind::TimedOut,
            Self::Failed { .. } => io::ErrorKind::ConnectionAborted,
            Self::NoRanges => io::ErrorKind::Unsupported,
            Self::BeyondEnd => io::ErrorKind::UnexpectedEof,
            Self::Setting(_) => io::ErrorKind::InvalidInput,
            Self::Replaced | Self::Unread(_) | Self::Threads(_) => io::ErrorKind::Other,
        };
        StoreError::Io { action, path, source: io::Error::new(kind, self) }
    }
}

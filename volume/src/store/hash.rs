//! Content hashes of the files of a store.

use std::fmt;
use std::str::FromStr;

use crate::ids::{NotAStoreHash, StoreHash};

/// 128-bit xxh3 hash of a file (or of a part of one) of a store; written as 32 lower-case hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ContentHash(pub u128);

impl ContentHash {
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(xxhash_rust::xxh3::xxh3_128(bytes))
    }
}

/// Of a manifest: the store's that it is of.
impl From<ContentHash> for StoreHash {
    fn from(hash: ContentHash) -> Self {
        Self(hash.0)
    }
}

impl fmt::Display for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl FromStr for ContentHash {
    type Err = NotAStoreHash;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        text.parse::<StoreHash>().map(|hash| Self(hash.0))
    }
}

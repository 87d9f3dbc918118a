//! Typed identities: no bare integer is an identity.

use std::fmt;
use std::str::FromStr;

/// A brick's position in the brick grid, `[x, y, z]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BrickIndex(pub [u32; 3]);

/// A chunk's position in the chunk grid, `[x, y, z]`. A chunk is a cube of bricks that moves between nodes as one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChunkIndex(pub [u32; 3]);

/// A node of the canonical merge tree as a heap path: the root is 1, the children of `n` are `2 n` (low side) and
/// `2 n + 1` (high side). Splits go x, y, z, x, ... from the root down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TreeNode(pub u64);

/// A compositor's session with its nodes: a random number, so that no two have the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct SessionId(pub u64);

/// One rendering of one view; unique within a compositor's session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FrameId(pub u64);

/// Version of the chunk-to-node table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Epoch(pub u64);

/// A store is known by the 128-bit xxh3 hash of its manifest; written as 32 lower-case hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct StoreHash(pub u128);

impl StoreHash {
    /// The hash of a manifest's bytes.
    #[must_use]
    pub fn of(manifest: &[u8]) -> Self {
        Self(xxhash_rust::xxh3::xxh3_128(manifest))
    }
}

impl fmt::Display for StoreHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// A text that is not a store hash.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a store hash (32 hexadecimal digits)")]
pub struct NotAStoreHash(pub String);

impl FromStr for StoreHash {
    type Err = NotAStoreHash;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let all_hex = text.len() == 32 && text.bytes().all(|b| b.is_ascii_hexdigit());
        match u128::from_str_radix(text, 16) {
            Ok(value) if all_hex => Ok(Self(value)),
            _ => Err(NotAStoreHash(text.chars().take(64).collect())),
        }
    }
}

impl fmt::Display for BrickIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {}, {})", self.0[0], self.0[1], self.0[2])
    }
}

impl fmt::Display for ChunkIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {}, {})", self.0[0], self.0[1], self.0[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn store_hash_survives_its_text() {
        let hash = StoreHash::of(b"manifest");
        assert_eq!(hash.to_string().parse(), Ok(hash));
        assert!("+0000000000000000000000000000001".parse::<StoreHash>().is_err());
        assert!("12".parse::<StoreHash>().is_err());
    }
}

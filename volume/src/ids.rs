//! Typed identities: no bare integer is an identity.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

/// A brick's position in the brick grid, `[x, y, z]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BrickIndex(pub [u32; 3]);

impl BrickIndex {
    /// The brick of the next coarser level in which it lies.
    #[must_use]
    pub fn coarser(self) -> Self {
        Self(self.0.map(|v| v / 2))
    }
}

/// A chunk's position in the chunk grid, `[x, y, z]`. A chunk is a cube of bricks that moves between nodes as one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChunkIndex(pub [u32; 3]);

/// A chunk by its place in tables over all chunks of a store, x fastest: [`crate::MergeTree::chunk_id`] gives it,
/// [`crate::MergeTree::chunk_at`] takes it back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize)]
#[serde(transparent)]
pub struct ChunkId(u32);

impl ChunkId {
    /// For the doors: the merge tree's numbering, the wire, and tests.
    #[must_use]
    pub const fn new(linear: u32) -> Self {
        Self(linear)
    }

    /// The place as it travels.
    #[must_use]
    pub const fn linear(self) -> u32 {
        self.0
    }

    /// The place as an index.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// A brick by its level of detail and its place in tables over all bricks of that level, x fastest:
/// [`crate::BrickGrid::id`] gives it, [`crate::BrickGrid::index_of`] takes it back. Level 0 is the finest, the store's
/// own voxels; nobody names bricks of others yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BrickId {
    level: u8,
    linear: u32,
}

impl BrickId {
    /// A brick of level 0. For the doors: the brick grid's numbering, the wire, and tests.
    #[must_use]
    pub const fn finest(linear: u32) -> Self {
        Self { level: 0, linear }
    }

    #[must_use]
    pub const fn level(self) -> u8 {
        self.level
    }

    /// The place in its level as it travels.
    #[must_use]
    pub const fn linear(self) -> u32 {
        self.linear
    }

    /// The place in its level as an index.
    #[must_use]
    pub const fn index(self) -> usize {
        self.linear as usize
    }
}

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

impl fmt::Display for ChunkId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Its place alone, while there is one level.
impl fmt::Display for BrickId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.linear.fmt(f)
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

    #[test]
    fn ids_read_as_their_numbers() {
        assert_eq!((ChunkId::new(7).to_string(), BrickId::finest(9).to_string()), ("7".to_owned(), "9".to_owned()));
        assert_eq!(serde_json::to_string(&[ChunkId::new(3), ChunkId::new(5)]).unwrap(), "[3,5]");
    }

    #[test]
    fn bricks_are_in_order_by_level_then_by_place() {
        let coarse = BrickId { level: 1, linear: 0 };
        assert!(BrickId::finest(1) < BrickId::finest(2) && BrickId::finest(2) < coarse);
    }
}

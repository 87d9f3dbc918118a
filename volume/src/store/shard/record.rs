//! What the table of shards says of one of them.

use crate::store::hash::ContentHash;

/// One line of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ShardRecord {
    /// Length of the file.
    pub(crate) bytes: u64,
    /// Hash of the whole file.
    pub(crate) hash: ContentHash,
    /// Hash of its end, see [`super::tail`]: with that, a read notices every chunk that is not this store's.
    pub(crate) tail_hash: ContentHash,
}

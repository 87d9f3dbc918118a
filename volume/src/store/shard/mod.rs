//! Shards: files of inner chunks, their ends, and the table of them.

pub(super) mod grid;
pub(super) mod open;
pub(super) mod read;
pub(super) mod record;
pub(super) mod table;
pub(super) mod tail;
pub(super) mod write;

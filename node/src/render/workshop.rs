//! What rendering needs of its node, and what bounds it.

use brickcast_volume::SessionId;
use brickcast_volume::store::ChunkCache;

use super::pace::Pace;
use super::tables::TableCache;
use crate::brick::residency::Residency;
use crate::error::NodeError;
use crate::kernel::{Pulse, Raycaster};

/// Bytes of accumulators that are begun at a time.
pub const MAX_BATCH_BYTES: u64 = 256 << 20;
/// Pixels of a layer worked on at once.
pub const MAX_BAND_PIXELS: u64 = 4 << 20;

/// What rendering needs of its node.
#[derive(Debug, Clone, Copy)]
pub struct Workshop<'a> {
    pub raycaster: &'a dyn Raycaster,
    pub residency: &'a Residency,
    pub cache: &'a ChunkCache,
    pub tables: &'a TableCache,
    pub pace: &'a Pace,
    pub pulse: &'a Pulse,
    /// Whose bricks they are.
    pub session: SessionId,
}

/// The turn to work, of which the one who renders has one.
pub trait Turns {
    /// Does somebody else wait for it?
    fn are_wanted(&self) -> bool;

    /// Lets the others have theirs, and waits for the next. No brick may be held meanwhile.
    ///
    /// # Errors
    /// Nobody wants the frame any more.
    fn give_way(&self) -> Result<(), NodeError>;
}

//! How far the making or the reading of a store is.

/// What [`crate::store::prepare`] or [`crate::store::Store::verify`] is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// An input of large planes that can only be read in order is unpacked into a scratch file.
    Unpack,
    /// First pass over an input of 32 or 64 bits: its bounds.
    Scan,
    /// Voxels are read, compressed and written.
    Write,
    /// Coarser levels are compressed and written.
    Levels,
    /// A flood fill in memory, where one was asked for.
    Flood,
    /// Distances to other labels: a sweep forward, a sweep backward.
    Distances,
    /// Components are told apart.
    Regions,
    /// Labels and distances are compressed and written; once more where small regions had to go.
    Labels,
    /// The last files are written and all is brought to the disk.
    Finish,
    /// A finished store is read and checked.
    Verify,
}

/// How far it is: bytes for verify, z-planes while regions are found, voxels for all else; of the level that it is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    pub phase: Phase,
    pub done: u64,
    pub total: u64,
}

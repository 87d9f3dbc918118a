//! Preparing a store in parts.

use brickcast_volume::store::PartNumber;
use clap::Args;

/// How a store is prepared by several machines, or by one that may be killed.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Preparing in parts")]
pub struct PartArgs {
    /// Make part I of N, from 0 to N - 1: slabs of z that may be made in any order, at the same time, and by several
    /// machines that share the folder. They lie beside the store until --merge
    #[arg(long, value_name = "I/N", conflicts_with_all = ["merge", "resume"])]
    pub shard: Option<PartNumber>,
    /// Look only for the smallest and the largest voxel of the part: inputs of 32 and 64 bits want this of all parts
    /// before the first is made
    #[arg(long, requires = "shard")]
    pub scan: bool,
    /// Make the store of all its parts, with the same options as they: the same bytes as in one go
    #[arg(long, conflicts_with = "resume")]
    pub merge: bool,
    /// Keep what is finished should this be killed, and go on from what an earlier --resume finished
    #[arg(long)]
    pub resume: bool,
}

impl PartArgs {
    /// True where a store is not made in one go.
    #[must_use]
    pub fn is_some(&self) -> bool {
        self.shard.is_some() || self.merge || self.resume
    }
}

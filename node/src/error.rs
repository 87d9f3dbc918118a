//! Everything that can go wrong on a node, and what the other side is told.

use std::path::PathBuf;

use brickcast_proto::{Failure, Fault, UnreadableBrick};
use brickcast_remote::PlaceError;
use brickcast_volume::pixel::KindError;
use brickcast_volume::store::StoreError;
use brickcast_volume::visibility::ViewError;
use brickcast_volume::{BrickId, BrickIndex, ChunkId, StoreHash, TreeNode};

use crate::brick::shares::{MemoryShares, Need};
use crate::config::format_bytes;
use crate::kernel::RaycastError;

#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    #[error("data root {}: {source}; --data names a folder with stores", path.display())]
    DataRoot { path: PathBuf, source: std::io::Error },
    #[error("--data: {0}")]
    Place(#[from] PlaceError),
    #[error("no store with hash {hash} here; {there}")]
    UnknownStore { hash: StoreHash, there: String },
    #[error("no store named `{name}` here; {there}")]
    UnknownName { name: String, there: String },
    #[error("store name `{name}`: {why}; names are paths below the node's --data, such as `scans/walnut`")]
    BadName { name: String, why: &'static str },
    #[error(
        "store `{name}` has hash {got} here, not {want}: another content under the same name; copy the store again"
    )]
    OtherContent { name: String, got: StoreHash, want: StoreHash },
    #[error(
        "store `{name}`: {} lies behind a link that leads out of the node's --data, which is never followed, or that \
         was put there just now; copy the file itself",
        file.display()
    )]
    Outside { name: String, file: PathBuf },
    #[error("store `{name}`: {source}")]
    Store { name: String, source: StoreError },
    #[error("store `{name}`: {source}")]
    Unreadable { name: String, brick: UnreadableBrick, source: StoreError },

    #[error("store `{name}` has no coarser level than this, and the order says that its chunks meet one")]
    NoCoarserLevel { name: String },
    #[error("level {level} of store `{name}` is not what the store says of it, or the store has no such level")]
    OtherLevel { name: String, level: u8 },
    #[error("chunk {0} is in none of the order's parts")]
    NoPart(ChunkId),
    #[error("layer {} is no node of this store's merge tree, or has no chunks", .0.0)]
    NoSuchLayer(TreeNode),
    #[error("chunk {chunk} is beyond the store's last, {last}")]
    NoSuchChunk { chunk: ChunkId, last: u64 },
    #[error("chunk {chunk} does not lie under layer {}, which orders it", .layer.0)]
    ChunkElsewhere { chunk: ChunkId, layer: TreeNode },
    #[error("brick {brick} is beyond the store's last, {last}")]
    NoSuchBrick { brick: BrickId, last: u64 },
    #[error(transparent)]
    View(#[from] ViewError),
    #[error("a step of {delta} world units is {ratio:e} opacity units of {unit}: must lie between 1e-9 and 1e6")]
    OpacityUnit { delta: f64, unit: f64, ratio: f64 },

    #[error(
        "brick {brick} needs {}, and {} while it is loaded; the node's memory budget has {} for bricks: raise \
         --memory-budget to {}, or prepare the store with a smaller --brick",
        format_bytes(need.bytes),
        format_bytes(need.loading),
        format_bytes(*budget),
        format_bytes(MemoryShares::least_for(need.bytes.saturating_add(need.loading)))
    )]
    BrickTooLarge { brick: BrickIndex, need: Need, budget: u64 },
    #[error(
        "chunk {chunk} needs {} at once for intervals in exact mode, the node's memory budget has {} for bricks; raise \
         --memory-budget, or leave out --exact",
        format_bytes(*bytes),
        format_bytes(*budget)
    )]
    ChunkTooLarge { chunk: ChunkId, bytes: u64, budget: u64 },
    #[error("bricks of {} are wanted at once, the memory budget has {}", format_bytes(*bytes), format_bytes(*budget))]
    BatchTooLarge { bytes: u64, budget: u64 },
    #[error(transparent)]
    Raycast(RaycastError),

    #[error("{0} orders wait already; try again later")]
    Busy(usize),
    #[error("{0} frames of this client are open already; take them, or try again later")]
    TooManyFrames(usize),
    #[error("{0} calls of this client load bricks already; try again later")]
    TooManyLoads(usize),
    #[error("{0} questions of this client are open already; take the answers, or try again later")]
    TooManyQuestions(usize),
    #[error("requests of this client hold the {0} bytes that one client's may; take the answers, or try again later")]
    TooManyBytesOfClient(usize),
    #[error("requests of all clients hold the {0} bytes that they may together; try again later")]
    TooManyBytes(usize),
    #[error("nothing more of the request came for {0} s; look at the network, or try again later")]
    Silent(u64),
    #[error("the request was not there as a whole after {0} s; look at the network, or try again later")]
    Unfinished(u64),
    #[error("the request has more than the {0} bytes that this call takes")]
    TooLong(usize),
    #[error("the node is shutting down and takes no more orders")]
    Draining,
    #[error("the client took no part of the frame for {0} s")]
    Stalled(u64),
    #[error("the client went away")]
    Cancelled,
    #[error("{0}; the node goes on, please report it")]
    Kind(#[from] KindError),
    #[error("the node's work failed unexpectedly ({0}); the node goes on, please report it")]
    Panicked(String),
}

impl NodeError {
    /// What went wrong with the store `name`.
    pub(crate) fn of_store(name: &str, source: StoreError) -> Self {
        let name = name.to_owned();
        match source {
            StoreError::Outside { file } => Self::Outside { name, file },
            StoreError::Unwanted => Self::Cancelled,
            source => Self::Store { name, source },
        }
    }

    /// What went wrong with a brick of the store `name`.
    pub(crate) fn of_brick(name: &str, brick: UnreadableBrick, source: StoreError) -> Self {
        match Self::of_store(name, source) {
            Self::Store { name, source } => Self::Unreadable { name, brick, source },
            error => error,
        }
    }

    /// For the count of refusals in the log; nothing for what is no refusal.
    pub(crate) fn refusal(&self) -> Option<&'static str> {
        Some(match self {
            Self::Busy(_) => "more orders than may wait",
            Self::TooManyFrames(_) => "more frames than one client may have open",
            Self::TooManyLoads(_) => "more loading calls than one client may have",
            Self::TooManyQuestions(_) => "more questions than one client may have",
            Self::TooManyBytesOfClient(_) => "more bytes of requests than one client may hold",
            Self::TooManyBytes(_) => "more bytes of requests than all may hold",
            Self::TooLong(_) => "a request longer than its call takes",
            Self::Silent(_) | Self::Unfinished(_) => "a request that did not come as a whole",
            _ => return None,
        })
    }

    #[must_use]
    pub fn fault(&self) -> Fault {
        match self {
            Self::UnknownStore { .. } | Self::UnknownName { .. } => Fault::UnknownStore,
            Self::OtherContent { .. } => Fault::OtherContent,
            Self::BadName { .. }
            | Self::NoCoarserLevel { .. }
            | Self::OtherLevel { .. }
            | Self::NoPart(_)
            | Self::NoSuchLayer(_)
            | Self::NoSuchChunk { .. }
            | Self::ChunkElsewhere { .. }
            | Self::NoSuchBrick { .. }
            | Self::View(_)
            | Self::TooLong(_)
            | Self::OpacityUnit { .. } => Fault::Invalid,
            Self::DataRoot { .. }
            | Self::Place(_)
            | Self::Store { .. }
            | Self::Unreadable { .. }
            | Self::Outside { .. } => Fault::BrokenStore,
            Self::BrickTooLarge { .. }
            | Self::ChunkTooLarge { .. }
            | Self::BatchTooLarge { .. }
            | Self::Raycast(RaycastError::BrickTooLarge { .. }) => Fault::BudgetTooSmall,
            Self::Raycast(_) => Fault::Device,
            Self::Busy(_)
            | Self::TooManyFrames(_)
            | Self::TooManyLoads(_)
            | Self::TooManyQuestions(_)
            | Self::TooManyBytesOfClient(_)
            | Self::TooManyBytes(_) => Fault::Busy,
            Self::Draining => Fault::Draining,
            Self::Stalled(_) | Self::Cancelled | Self::Silent(_) | Self::Unfinished(_) => Fault::Abandoned,
            Self::Kind(_) | Self::Panicked(_) => Fault::Internal,
        }
    }
}

impl From<RaycastError> for NodeError {
    fn from(error: RaycastError) -> Self {
        match error {
            RaycastError::Cancelled => Self::Cancelled,
            error => Self::Raycast(error),
        }
    }
}

impl From<NodeError> for Failure {
    fn from(error: NodeError) -> Self {
        let unreadable = match &error {
            NodeError::Unreadable { brick, .. } => Some(*brick),
            _ => None,
        };
        Self { unreadable, ..Self::new(error.fault(), error.to_string()) }
    }
}

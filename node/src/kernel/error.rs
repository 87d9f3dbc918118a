//! Everything that can go wrong in a backend.

use brickcast_volume::brick::OwnedBox;
use brickcast_volume::regions::RegionTexelsError;
use brickcast_volume::{PixelKind, PixelRect, StoredBox};

use super::recipe::Recipe;
use super::watch::Cancelled;

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RaycastError {
    #[error(transparent)]
    Regions(#[from] RegionTexelsError),
    #[error(
        "recipe {0:?} needs the brick's regions; prepare the store with regions, or leave out leaping and region views"
    )]
    NoRegions(Recipe),
    #[error("macrocells of {0} voxels: 4 and 8 are possible")]
    MacrocellEdge(u8),
    #[error("a brick's stored box of {dims:?} voxels came with {got} codes in place of {want}")]
    VoxelCount { dims: [u32; 3], got: usize, want: u64 },
    #[error(
        "a brick's stored box {stored:?} must reach one voxel beyond its owned box {owned:?} on every side: read it \
         with a ghost layer of at least 1"
    )]
    MissingGhost { owned: OwnedBox, stored: StoredBox },
    #[error(
        "a brick of {dims:?} voxels (ghost layers included) exceeds the {max} per axis of the adapter's 3D textures; \
         prepare the store with a smaller --brick, or use --backend cpu"
    )]
    BrickTooLarge { dims: [u32; 3], max: u32 },
    #[error("a job's rectangle {rect:?} reaches beyond the picture of {width}x{height}")]
    RectOutsidePicture { rect: PixelRect, width: u32, height: u32 },
    #[error("what lies in front of a job are {got} pixels: {want} of {kind:?} are needed")]
    Front { got: usize, want: usize, kind: PixelKind },
    #[error("a transfer function table of {entries} entries: between 2 and {max} are needed")]
    TableSize { entries: usize, max: u32 },
    #[error("a brick that another backend uploaded was given to the {backend} raycaster: upload it there first")]
    ForeignBrick { backend: &'static str },
    #[error("out of memory for {what} ({bytes} bytes); lower --memory-budget or the picture's size")]
    OutOfMemory { what: &'static str, bytes: u64 },
    #[error("the GPU device was lost ({reason}); restart the node, or use --backend cpu")]
    DeviceLost { reason: String },
    #[error(
        "the GPU did not finish {what} within {seconds} s; the driver may hang: restart the node, or use --backend cpu"
    )]
    Timeout { what: &'static str, seconds: u64 },
    #[error("the GPU refused {what}: {reason}")]
    Gpu { what: &'static str, reason: String },
    #[error("nobody wants the picture any more")]
    Cancelled,
}

impl From<Cancelled> for RaycastError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

impl RaycastError {
    /// True where the same call may succeed later on this very raycaster (memory may have been freed).
    #[must_use]
    pub fn is_retryable(&self) -> bool {
        matches!(self, Self::OutOfMemory { .. })
    }
}

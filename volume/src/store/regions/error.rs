//! What can go wrong with regions.

use crate::ids::BrickIndex;
use crate::regions::{MAX_FLOOD_VOXELS, MAX_REGIONS};
use crate::store::hash::ContentHash;

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RegionsError {
    #[error("a segmentation range of {0}: must be above 0 and at most 1, a share of the store's range")]
    SegmentationRange(f64),
    #[error("the label volume has {got:?} voxels, the volume {want:?}; labels must lie on the volume's own grid")]
    LabelDims { got: [u32; 3], want: [u32; 3] },
    #[error(
        "the label volume lies elsewhere than the volume: it has {got}, the volume {want}. Labels must lie on the \
         volume's own grid, in its order: resample them to it, or correct the header that is wrong"
    )]
    LabelPlace { got: String, want: String },
    #[error(
        "the label volume holds {got}; labels must be whole numbers: uint8, int8, uint16, int16, uint32, int32, uint64 \
         or int64"
    )]
    LabelType { got: &'static str },
    #[error("the label volume holds the label {got}; labels must fit into 32 bits: number them anew")]
    LabelValue { got: i128 },
    #[error("the label volume has more than {max} labels; leave those of few voxels out (0 is no region)")]
    TooManyLabels { max: usize },
    #[error(
        "the flood fill found more than {max} regions; use a larger --segmentation-range, or --segmentation windows \
         with --min-region"
    )]
    TooManyFlooded { max: usize },
    #[error(
        "a flood fill of {voxels} voxels needs 6 bytes a voxel and its queue in memory, which the system does not \
         give; use --segmentation windows"
    )]
    FloodMemory { voxels: u64 },
    #[error(
        "a flood fill holds the whole volume in memory and takes at most {MAX_FLOOD_VOXELS} voxels, not {voxels}; \
         use --segmentation windows"
    )]
    FloodTooLarge { voxels: u64 },
    #[error(
        "regions hold whole planes: this volume needs at least {need} bytes of memory for them, {available} are free; \
         prepare it without --segmentation-range and --labels, or use a machine with more"
    )]
    Memory { need: u64, available: u64 },
    #[error("the volume has more than {MAX_REGIONS} regions; leave small ones out with a larger --min-region")]
    TooManyRegions,
    #[error(
        "{others} labels lie beside others under the voxels of one plane of level {level}, at most {most} can be \
         counted: if they are no regions, leave --labels out, else make no level as coarse as this one: --levels {}",
        level.saturating_sub(1)
    )]
    ScatteredLabels { level: usize, others: usize, most: usize },
    #[error("this store has no regions; prepare it with --segmentation-range")]
    None,
    #[error("the table of bricks has {got} bytes, {bricks} bricks need {want}; prepare the store again")]
    Length { got: usize, want: u64, bricks: u64 },
    #[error("the table of bricks has hash {got}, the manifest promises {want}; prepare the store again")]
    Hash { got: ContentHash, want: ContentHash },
    #[error("the table of bricks says of brick {brick} what cannot be; prepare the store again")]
    Facts { brick: BrickIndex },
    #[error("the table of regions says of region {label} what cannot be; prepare the store again")]
    Region { label: u32 },
}

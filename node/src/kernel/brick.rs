//! A brick on its way into a backend, and as the backend keeps it.

use brickcast_volume::brick::OwnedBox;
use brickcast_volume::regions::{BrickRegions, RegionTable};
use brickcast_volume::store::BrickVoxels;

use super::error::RaycastError;
use super::recipe::Recipe;

/// What a resident brick is made from.
#[derive(Debug, Clone, Copy)]
pub struct BrickInput<'a> {
    pub voxels: &'a BrickVoxels,
    /// Of the brick, at least one voxel beyond the stored box; for recipes with a guard or region flags.
    pub regions: Option<(&'a BrickRegions, &'a RegionTable)>,
    pub recipe: Recipe,
}

impl<'a> BrickInput<'a> {
    /// The voxels as they are.
    #[must_use]
    pub fn plain(voxels: &'a BrickVoxels) -> Self {
        Self { voxels, regions: None, recipe: Recipe::default() }
    }
}

/// A brick in the backend's memory; dropping it frees the memory.
pub trait ResidentBrick: Send + Sync + std::fmt::Debug {
    /// Bytes that it occupies.
    fn bytes(&self) -> u64;
    fn as_any(&self) -> &dyn std::any::Any;
}

/// What both backends demand of a brick.
pub(crate) fn check_brick(owned: &OwnedBox, voxels: &BrickVoxels) -> Result<(), RaycastError> {
    let stored = voxels.stored;
    let needed = owned.stored(brickcast_volume::brick::GHOST_SAMPLED);
    if stored.lo.cmpgt(needed.lo).any() || stored.hi.cmplt(needed.hi).any() {
        return Err(RaycastError::MissingGhost { owned: *owned, stored });
    }
    let want = stored.voxel_count();
    if voxels.codes.len() as u64 != want {
        return Err(RaycastError::VoxelCount { dims: stored.dims().into(), got: voxels.codes.len(), want });
    }
    Ok(())
}

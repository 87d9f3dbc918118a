//! Which brick, drawn how, and what it needs.

use brickcast_volume::lod::Sides;
use brickcast_volume::{BrickId, StoreHash};

use crate::brick::shares::Need;
use crate::kernel::Recipe;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BrickKey {
    pub store: StoreHash,
    pub brick: BrickId,
    /// Ghost layers on each side.
    pub ghost: u32,
    pub recipe: Recipe,
    /// Where it has the values of the next coarser level; the recipe is that of such a brick.
    pub coarser: Option<Coarser>,
}

impl BrickKey {
    /// Are labels and distances needed to load it?
    pub(crate) fn reads_regions(&self) -> bool {
        self.recipe.reads_regions() || self.coarser.is_some_and(|coarser| coarser.flattened[0])
    }
}

/// What a brick takes of the brick of the next coarser level in which it lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Coarser {
    /// Some.
    pub sides: Sides,
    /// Voxels of regions have their regions' means: in the brick itself, and in the coarser one.
    pub flattened: [bool; 2],
}

/// A brick that a batch needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted {
    pub key: BrickKey,
    /// That it is expected to occupy.
    pub bytes: u64,
    /// Bytes that loading it holds meanwhile, at most.
    pub loading: u64,
}

impl Wanted {
    #[must_use]
    pub fn need(&self) -> Need {
        Need { bytes: self.bytes, loading: self.loading }
    }
}

//! Which brick, drawn how, and what it needs.

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

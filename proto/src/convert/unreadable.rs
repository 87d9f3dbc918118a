//! Bricks that a node cannot read.

use brickcast_volume::BrickId;

use super::WireError;
use crate::status::UnreadableBrick;
use crate::wire;

impl From<UnreadableBrick> for wire::UnreadableBrick {
    fn from(UnreadableBrick { store, brick }: UnreadableBrick) -> Self {
        Self { store_hash: store.to_string(), brick: brick.linear() }
    }
}

impl TryFrom<wire::UnreadableBrick> for UnreadableBrick {
    type Error = WireError;

    fn try_from(told: wire::UnreadableBrick) -> Result<Self, WireError> {
        Ok(Self { store: told.store_hash.parse()?, brick: BrickId::finest(told.brick) })
    }
}

//! Chunks of the model: a grid of any size, of which there is no brick grid and no merge tree.

use brickcast_volume::ChunkId;
use glam::UVec3;

/// All chunks, x fastest.
pub(super) fn chunk_ids(dims: UVec3) -> impl Iterator<Item = ChunkId> {
    (0..dims.element_product()).map(ChunkId::new)
}

/// The low corner of a chunk.
pub(super) fn corner(dims: UVec3, chunk: ChunkId) -> UVec3 {
    let linear = chunk.linear();
    UVec3::new(linear % dims.x, linear / dims.x % dims.y, linear / dims.x / dims.y)
}

/// The chunk with that low corner.
pub(super) fn chunk_at(dims: UVec3, corner: UVec3) -> ChunkId {
    ChunkId::new(corner.x + dims.x * (corner.y + dims.y * corner.z))
}

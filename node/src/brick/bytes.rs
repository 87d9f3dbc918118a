//! What a brick will occupy, before it is there.

use brickcast_volume::regions::Drawn;
use brickcast_volume::scene::Scene;
use brickcast_volume::store::{CHUNK_EDGE, CHUNK_VOXELS, CHUNKS_AT_ONCE};
use brickcast_volume::{OwnedBox, StoredBox};
use glam::IVec3;

use crate::kernel::{Recipe, knows_only_region};

/// Bytes of a macrocell in either backend: its range and its texel of the map.
pub(crate) const CELL_BYTES: u64 = 8;
pub(crate) const HOMOGENEOUS_BYTES: u64 = 4;

/// [`BuiltBrick::bytes`](super::texels::BuiltBrick::bytes) before there is a brick.
pub(crate) fn expected_bytes(stored_voxels: u64, recipe: Recipe, texel_bytes: u64, cell_bytes: u64) -> u64 {
    let edge = recipe.cell_edge();
    let cells = edge.map_or(0, |edge| {
        // Cells that share a voxel with the box, which is a cube in nearly all cases.
        let along = ((stored_voxels as f64).cbrt() / f64::from(edge.max(1))).floor() as u64 + 1;
        along.pow(3) * (cell_bytes + if recipe.homogeneous.is_some() { HOMOGENEOUS_BYTES } else { 0 })
    });
    stored_voxels * (texel_bytes + u64::from(recipe.region_flags)) + cells
}

/// Of a brick of spans ([`Recipe::interval`]): codes, and where it is flattened their upper ends and distances.
pub(crate) fn interval_bytes(stored_voxels: u64, recipe: Recipe) -> u64 {
    let flattened = if recipe.guard.is_some() { 3 } else { 0 };
    stored_voxels * (2 + flattened + u64::from(recipe.region_flags))
}

/// Bytes that loading a brick holds beside the brick itself, at most: its codes, and meanwhile what they are decoded
/// from; or, of the `covered` voxels where regions are read, labels, distances and what these are decoded from; or
/// `upload` bytes on the way to a GPU. Voxels lie in the store as `stored_type` bytes each; `has_halos`: those of
/// neighbours beside them.
pub(crate) fn loading_bytes(
    owned: &OwnedBox,
    (stored, covered): (&StoredBox, Option<&StoredBox>),
    (stored_type, has_halos): (u64, bool),
    upload: u64,
) -> u64 {
    let at_once = (CHUNKS_AT_ONCE * CHUNK_VOXELS) as u64;
    // Voxels as they are fetched: inner chunks, of which one is decoded at a time; a halo's record, and it decoded.
    let fetched = |of: &StoredBox| {
        let own = owned.voxel_count();
        let along = of.dims().map(|n| n.div_ceil(CHUNK_EDGE) + 1).as_u64vec3();
        let (chunks, halo) = match has_halos {
            true => (own, 2 * of.voxel_count().saturating_sub(own)),
            false => (along.element_product().saturating_mul(CHUNK_VOXELS as u64), 0),
        };
        chunks.min(at_once) + CHUNK_VOXELS as u64 + halo
    };
    let voxels = stored_type * fetched(stored);
    let regions = covered.map_or(0, |covered| (4 + 1) * covered.voxel_count() + 4 * fetched(covered));
    2 * stored.voxel_count() + voxels.max(regions).max(upload)
}

/// Where rays of the brick may read a position: one voxel within the stored box, whose last voxel is only interpolated
/// with.
pub(crate) fn reached(owned: &OwnedBox, stored: &StoredBox) -> OwnedBox {
    let lo = (stored.lo + 1).max(IVec3::ZERO).as_uvec3();
    OwnedBox { lo: lo.min(owned.lo), hi: (stored.hi - 1).as_uvec3().max(owned.hi) }
}

impl Recipe {
    /// Bytes that a node with texels of `texel_bytes` holds of a brick that is drawn in a scene, macrocells included;
    /// at most so many where the brick may turn out to need no region flags.
    #[must_use]
    pub fn planned_bytes(scene: &Scene, owned: &OwnedBox, drawn: &Drawn, has_regions: bool, texel_bytes: u64) -> u64 {
        let ghost = scene.ghost();
        if drawn.only_region.is_some() && knows_only_region(ghost) {
            return texel_bytes;
        }
        let recipe = Self::of(scene, drawn.flattened, has_regions);
        let stored = owned.stored(ghost);
        if recipe.interval {
            return interval_bytes(stored.voxel_count(), recipe);
        }
        let cells = recipe.cell_edge().map_or(0, |edge| {
            let (reached, edge) = (reached(owned, &stored), u32::from(edge));
            let dims = (reached.hi + (edge - 1)) / edge - reached.lo / edge;
            let homogeneous = if recipe.homogeneous.is_some() { HOMOGENEOUS_BYTES } else { 0 };
            dims.as_u64vec3().element_product() * (CELL_BYTES + homogeneous)
        });
        stored.voxel_count() * (texel_bytes + u64::from(recipe.region_flags)) + cells
    }
}

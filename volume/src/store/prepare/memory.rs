//! What preparing needs, before it is asked for: a header may promise more than this machine or container has.

use crate::brick::BrickGrid;
use crate::memory::{Limit, available};
use crate::regions::components::SLAB_PLANES;
use crate::store::cell_ranges::cells_of;
use crate::store::error::StoreError;
use crate::store::halo::reach::{HaloReach, REGION_HALO, VOXEL_HALO, has_halos};
use crate::store::profile::{INDEX_BYTES, SHARD_EDGE};
use crate::store::regions::error::RegionsError;
use crate::store::shard::grid::ShardGrid;
use crate::store::shard::table::table_bytes;
use crate::store::tiles::Tiles;
use crate::store::voxel::{StoredType, Voxel};

/// Bytes for each voxel of a slab: its code, its label, its distance, and the code of one of the slab that is read
/// meanwhile. While components are found there are three slabs of codes, and two of leap voxels: less.
const SLAB_BYTES: u64 = 2 + 4 + 1 + 2;
/// Bytes for each voxel of a plane while components are told apart: the faces of blocks, and what goes on into the next
/// slab.
const PLANE_BYTES: u64 = 32;
/// Bytes of a label and a distance.
const HALO_BYTES: u64 = 4 + 1;

/// Bytes for each voxel of a plane of a tile while coarser levels are gathered: a third of what is gathered of a voxel,
/// and a quarter of it as it is written, with its bounds.
const LEVEL_BYTES: u64 = 24 / 3 + 10_u64.div_ceil(4);
/// Bytes of a cell's ranges.
const CELL_BYTES: u64 = 4 + 4;
/// Bytes that are gathered of a shard's voxels, where they lie in several voxels of the coarsest levels.
const SEAM_BYTES: u64 = 24;
/// Bytes of length and checksum of a record of a halo.
const ENTRY_BYTES: u64 = 8;
/// What does not follow the volume: pieces of the input, histograms, buffers of files.
const FIXED_BYTES: u64 = 16 << 20;

/// Bytes that the voxels of a volume need at least, whatever is in it; see [`crate::store::prepare`].
pub(crate) fn voxel_bytes(
    grid: &BrickGrid,
    shards: &ShardGrid,
    tiles: &Tiles,
    stored: StoredType,
    with_levels: bool,
) -> u64 {
    let (several, depth) = (tiles.count() > 1, u64::from(grid.volume_dims().z));
    let with_halos = has_halos(grid.brick_size());
    let reach = if with_halos { VOXEL_HALO.last } else { 0 };
    // One of them is read while the other is written, or with and without what is about it.
    let slabs = tiles.largest_slab(reach) as u64 + tiles.largest_slab(0) as u64;
    let widest = tiles.iter().map(|tile| tile.voxels() as u64).max().unwrap_or(0);
    let shells = if with_halos { widest * shell_planes(grid, VOXEL_HALO).min(2 * depth) } else { 0 };
    // Every shard of a tile's row is open at once, with its index.
    let edge = u64::from(SHARD_EDGE);
    let open = tiles.iter().map(|t| t.size().map(|n| (n as u64).div_ceil(edge)).iter().product::<u64>()).max();
    let entries = if with_halos { grid.brick_count() * VOXEL_HALO.records() as u64 * ENTRY_BYTES } else { 0 };
    // Sorting them holds them twice.
    let tables = grid.brick_count() * 4 + table_bytes(shards) + entries * if several { 2 } else { 1 };
    // Those of a level are an eighth of the next finer one's.
    let levels = if with_levels { widest * LEVEL_BYTES + shards.count() * SEAM_BYTES + tables / 7 } else { 0 };
    // Levels have the same cells, until voxels are larger.
    let cells = cells_of(grid.volume_dims(), 0);
    let of_cells = cells.count() * CELL_BYTES * if with_levels { u64::from(cells.edge.ilog2()) + 1 } else { 1 };
    (slabs + shells) * stored.bytes() as u64
        + open.unwrap_or(0) * INDEX_BYTES as u64
        + tables
        + levels
        + of_cells
        + FIXED_BYTES
}

/// Bytes that regions of a volume need at least, whatever is in it.
pub(crate) fn region_bytes(grid: &BrickGrid) -> u64 {
    let d = grid.volume_dims();
    let plane = u64::from(d.x) * u64::from(d.y);
    let of_slab = SLAB_BYTES * u64::from(SLAB_PLANES.min(d.z)) + PLANE_BYTES;
    let shells = shell_planes(grid, REGION_HALO).min(2 * u64::from(d.z));
    let of_halos = if has_halos(grid.brick_size()) { HALO_BYTES * shells } else { 0 };
    plane * (of_slab + of_halos)
}

/// Planes of voxels that the shells of a layer of bricks are; that layer and half of the next are held.
pub(super) fn shell_planes(grid: &BrickGrid, reach: HaloReach) -> u64 {
    let size = u64::from(grid.brick_size());
    let grown = size + 2 * u64::from(reach.last);
    (grown.pow(3) - size.pow(3)).div_ceil(size * size)
}

/// An error rather than a machine that swaps, or a process that is killed.
pub(crate) fn check(
    grid: &BrickGrid,
    shards: &ShardGrid,
    tiles: &Tiles,
    stored: StoredType,
    (with_levels, with_regions): (bool, bool),
) -> Result<(), StoreError> {
    let limit = available();
    check_voxels(voxel_bytes(grid, shards, tiles, stored, with_levels), limit.as_ref())?;
    match with_regions {
        true => Ok(check_regions(region_bytes(grid), limit.as_ref())?),
        false => Ok(()),
    }
}

fn check_voxels(need: u64, limit: Option<&Limit>) -> Result<(), StoreError> {
    match limit {
        Some(Limit { bytes, by }) if need > *bytes => {
            Err(StoreError::TooLittleMemory { need, available: *bytes, by: by.to_string() })
        }
        _ => Ok(()),
    }
}

fn check_regions(need: u64, limit: Option<&Limit>) -> Result<(), RegionsError> {
    match limit {
        Some(Limit { bytes: available, .. }) if need > *available => {
            Err(RegionsError::Memory { need, available: *available })
        }
        _ => Ok(()),
    }
}

/// An error rather than an abort where a header promises planes of more voxels than fit.
pub(crate) fn zeroed_slab<T: Voxel>(voxels: usize) -> Result<Vec<T>, StoreError> {
    let bytes = voxels as u64 * size_of::<T>() as u64;
    let mut slab = Vec::new();
    slab.try_reserve_exact(voxels).map_err(|_| StoreError::Memory { bytes })?;
    slab.resize(voxels, T::zeroed());
    Ok(slab)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::LimitBy;
    use crate::store::tiles::MAX_TILE_VOXELS;
    use glam::UVec3;

    #[test]
    fn the_need_follows_the_plane_and_not_the_depth() {
        let need = |dims: [u32; 3], size| region_bytes(&BrickGrid::new(UVec3::from(dims), size).unwrap());
        let per_voxel = |n: u32, depth, size| need([n, n, depth], size) / u64::from(n * n);
        assert_eq!(per_voxel(2048, 100, 64), per_voxel(4096, 1000, 64));
        // docs/reference/store-format.md names what halos take.
        assert_eq!(per_voxel(2048, 100, 8), 9 * 32 + 32);
        assert_eq!(per_voxel(2048, 100, 64), 9 * 32 + 32 + 175);
        assert!(per_voxel(2048, 4, 64) < 110);
    }

    #[test]
    fn more_than_there_is_is_refused_with_both_figures() {
        let limit = |bytes| Limit { bytes, by: LimitBy::Machine };
        assert_eq!(check_regions(100, Some(&limit(100))), Ok(()));
        assert_eq!(check_regions(100, None), Ok(()));
        let error = check_regions(5 << 30, Some(&limit(1 << 30))).unwrap_err().to_string();
        assert!(error.contains("5368709120") && error.contains("1073741824"), "{error}");
        assert!(check_voxels(100, Some(&limit(100))).is_ok() && check_voxels(100, None).is_ok());
        let error = check_voxels(5 << 30, Some(&limit(1 << 30))).unwrap_err().to_string();
        assert!(error.contains("5368709120") && error.contains("1073741824") && error.contains("machine"), "{error}");
    }

    /// A plane of 64 GiB is prepared like any other: what it needs does not follow it but for its tables.
    #[test]
    fn one_gigantic_plane_needs_what_a_tile_needs() {
        let need = |dims: [u32; 3], size| {
            let (dims, stored) = (UVec3::from(dims), StoredType::U16);
            let (grid, shards) = (BrickGrid::new(dims, size).unwrap(), ShardGrid::new(dims).unwrap());
            voxel_bytes(&grid, &shards, &Tiles::new(&grid, MAX_TILE_VOXELS), stored, true)
        };
        assert!(need([1 << 18, 1 << 18, 1], 128) < 600 << 20, "{}", need([1 << 18, 1 << 18, 1], 128));
        assert!(need([1 << 13, 1 << 13, 512], 64) < 700 << 20, "{}", need([1 << 13, 1 << 13, 512], 64));
        assert!(need([64, 64, 64], 64) < 20 << 20, "{}", need([64, 64, 64], 64));
        // docs/adr/0011-memory-of-preparing.md names what 16 planes and the shells of a tile of 4 Mi are.
        assert!(need([1 << 11, 1 << 11, 512], 64) > (4 << 20) * 2 * (16 + 20), "{}", need([1 << 11, 1 << 11, 512], 64));
    }
}

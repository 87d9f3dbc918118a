//! The shards of an open store.

use std::sync::Arc;

use super::grid::ShardGrid;
use super::read::Shards;
use super::table;
use super::tail::TailLayout;
use crate::store::codec;
use crate::store::error::StoreError;
use crate::store::hash::ContentHash;
use crate::store::lacking::Lacking;
use crate::store::level::LevelArray;
use crate::store::objects::Objects;
use crate::store::profile::CHUNK_VOXELS;

/// The shards of an array, after checking their table; `lacking` takes the first that is not there in its full length.
/// Far ones are not looked at, a round trip each: one that is missing is found when it is read.
pub(crate) fn open_shards(
    objects: &Arc<dyn Objects>,
    array: LevelArray,
    grid: ShardGrid,
    table: (&str, ContentHash, TailLayout),
    voxel_bytes: usize,
    lacking: &mut Lacking,
) -> Result<Shards, StoreError> {
    let shards = described_shards(objects, array, grid, table, voxel_bytes)?;
    if !objects.is_far() {
        for linear in 0..shards.table.len() {
            lacking.tolerate(shards.open_whole(grid.at(linear)))?;
        }
    }
    Ok(shards)
}

/// The same, whether or not the shards are there.
pub(crate) fn described_shards(
    objects: &Arc<dyn Objects>,
    array: LevelArray,
    grid: ShardGrid,
    (table_file, table_hash, layout): (&str, ContentHash, TailLayout),
    voxel_bytes: usize,
) -> Result<Shards, StoreError> {
    let table = objects.read_exactly(table_file, table::table_bytes(&grid))?;
    objects.check_hash(table_file, &table, table_hash)?;
    let table = table::from_bytes(array, &grid, &table, codec::encoded_bound(CHUNK_VOXELS * voxel_bytes), layout)?;
    Ok(Shards::new(objects.clone(), array, grid, (table, layout), voxel_bytes))
}

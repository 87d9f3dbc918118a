//! Bricks from the store into the backend's memory.

use std::sync::Arc;
use std::time::Instant;

use brickcast_volume::regions::Region;
use brickcast_volume::store::{BrickSource, ChunkCache};

use super::meter::LoadMeter;
use super::workshop::Workshop;
use crate::brick::residency::{BrickKey, Lease, Load, Wanted};
use crate::error::NodeError;
use crate::interval::IntervalBrick;
use crate::kernel::{BrickInput, Raycaster, ResidentBrick, knows_only_region};
use crate::stores::OpenStore;
use crate::stores::far::reading;

/// Holds `wanted`, loading what is missing from the store through the shared cache of decoded chunks.
pub(crate) fn load_bricks<'a>(
    wanted: &[Wanted],
    store: &OpenStore,
    workshop: Workshop<'a>,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<(Lease<'a>, LoadMeter), NodeError> {
    let (started, decoded) = (Instant::now(), workshop.cache.decoded_bytes());
    let load = |key: BrickKey| {
        workshop.pulse.beat();
        load_brick(key, store, workshop.raycaster, workshop.cache)
    };
    let load: &Load<'_> = &load;
    let lease = || workshop.residency.lease(workshop.session, wanted, load, cancelled);
    let lease = reading(store.store.is_far(), lease)?;
    let meter = if lease.loaded().is_empty() {
        LoadMeter::default()
    } else {
        let manifest = store.store.manifest();
        let grid = manifest.grid;
        let owned = |key: &BrickKey| {
            let voxels = grid.owned_box(grid.index_of(key.brick)).voxel_count();
            voxels * bytes_read(key, &*store.store)
        };
        LoadMeter {
            time: started.elapsed(),
            decoded_bytes: workshop.cache.decoded_bytes().saturating_sub(decoded),
            owned_bytes: lease.loaded().iter().map(owned).sum(),
        }
    };
    Ok((lease, meter))
}

/// The region that a flattened brick lies in with all that it stores, if it does: its mean is all there is to load.
fn only_region(key: &BrickKey, store: &dyn BrickSource) -> Option<Region> {
    key.recipe.guard.filter(|_| knows_only_region(key.ghost))?;
    let facts = store.brick_facts()?.get(key.brick.index())?;
    store.region_table()?.get(facts.only_region).copied()
}

/// Bytes that a voxel of the brick has in the arrays that are read for it.
fn bytes_read(key: &BrickKey, store: &dyn BrickSource) -> u64 {
    if only_region(key, store).is_some() {
        return 0;
    }
    // Labels are 32 bits, distances 8.
    let regions = key.recipe.guard.is_some() || key.recipe.region_flags;
    store.manifest().stored_type.bytes() as u64 + if regions { 5 } else { 0 }
}

fn load_brick(
    key: BrickKey,
    store: &OpenStore,
    raycaster: &dyn Raycaster,
    cache: &ChunkCache,
) -> Result<Arc<dyn ResidentBrick>, NodeError> {
    let broken = |source| NodeError::of_store(&store.name, source);
    let (grid, recipe, store) = (store.store.manifest().grid, key.recipe, &*store.store);
    let index = grid.index_of(key.brick);
    let owned = grid.owned_box(index);
    let table = match recipe.guard.is_some() || recipe.region_flags {
        true => store.region_table(),
        false => None,
    };
    if let Some(region) = only_region(&key, store) {
        return match recipe.interval {
            true => Ok(Arc::new(IntervalBrick::uniform(&owned, &region))),
            false => Ok(raycaster.upload_uniform(owned, region.mean())?),
        };
    }
    let voxels = store.read_brick(index, key.ghost, cache).map_err(broken)?;
    // Inner guards look one voxel further.
    let regions = match table {
        Some(table) => Some((
            store.read_brick_regions(index, key.ghost + 1 + u32::from(recipe.radius), cache).map_err(broken)?,
            table,
        )),
        None => None,
    };
    let regions = regions.as_ref().map(|(regions, table)| (regions, *table));
    let input = BrickInput { voxels: &voxels, regions, recipe };
    match recipe.interval {
        true => Ok(Arc::new(IntervalBrick::new(owned, &input)?)),
        false => Ok(raycaster.upload(owned, &input)?),
    }
}

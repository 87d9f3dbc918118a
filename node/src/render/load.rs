//! Bricks from the store into the backend's memory.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use brickcast_volume::regions::Region;
use brickcast_volume::store::{BrickSource, ChunkCache};

use super::meter::LoadMeter;
use super::pace::thread_time;
use super::workshop::Workshop;
use crate::brick::residency::{Ask, BrickKey, Lease, Load};
use crate::error::NodeError;
use crate::interval::IntervalBrick;
use crate::kernel::{BrickInput, Raycaster, Recipe, ResidentBrick, knows_only_region};
use crate::stores::OpenStore;
use crate::stores::far::reading;

/// Holds what is asked for, loading what is missing from the store through the shared cache of decoded chunks.
pub(crate) fn load_bricks<'a>(
    ask: Ask<'_>,
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
    let lease = || workshop.residency.lease(ask, load, cancelled);
    let lease = reading(store.store.is_far(), lease)?;
    let meter = match lease.loaded() {
        [] => LoadMeter::default(),
        loaded => LoadMeter { time: started.elapsed(), ..metered(loaded, store, workshop, decoded) },
    };
    Ok((lease, meter))
}

/// Loads what is asked for as far as there is room, while others render: none of its time is waited for, and what it
/// takes of the processor is added to `nanos`. What fails is left to whoever needs the brick.
pub(crate) fn fetch_ahead(
    ask: Ask<'_>,
    store: &OpenStore,
    workshop: Workshop<'_>,
    cancelled: &(dyn Fn() -> bool + Sync),
    nanos: &AtomicU64,
) -> LoadMeter {
    let decoded = workshop.cache.decoded_bytes();
    // Also where it ends early.
    let loaded = Mutex::new(Vec::new());
    let load = |key: BrickKey| {
        workshop.pulse.beat();
        let before = thread_time();
        let brick = load_brick(key, store, workshop.raycaster, workshop.cache)?;
        let took = thread_time().saturating_sub(before);
        nanos.fetch_add(u64::try_from(took.as_nanos()).unwrap_or(u64::MAX), Ordering::Relaxed);
        loaded.lock().unwrap_or_else(PoisonError::into_inner).push(key);
        Ok(brick)
    };
    let load: &Load<'_> = &load;
    let _ = reading(store.store.is_far(), || workshop.residency.fetch_ahead(ask, load, cancelled));
    let loaded = loaded.lock().unwrap_or_else(PoisonError::into_inner);
    metered(&loaded, store, workshop, decoded)
}

/// What was loaded since so much was `decoded`; no time.
fn metered(loaded: &[BrickKey], store: &OpenStore, workshop: Workshop<'_>, decoded: u64) -> LoadMeter {
    let grid = store.store.manifest().grid;
    let owned = |key: &BrickKey| {
        let voxels = grid.owned_box(grid.index_of(key.brick)).voxel_count();
        voxels * bytes_read(key, &*store.store)
    };
    LoadMeter {
        time: Duration::ZERO,
        decoded_bytes: workshop.cache.decoded_bytes().saturating_sub(decoded),
        owned_bytes: loaded.iter().map(owned).sum(),
    }
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
    store.manifest().stored_type.bytes() as u64 + if key.recipe.reads_regions() { 5 } else { 0 }
}

/// Voxels beyond the owned box whose regions are read: inner guards look one further.
pub(super) fn region_margin(ghost: u32, recipe: Recipe) -> u32 {
    ghost + 1 + u32::from(recipe.radius)
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
    let table = if recipe.reads_regions() { store.region_table() } else { None };
    if let Some(region) = only_region(&key, store) {
        return match recipe.interval {
            true => Ok(Arc::new(IntervalBrick::uniform(&owned, &region))),
            false => Ok(raycaster.upload_uniform(owned, region.mean())?),
        };
    }
    let voxels = store.read_brick(index, key.ghost, cache).map_err(broken)?;
    let regions = match table {
        Some(table) => {
            let margin = region_margin(key.ghost, recipe);
            Some((store.read_brick_regions(index, margin, cache).map_err(broken)?, table))
        }
        None => None,
    };
    let regions = regions.as_ref().map(|(regions, table)| (regions, *table));
    let input = BrickInput { voxels: &voxels, regions, recipe };
    match recipe.interval {
        true => Ok(Arc::new(IntervalBrick::new(owned, &input)?)),
        false => Ok(raycaster.upload(owned, &input)?),
    }
}

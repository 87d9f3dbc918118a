//! Bricks from the store into the backend's memory.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use brickcast_proto::UnreadableBrick;
use brickcast_volume::brick::BrickVoxels;
use brickcast_volume::lod::take_coarser;
use brickcast_volume::regions::{BrickRegions, Region, RegionTable};
use brickcast_volume::store::{BrickSource, ChunkCache};
use brickcast_volume::{BrickIndex, StoreHash};

use super::meter::LoadMeter;
use super::pace::thread_time;
use super::workshop::Workshop;
use crate::brick::residency::{Ask, BrickKey, Coarser, Lease, Load};
use crate::brick::texels::flattened;
use crate::error::NodeError;
use crate::interval::IntervalBrick;
use crate::kernel::{BrickInput, Raycaster, Recipe, ResidentBrick, knows_only_region};
use crate::stores::far::reading;
use crate::stores::{OpenStore, Source};

/// Holds what is asked for, loading what is missing from the store through the shared cache of decoded chunks.
pub(crate) fn load_bricks<'a>(
    ask: Ask<'_>,
    sources: &[Source<'_>],
    workshop: Workshop<'a>,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<(Lease<'a>, LoadMeter), NodeError> {
    let (started, decoded) = (Instant::now(), workshop.cache.decoded_bytes());
    let load = |key: BrickKey| {
        workshop.pulse.beat();
        load_brick(key, of_brick(&key, sources)?, workshop.raycaster, workshop.cache)
    };
    let load: &Load<'_> = &load;
    let lease = || workshop.residency.lease(ask, load, cancelled);
    let lease = reading(are_far(sources), lease)?;
    let meter = match lease.loaded() {
        [] => LoadMeter::default(),
        loaded => LoadMeter { time: started.elapsed(), ..metered(loaded, sources, workshop, decoded) },
    };
    Ok((lease, meter))
}

/// Loads what is asked for, for frames to come, as far as there is room without bricks of the stores `keep` going for
/// it; it waits for nobody.
pub(crate) fn load_beside(
    ask: Ask<'_>,
    keep: &[StoreHash],
    sources: &[Source<'_>],
    workshop: Workshop<'_>,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<LoadMeter, NodeError> {
    let (started, decoded) = (Instant::now(), workshop.cache.decoded_bytes());
    let load = |key: BrickKey| {
        workshop.pulse.beat();
        load_brick(key, of_brick(&key, sources)?, workshop.raycaster, workshop.cache)
    };
    let load: &Load<'_> = &load;
    let fetch = || workshop.residency.fetch_beside(ask, keep, load, cancelled);
    let loaded = reading(are_far(sources), fetch)?;
    Ok(LoadMeter { time: started.elapsed(), ..metered(&loaded, sources, workshop, decoded) })
}

/// Loads what is asked for as far as there is room, while others render: none of its time is waited for, and what it
/// takes of the processor is added to `nanos`. What fails is left to whoever needs the brick.
pub(crate) fn fetch_ahead(
    ask: Ask<'_>,
    sources: &[Source<'_>],
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
        let brick = load_brick(key, of_brick(&key, sources)?, workshop.raycaster, workshop.cache)?;
        let took = thread_time().saturating_sub(before);
        nanos.fetch_add(u64::try_from(took.as_nanos()).unwrap_or(u64::MAX), Ordering::Relaxed);
        loaded.lock().unwrap_or_else(PoisonError::into_inner).push(key);
        Ok(brick)
    };
    let load: &Load<'_> = &load;
    let _ = reading(are_far(sources), || workshop.residency.fetch_ahead(ask, load, cancelled));
    let loaded = loaded.lock().unwrap_or_else(PoisonError::into_inner);
    metered(&loaded, sources, workshop, decoded)
}

/// What was loaded since so much was `decoded`; no time.
fn metered(loaded: &[BrickKey], sources: &[Source<'_>], workshop: Workshop<'_>, decoded: u64) -> LoadMeter {
    let owned = |key: &BrickKey| {
        let Ok(Source { store, .. }) = of_brick(key, sources) else { return 0 };
        let grid = store.store.manifest().grid;
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
    store.manifest().stored_type.bytes() as u64 + if key.reads_regions() { 5 } else { 0 }
}

/// Voxels beyond the owned box whose regions are read: inner guards look one further.
pub(super) fn region_margin(ghost: u32, recipe: Recipe) -> u32 {
    ghost + 1 + u32::from(recipe.radius)
}

/// Where a brick is loaded from.
fn of_brick<'a>(key: &BrickKey, sources: &[Source<'a>]) -> Result<Source<'a>, NodeError> {
    let of_store = |source: &&Source<'_>| source.store.store.hash() == key.store;
    let unknown = || NodeError::UnknownStore { hash: key.store, there: "it is none of the frame's".to_owned() };
    sources.iter().find(of_store).copied().ok_or_else(unknown)
}

fn are_far(sources: &[Source<'_>]) -> bool {
    sources.iter().any(|source| source.store.store.is_far())
}

/// Voxels of a brick, and its regions where they are read.
type Read<'a> = (BrickVoxels, Option<(BrickRegions, &'a RegionTable)>);

fn read<'a>(
    store: &'a OpenStore,
    index: BrickIndex,
    key: &BrickKey,
    reads_regions: bool,
    cache: &ChunkCache,
) -> Result<Read<'a>, NodeError> {
    let brick = store.store.manifest().grid.id(index);
    let unreadable = UnreadableBrick { store: store.store.hash(), brick };
    let broken = |source| NodeError::of_brick(&store.name, unreadable, source);
    let voxels = store.store.read_brick(index, key.ghost, cache).map_err(broken)?;
    let regions = match store.store.region_table().filter(|_| reads_regions) {
        Some(table) => {
            let margin = region_margin(key.ghost, key.recipe);
            Some((store.store.read_brick_regions(index, margin, cache).map_err(broken)?, table))
        }
        None => None,
    };
    Ok((voxels, regions))
}

/// The voxels of a brick where it is next to a coarser level: those that are flattened are, and those that touch the
/// coarser level are of what that draws.
fn beside_coarser<'a>(
    (voxels, regions): Read<'a>,
    index: BrickIndex,
    (key, taken): (&BrickKey, Coarser),
    source: Source<'_>,
    cache: &ChunkCache,
) -> Result<Read<'a>, NodeError> {
    let coarse = source.coarser.ok_or_else(|| NodeError::NoCoarserLevel { name: source.store.name.clone() })?;
    let [flattens, flattens_coarse] = taken.flattened;
    let (over, of_over) = read(coarse, index.coarser(), key, flattens_coarse, cache)?;
    let radius = key.recipe.radius;
    let flat = |voxels, regions: &Option<(BrickRegions, &RegionTable)>, flattens: bool| match regions {
        Some((regions, table)) if flattens => flattened(voxels, regions, table, radius),
        _ => Ok(voxels),
    };
    let over = flat(over, &of_over, flattens_coarse)?;
    let mut voxels = flat(voxels, &regions, flattens)?;
    let manifest = source.store.store.manifest();
    let (owned, dims) = (manifest.grid.owned_box(index), manifest.grid.volume_dims());
    take_coarser(&mut voxels, (&owned, dims), taken.sides, &over, manifest.no_data.is_some());
    Ok((voxels, regions))
}

fn load_brick(
    key: BrickKey,
    source: Source<'_>,
    raycaster: &dyn Raycaster,
    cache: &ChunkCache,
) -> Result<Arc<dyn ResidentBrick>, NodeError> {
    let (store, recipe) = (&*source.store.store, key.recipe);
    let index = store.manifest().grid.index_of(key.brick);
    let owned = store.manifest().grid.owned_box(index);
    if let Some(region) = only_region(&key, store) {
        return match recipe.interval {
            true => Ok(Arc::new(IntervalBrick::uniform(&owned, &region))),
            false => Ok(raycaster.upload_uniform(owned, region.mean())?),
        };
    }
    let mut brick = read(source.store, index, &key, key.reads_regions(), cache)?;
    if let Some(taken) = key.coarser {
        brick = beside_coarser(brick, index, (&key, taken), source, cache)?;
    }
    let (voxels, regions) = &brick;
    let regions = regions.as_ref().map(|(regions, table)| (regions, *table));
    let input = BrickInput { voxels, regions, recipe };
    match recipe.interval {
        true => Ok(Arc::new(IntervalBrick::new(owned, &input)?)),
        false => Ok(raycaster.upload(owned, &input)?),
    }
}

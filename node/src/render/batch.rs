//! Units rendered in batches that fit the memory, and handed out one by one.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::Instant;

use brickcast_volume::Premul;
use brickcast_volume::regions::Region;
use brickcast_volume::store::{ChunkCache, Store};

use super::choice::knows_only_region;
use super::plan::{FramePlan, PlannedBrick, Unit};
use super::{MAX_BATCH_BYTES, Workshop};
use crate::error::NodeError;
use crate::meter::{FrameMeter, LoadMeter};
use crate::raycaster::{BrickInput, Job, JobImage, Raycaster, ResidentBrick};
use crate::residency::{BrickKey, Lease, Load, Wanted};
use crate::stores::OpenStore;

/// The plan's units in their order, rendered when they are needed, several at once.
pub(super) struct Batches<'a> {
    plan: &'a FramePlan,
    store: &'a OpenStore,
    workshop: Workshop<'a>,
    cancelled: &'a (dyn Fn() -> bool + Sync),
    /// The first unit that is not rendered yet.
    next: usize,
    finished: VecDeque<JobImage>,
}

impl<'a> Batches<'a> {
    pub(super) fn new(
        plan: &'a FramePlan,
        store: &'a OpenStore,
        workshop: Workshop<'a>,
        cancelled: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        Self { plan, store, workshop, cancelled, next: 0, finished: VecDeque::new() }
    }

    /// The unit whose picture [`Batches::take`] gives next.
    pub(super) fn upcoming(&self) -> Option<&'a Unit> {
        self.plan.units.get(self.next - self.finished.len())
    }

    /// The next unit's picture; `None` after the last.
    pub(super) fn take(&mut self, meter: &mut FrameMeter) -> Result<Option<JobImage>, NodeError> {
        if self.finished.is_empty() && self.next < self.plan.units.len() {
            if (self.cancelled)() {
                return Err(NodeError::Cancelled);
            }
            self.render(meter)?;
        }
        Ok(self.finished.pop_front())
    }

    fn render(&mut self, meter: &mut FrameMeter) -> Result<(), NodeError> {
        let (end, wanted) = self.fitting();
        let units = &self.plan.units[self.next..end];
        let (lease, load) = load_bricks(&wanted, self.store, self.workshop, self.cancelled)?;
        meter.loaded(load);
        let resident: HashMap<BrickKey, &Arc<dyn ResidentBrick>> =
            wanted.iter().map(|w| w.key).zip(lease.bricks()).collect();
        let key = |position: &usize| self.plan.bricks[*position].wanted.key;
        let jobs: Vec<Job> = units
            .iter()
            .map(|unit| Job {
                bricks: unit.bricks.iter().map(|p| resident[&key(p)].clone()).collect(),
                rect: unit.rect,
            })
            .collect();
        let workshop = self.workshop;
        let render = || workshop.raycaster.render(&self.plan.scene, &jobs);
        let (images, work_ms) = workshop.pace.work(self.cancelled, render)?;
        meter.worked(work_ms);
        for (unit, image) in units.iter().zip(&images) {
            for (position, counts) in unit.bricks.iter().zip(&image.counts) {
                let PlannedBrick { wanted, drawn, index, .. } = &self.plan.bricks[*position];
                let tree = &self.plan.tree;
                meter.rendered(wanted.key.brick, tree.chunk_linear(tree.chunk_of(*index)), drawn, counts);
            }
        }
        self.finished = images.into();
        self.next = end;
        Ok(())
    }

    /// As many units from the next one as fit (at least one): the end of the run, and its bricks, none twice.
    fn fitting(&self) -> (usize, Vec<Wanted>) {
        let budget = self.workshop.residency.budget();
        let mut wanted: HashMap<BrickKey, u64> = HashMap::new();
        let (mut brick_bytes, mut picture_bytes) = (0_u64, 0_u64);
        let mut end = self.next;
        for unit in &self.plan.units[self.next..] {
            let new = unit.bricks.iter().map(|&p| self.plan.bricks[p].wanted).filter(|w| !wanted.contains_key(&w.key));
            let more: u64 = new.clone().map(|w| w.bytes).fold(0, u64::saturating_add);
            let pixels = (unit.rect.pixel_count() * size_of::<Premul>()) as u64;
            let fits = brick_bytes.saturating_add(more) <= budget && picture_bytes + pixels <= MAX_BATCH_BYTES;
            if end > self.next && !fits {
                break;
            }
            let new: Vec<Wanted> = new.collect();
            wanted.extend(new.iter().map(|w| (w.key, w.bytes)));
            brick_bytes = brick_bytes.saturating_add(more);
            picture_bytes += pixels;
            end += 1;
        }
        let mut wanted: Vec<Wanted> = wanted.into_iter().map(|(key, bytes)| Wanted { key, bytes }).collect();
        wanted.sort_unstable_by_key(|w| w.key);
        (end, wanted)
    }
}

/// Holds `wanted`, loading what is missing from the store through the shared cache of decoded chunks.
pub(crate) fn load_bricks<'a>(
    wanted: &[Wanted],
    store: &OpenStore,
    workshop: Workshop<'a>,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<(Lease<'a>, LoadMeter), NodeError> {
    let (started, decoded) = (Instant::now(), workshop.cache.decoded_bytes());
    let load = |key: BrickKey| load_brick(key, store, workshop.raycaster, workshop.cache);
    let load: &Load<'_> = &load;
    let lease = workshop.residency.lease(wanted, load, cancelled)?;
    let meter = if lease.loaded().is_empty() {
        LoadMeter::default()
    } else {
        let manifest = store.store.manifest();
        let grid = manifest.grid;
        let owned = |key: &BrickKey| {
            let voxels = grid.owned_box(grid.brick_at(key.brick as usize)).voxel_count();
            voxels * bytes_read(key, &store.store)
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
fn only_region(key: &BrickKey, store: &Store) -> Option<Region> {
    key.recipe.guard.filter(|_| knows_only_region(key.ghost))?;
    let facts = store.brick_facts()?.get(key.brick as usize)?;
    store.region_table()?.get(facts.only_region).copied()
}

/// Bytes that a voxel of the brick has in the arrays that are read for it.
fn bytes_read(key: &BrickKey, store: &Store) -> u64 {
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
    let (grid, recipe, store) = (store.store.manifest().grid, key.recipe, &store.store);
    let index = grid.brick_at(key.brick as usize);
    let owned = grid.owned_box(index);
    let table = match recipe.guard.is_some() || recipe.region_flags {
        true => store.region_table(),
        false => None,
    };
    if let Some(region) = only_region(&key, store) {
        return Ok(raycaster.upload_uniform(owned, region.mean())?);
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
    Ok(raycaster.upload(owned, &BrickInput { voxels: &voxels, regions, recipe })?)
}

//! How the bricks of one scene are drawn from one store, and what of each must be resident for it.

use std::sync::Arc;

use brickcast_shaders::interval::IntervalTables;
use brickcast_volume::BrickIndex;
use brickcast_volume::lod::Sides;
use brickcast_volume::look_on::{BricksOf, LookOn};
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::regions::Drawn;
use brickcast_volume::scene::{Extreme, Filter, Scene};
use brickcast_volume::store::{BrickSource, Manifest};

use super::load::region_margin;
use super::tables::TableCache;
use crate::brick::bytes::{interval_bytes, loading_bytes};
use crate::brick::residency::{BrickKey, Coarser, Wanted};
use crate::error::NodeError;
use crate::interval::IntervalScene;
use crate::kernel::{LookTraits, Raycaster, Recipe, TakeKind, knows_only_region};

/// Decides for one scene on one store.
#[derive(Debug)]
pub(crate) struct BrickChoice<'a> {
    store: &'a dyn BrickSource,
    scene: &'a Scene,
    pub(crate) look: LookOn<'a>,
    /// Outside and inside regions, where the scene integrates slabs.
    pub(crate) slabs: Option<[Arc<Preintegrated>; 2]>,
    /// The next coarser level, where bricks meet it.
    coarser: Option<(&'a dyn BrickSource, LookOn<'a>)>,
}

/// A brick that shows something, and how.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chosen {
    pub(crate) wanted: Wanted,
    pub(crate) drawn: Drawn,
}

impl<'a> BrickChoice<'a> {
    /// # Errors
    /// Steps that are out of all proportion to the opacity unit.
    pub(crate) fn new(store: &'a dyn BrickSource, scene: &'a Scene, tables: &TableCache) -> Result<Self, NodeError> {
        let manifest = store.manifest();
        let (delta, ratio) = (scene.delta(&manifest.geometry), scene.delta_over_unit(&manifest.geometry));
        if !(1e-9..=1e6).contains(&ratio) {
            return Err(NodeError::OpacityUnit { delta, unit: scene.look.opacity_unit, ratio });
        }
        let look = look_on(store, scene, tables);
        let slabs = look.slabs(tables);
        Ok(Self { store, scene, look, slabs, coarser: None })
    }

    /// Of bricks that meet those of the next coarser level.
    pub(crate) fn beside(self, coarser: &'a dyn BrickSource, tables: &TableCache) -> Self {
        Self { coarser: Some((coarser, look_on(coarser, self.scene, tables))), ..self }
    }

    /// One end of the scene's intervals.
    pub(crate) fn interval(&self, extreme: Extreme) -> IntervalScene {
        let (look, range) = (&self.look, self.store.manifest().range);
        let tables = (&**look.main(), look.region().map(|table| &**table));
        let tables = IntervalTables::new(&self.scene.look, range, tables, self.slabs.as_ref());
        IntervalScene { extreme, tables }
    }

    /// What of the scene says which kernel a brick takes.
    pub(crate) fn look_traits(&self) -> LookTraits {
        let look = &self.scene.look;
        LookTraits { take: TakeKind::of(&look.style), tells_regions_apart: look.tells_regions_apart() }
    }

    /// What a brick takes of the next coarser level, which is at `sides`. Nearest voxels are those of their own level.
    fn coarser(&self, index: BrickIndex, sides: Sides, drawn: &Drawn) -> Option<(&dyn BrickSource, Coarser)> {
        let has_any = !sides.is_empty() && self.scene.quality.filter != Filter::Nearest;
        let (store, look) = self.coarser.as_ref().filter(|_| has_any)?;
        let over = look.of(index.coarser()).drawn;
        let flattened = [drawn.flattened, over.is_some_and(|over| over.flattened)];
        Some((*store, Coarser { sides, flattened }))
    }

    /// `None` where the brick shows nothing; `coarser` is where it meets the next coarser level.
    pub(crate) fn of(&self, index: BrickIndex, coarser: Sides, raycaster: &dyn Raycaster) -> Option<Chosen> {
        let manifest = self.store.manifest();
        let (id, owned) = (manifest.grid.id(index), manifest.grid.owned_box(index));
        let brick = self.look.of(index);
        let (drawn, ghost) = (brick.drawn?, self.scene.ghost());
        let coarser = self.coarser(index, coarser, &drawn);
        // Voxels of another level are in no region of this one: nothing leaps.
        let recipe = Recipe::of(self.scene, drawn.flattened && coarser.is_none(), brick.has_regions());
        let taken = coarser.map(|(_, taken)| taken);
        let key = BrickKey { store: self.store.hash(), brick: id, ghost, recipe, coarser: taken };
        let stored = owned.stored(ghost);
        let (bytes, upload) = match drawn.only_region {
            Some(_) if knows_only_region(ghost) && taken.is_none() => {
                return Some(Chosen { wanted: Wanted { key, bytes: 0, loading: 0 }, drawn });
            }
            _ if recipe.interval => (interval_bytes(stored.voxel_count(), recipe), 0),
            _ => {
                let voxels = stored.voxel_count();
                (raycaster.brick_bytes(voxels, recipe), raycaster.upload_bytes(voxels))
            }
        };
        let reads_regions = [key.reads_regions(), taken.is_some_and(|taken| taken.flattened[1])];
        let loading_of = |manifest: &Manifest, index, reads_regions: bool, upload| {
            let owned = manifest.grid.owned_box(index);
            let covered = reads_regions.then(|| owned.stored(region_margin(ghost, recipe)));
            let array = (manifest.stored_type.bytes() as u64, manifest.halo.is_some());
            loading_bytes(&owned, (&owned.stored(ghost), covered.as_ref()), array, upload)
        };
        let mut loading = loading_of(manifest, index, reads_regions[0], upload);
        if let Some((store, taken)) = coarser {
            // Both are in memory at once, and once more where they are flattened.
            let codes = 2 * stored.voxel_count() * (1 + taken.flattened.map(u64::from).iter().sum::<u64>());
            loading += codes + loading_of(store.manifest(), index.coarser(), reads_regions[1], 0);
        }
        Some(Chosen { wanted: Wanted { key, bytes, loading }, drawn })
    }
}

fn look_on<'a>(store: &'a dyn BrickSource, scene: &'a Scene, tables: &TableCache) -> LookOn<'a> {
    let (manifest, ranges, facts) = (store.manifest(), &store.brick_ranges().0, store.brick_facts());
    LookOn::new(scene, BricksOf { manifest, ranges, facts }, tables)
}

//! How the bricks of one scene are drawn from one store, and what of each must be resident for it.

use std::sync::Arc;

use brickcast_shaders::interval::IntervalTables;
use brickcast_volume::BrickIndex;
use brickcast_volume::look_on::{BricksOf, LookOn};
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::regions::Drawn;
use brickcast_volume::scene::{Extreme, Scene};
use brickcast_volume::store::BrickSource;

use super::load::region_margin;
use super::tables::TableCache;
use crate::brick::bytes::{interval_bytes, loading_bytes};
use crate::brick::residency::{BrickKey, Wanted};
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
        let (ranges, facts) = (&store.brick_ranges().0, store.brick_facts());
        let look = LookOn::new(scene, BricksOf { manifest, ranges, facts }, tables);
        let slabs = look.slabs(tables);
        Ok(Self { store, scene, look, slabs })
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

    /// `None` where the brick shows nothing.
    pub(crate) fn of(&self, index: BrickIndex, raycaster: &dyn Raycaster) -> Option<Chosen> {
        let manifest = self.store.manifest();
        let (id, owned) = (manifest.grid.id(index), manifest.grid.owned_box(index));
        let brick = self.look.of(index);
        let (drawn, ghost) = (brick.drawn?, self.scene.ghost());
        let recipe = Recipe::of(self.scene, drawn.flattened, brick.has_regions());
        let key = BrickKey { store: self.store.hash(), brick: id, ghost, recipe };
        let stored = owned.stored(ghost);
        let (bytes, upload) = match drawn.only_region {
            Some(_) if knows_only_region(ghost) => {
                return Some(Chosen { wanted: Wanted { key, bytes: 0, loading: 0 }, drawn });
            }
            _ if recipe.interval => (interval_bytes(stored.voxel_count(), recipe), 0),
            _ => {
                let voxels = stored.voxel_count();
                (raycaster.brick_bytes(voxels, recipe), raycaster.upload_bytes(voxels))
            }
        };
        let covered = recipe.reads_regions().then(|| owned.stored(region_margin(ghost, recipe)));
        let array = (manifest.stored_type.bytes() as u64, manifest.halo.is_some());
        let loading = loading_bytes(&owned, (&stored, covered.as_ref()), array, upload);
        Some(Chosen { wanted: Wanted { key, bytes, loading }, drawn })
    }
}

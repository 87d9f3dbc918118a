//! How the bricks of one scene are drawn from one store, and what of each must be resident for it.

use std::sync::Arc;

use brickcast_shaders::Kinds;
use brickcast_volume::BrickIndex;
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::regions::{Drawn, SceneTables, drawn, within_reach};
use brickcast_volume::scene::Scene;
use brickcast_volume::store::BrickSource;
use brickcast_volume::transfer_function::TransferTable;

use super::tables::TableCache;
use crate::brick::residency::{BrickKey, Wanted};
use crate::error::NodeError;
use crate::kernel::{KernelStyle, Raycaster, Recipe, knows_only_region};

/// Decides for one scene on one store.
#[derive(Debug)]
pub(crate) struct BrickChoice<'a> {
    store: &'a dyn BrickSource,
    scene: &'a Scene,
    pub(crate) main: Arc<TransferTable>,
    pub(crate) region: Option<Arc<TransferTable>>,
    /// Outside and inside regions, where the scene integrates slabs.
    pub(crate) slabs: Option<[Arc<Preintegrated>; 2]>,
    surfaces: Vec<u16>,
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
        let delta = scene.step * manifest.geometry.min_spacing();
        let ratio = delta / scene.opacity_unit;
        if !(1e-9..=1e6).contains(&ratio) {
            return Err(NodeError::OpacityUnit { delta, unit: scene.opacity_unit, ratio });
        }
        let (range, entries) = (manifest.range, scene.style.table_entries());
        let table = |function| tables.get(function, range, ratio, entries);
        let region = scene.region_transfer_function.as_ref().map(table);
        let main = table(&scene.transfer_function);
        let slabs = scene.style.integrates_slabs().then(|| {
            let lit = scene.style.shading.is_some_and(|phong| phong.lighting.needs_weights());
            let slabs = |function| tables.slabs(function, range, ratio, entries, lit);
            let inside = scene.region_transfer_function.as_ref().map(slabs);
            let outside = slabs(&scene.transfer_function);
            [outside.clone(), inside.unwrap_or(outside)]
        });
        Ok(Self { store, scene, main, region, slabs, surfaces: scene.style.surface_codes(range) })
    }

    /// What of the integral kernel the scene takes.
    pub(crate) fn kinds(&self) -> Option<Kinds> {
        let manifest = self.store.manifest();
        let style = &self.scene.style;
        KernelStyle::new(style, self.scene.step, &manifest.geometry, manifest.range, self.slabs.clone())
            .map(|s| s.kinds)
    }

    /// `None` where the brick shows nothing.
    pub(crate) fn of(&self, index: BrickIndex, raycaster: &dyn Raycaster) -> Option<Chosen> {
        let manifest = self.store.manifest();
        let (linear, owned) = (manifest.grid.linear(index), manifest.grid.owned_box(index));
        let style = &self.scene.style;
        let (ranges, reach) = (&self.store.brick_ranges().0, style.reach(self.scene.step));
        let (raw, facts) = within_reach(&manifest.grid, ranges, self.store.brick_facts(), index, reach);
        let facts = facts.as_ref();
        let tables = SceneTables::new(self.scene, &self.surfaces, &self.main, self.region.as_deref());
        let drawn = drawn(self.scene, &tables, &manifest.geometry, &owned, raw, facts)?;
        let ghost = style.ghost(self.scene.step);
        let recipe = Recipe::of(self.scene, drawn.flattened, facts.is_some_and(|f| f.has_regions));
        let brick = u32::try_from(linear).unwrap_or(u32::MAX);
        let key = BrickKey { store: self.store.hash(), brick, ghost, recipe };
        let bytes = match drawn.only_region {
            Some(_) if knows_only_region(ghost) => 0,
            _ => raycaster.brick_bytes(owned.stored(ghost).voxel_count(), recipe),
        };
        Some(Chosen { wanted: Wanted { key, bytes }, drawn })
    }
}

//! How the bricks of one scene are drawn from one store, and what of each must be resident for it.

use std::sync::Arc;

use brickcast_volume::BrickIndex;
use brickcast_volume::brick::GHOST_SAMPLED;
use brickcast_volume::regions::{Drawn, SceneTables, drawn, guard_width};
use brickcast_volume::scene::{Leap, RegionView, Scene};
use brickcast_volume::store::Store;
use brickcast_volume::transfer_function::TransferTable;

use super::TableCache;
use crate::error::NodeError;
use crate::raycaster::Raycaster;
use crate::recipe::Recipe;
use crate::residency::{BrickKey, Wanted};

/// Decides for one scene on one store.
#[derive(Debug)]
pub(crate) struct BrickChoice<'a> {
    store: &'a Store,
    scene: &'a Scene,
    pub(crate) main: Arc<TransferTable>,
    pub(crate) region: Option<Arc<TransferTable>>,
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
    pub(crate) fn new(store: &'a Store, scene: &'a Scene, tables: &TableCache) -> Result<Self, NodeError> {
        let manifest = store.manifest();
        let delta = scene.step * manifest.geometry.min_spacing();
        let ratio = delta / scene.opacity_unit;
        if !(1e-9..=1e6).contains(&ratio) {
            return Err(NodeError::OpacityUnit { delta, unit: scene.opacity_unit, ratio });
        }
        let table = |function| tables.get(function, manifest.range, ratio);
        let region = scene.region_transfer_function.as_ref().map(table);
        Ok(Self { store, scene, main: table(&scene.transfer_function), region })
    }

    /// `None` where the brick shows nothing.
    pub(crate) fn of(&self, index: BrickIndex, raycaster: &dyn Raycaster) -> Option<Chosen> {
        let manifest = self.store.manifest();
        let (linear, owned) = (manifest.grid.linear(index), manifest.grid.owned_box(index));
        let raw = self.store.brick_ranges().0.get(linear).copied().unwrap_or([0, u16::MAX]);
        let facts = self.store.brick_facts().and_then(|facts| facts.get(linear));
        let tables = SceneTables { main: &self.main, region: self.region.as_deref(), view: self.scene.region_view };
        let drawn = drawn(self.scene, &tables, &manifest.geometry, &owned, raw, facts)?;
        let recipe = self.recipe(&drawn, facts.is_some_and(|f| f.has_regions));
        let brick = u32::try_from(linear).unwrap_or(u32::MAX);
        let key = BrickKey { store: self.store.hash(), brick, ghost: GHOST_SAMPLED, recipe };
        let bytes = match drawn.only_region {
            Some(_) => 0,
            None => raycaster.brick_bytes(owned.stored(GHOST_SAMPLED).voxel_count(), recipe),
        };
        Some(Chosen { wanted: Wanted { key, bytes }, drawn })
    }

    fn recipe(&self, drawn: &Drawn, has_regions: bool) -> Recipe {
        let acceleration = &self.scene.acceleration;
        let homogeneous = match acceleration.leap {
            Leap::Macrocells(range) => Some((f64::from(range) * 65535.0) as u16),
            Leap::Off | Leap::Regions => None,
        };
        let shows_kinds = self.scene.region_view != RegionView::All || self.region.is_some();
        Recipe {
            // Steps are at most 16 voxels: 33.
            guard: drawn.flattened.then(|| guard_width(self.scene.step, 0) as u8),
            macrocell: (acceleration.skip_empty || homogeneous.is_some())
                .then(|| acceleration.macrocell.voxels() as u8),
            homogeneous,
            region_flags: shows_kinds && has_regions,
        }
    }
}

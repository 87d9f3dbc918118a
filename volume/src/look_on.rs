//! A scene's look on a store: the one place that builds its tables, and decides by them what of each brick is drawn.
//! Compositor and nodes ask here, so that what is ordered is what is rendered.

use std::sync::Arc;

use crate::ids::BrickIndex;
use crate::preintegration::Preintegrated;
use crate::regions::{BrickFacts, Drawn, SceneTables, drawn, within_reach};
use crate::scene::Scene;
use crate::store::Manifest;
use crate::transfer_function::{TransferFunction, TransferTable};

/// Whoever has tables, or builds them.
pub trait Tables {
    /// The table of `entries` entries of `function` over `range` (data units) for steps of `delta_over_unit` opacity
    /// units.
    fn table(
        &self,
        function: &TransferFunction,
        range: (f64, f64),
        delta_over_unit: f64,
        entries: usize,
    ) -> Arc<TransferTable>;

    /// The pre-integrated table of `function`, `lit` for interpolated light.
    fn slabs(
        &self,
        function: &TransferFunction,
        range: (f64, f64),
        delta_over_unit: f64,
        entries: usize,
        lit: bool,
    ) -> Arc<Preintegrated>;
}

/// Builds every table anew.
#[derive(Debug, Clone, Copy, Default)]
pub struct NewTables;

impl Tables for NewTables {
    fn table(&self, function: &TransferFunction, range: (f64, f64), ratio: f64, entries: usize) -> Arc<TransferTable> {
        Arc::new(TransferTable::with_entries(function, range, ratio, entries))
    }

    fn slabs(
        &self,
        function: &TransferFunction,
        range: (f64, f64),
        ratio: f64,
        entries: usize,
        lit: bool,
    ) -> Arc<Preintegrated> {
        Arc::new(Preintegrated::with_entries(function, range, ratio, entries, lit))
    }
}

/// What is known of a store's bricks without their voxels; per brick, x fastest.
#[derive(Debug, Clone, Copy)]
pub struct BricksOf<'a> {
    pub manifest: &'a Manifest,
    /// The codes that a brick's stored box holds, smallest and largest.
    pub ranges: &'a [[u16; 2]],
    /// What the store says of its regions; nothing where it has none.
    pub facts: Option<&'a [BrickFacts]>,
}

/// A scene's look on a store.
#[derive(Debug, Clone)]
pub struct LookOn<'a> {
    scene: &'a Scene,
    store: BricksOf<'a>,
    main: Arc<TransferTable>,
    region: Option<Arc<TransferTable>>,
    surfaces: Vec<u16>,
}

/// What is known of one brick, and how it is drawn.
#[derive(Debug, Clone, Copy)]
pub struct BrickLook {
    /// Codes that its rays can meet in the volume; the first above the second where none holds data.
    pub raw: [u16; 2],
    pub facts: Option<BrickFacts>,
    /// `None` where it shows nothing.
    pub drawn: Option<Drawn>,
}

impl BrickLook {
    #[must_use]
    pub fn has_regions(&self) -> bool {
        self.facts.is_some_and(|facts| facts.has_regions)
    }
}

impl<'a> LookOn<'a> {
    #[must_use]
    pub fn new(scene: &'a Scene, store: BricksOf<'a>, tables: &impl Tables) -> Self {
        let (range, ratio) = (store.manifest.range, scene.delta_over_unit(&store.manifest.geometry));
        let entries = scene.look.style.table_entries();
        let table = |function| tables.table(function, range, ratio, entries);
        let region = scene.look.region_transfer_function.as_ref().map(table);
        let main = table(&scene.look.transfer_function);
        Self { scene, store, main, region, surfaces: scene.look.style.surface_codes(range) }
    }

    /// Outside and inside regions, where the scene integrates slabs.
    #[must_use]
    pub fn slabs(&self, tables: &impl Tables) -> Option<[Arc<Preintegrated>; 2]> {
        let (look, manifest) = (&self.scene.look, self.store.manifest);
        if !look.style.integrates_slabs() {
            return None;
        }
        let (ratio, entries) = (self.scene.delta_over_unit(&manifest.geometry), look.style.table_entries());
        let lit = look.style.shading.is_some_and(|phong| phong.lighting.needs_weights());
        let slabs = |function| tables.slabs(function, manifest.range, ratio, entries, lit);
        let inside = look.region_transfer_function.as_ref().map(slabs);
        let outside = slabs(&look.transfer_function);
        Some([outside.clone(), inside.unwrap_or(outside)])
    }

    /// The table that samples are classified by, outside of regions at least.
    #[must_use]
    pub fn main(&self) -> &Arc<TransferTable> {
        &self.main
    }

    /// That of samples in regions, where the scene has a transfer function of its own for them.
    #[must_use]
    pub fn region(&self) -> Option<&Arc<TransferTable>> {
        self.region.as_ref()
    }

    fn tables(&self) -> SceneTables<'_> {
        SceneTables::new(self.scene, &self.surfaces, &self.main, self.region.as_deref())
    }

    /// How a brick is drawn.
    #[must_use]
    pub fn of(&self, brick: BrickIndex) -> BrickLook {
        let BricksOf { manifest, ranges, facts } = self.store;
        let reach = self.scene.look.style.reach(self.scene.quality.step);
        let (raw, facts) = within_reach(&manifest.grid, ranges, facts, brick, reach);
        let owned = manifest.grid.owned_box(brick);
        let drawn = drawn(self.scene, &self.tables(), &manifest.geometry, &owned, raw, facts.as_ref());
        BrickLook { raw, facts, drawn }
    }
}

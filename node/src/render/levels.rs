//! The levels of the volume that an order draws: how bricks of each are drawn, and what kernels see of it.

use std::collections::HashMap;

use brickcast_proto::RenderOrder;
use brickcast_volume::lod::{Borders, Levels};
use brickcast_volume::scene::Scene;
use brickcast_volume::store::{BrickSource, Manifest};
use brickcast_volume::{ChunkId, ChunkIndex, MergeTree, OwnedBox};

use super::choice::BrickChoice;
use super::tables::TableCache;
use crate::error::NodeError;
use crate::kernel::{KernelScene, KernelStyle};
use crate::stores::{Source, Sources};

/// A level of a plan.
#[derive(Debug)]
pub(super) struct PlanLevel {
    /// In this level's voxels.
    pub scene: KernelScene,
    pub tree: MergeTree,
    pub borders: Option<Borders>,
}

/// How the bricks of each level are drawn, and which chunk is drawn on which.
#[derive(Debug)]
pub(super) struct Choices<'a> {
    each: Vec<Choice<'a>>,
    /// Of the order's store's chunks, which of them; nothing where all are of that store.
    chunks: Option<(Levels, HashMap<ChunkId, usize>)>,
}

#[derive(Debug)]
struct Choice<'a> {
    choice: BrickChoice<'a>,
    manifest: &'a Manifest,
    /// 0 is the order's store.
    level: u8,
    borders: Option<&'a Borders>,
}

impl<'a> Choices<'a> {
    /// # Errors
    /// As [`BrickChoice::new`]; a store that is none of the order's store's levels.
    pub(super) fn new(order: &'a RenderOrder, sources: &Sources<'a>, tables: &TableCache) -> Result<Self, NodeError> {
        let scene = &order.scene;
        let choice = |source: &Source<'a>, level: u8, borders: Option<&'a Borders>| {
            let store: &'a dyn BrickSource = &*source.store.store;
            let choice = BrickChoice::new(store, scene, tables)?;
            let choice = match source.coarser {
                Some(coarser) => choice.beside(&*coarser.store, tables),
                None => choice,
            };
            Ok::<_, NodeError>(Choice { choice, manifest: store.manifest(), level, borders })
        };
        if order.parts.is_empty() {
            return Ok(Self { each: vec![choice(&Source::of(sources.root), 0, None)?], chunks: None });
        }
        let root = sources.root.store.manifest();
        let levels = Levels::new(&root.geometry, root.grid, 1 + root.levels.len() as u8);
        let mut chunks = HashMap::new();
        let mut each = Vec::new();
        for (place, (part, source)) in order.parts.iter().zip(&sources.parts).enumerate() {
            let grid = source.store.store.manifest().grid;
            if part.level >= levels.count() || MergeTree::of(grid) != *levels.tree(part.level) {
                return Err(NodeError::OtherLevel { name: sources.root.name.clone(), level: part.level });
            }
            each.push(choice(source, part.level, part.borders.as_ref())?);
            chunks.extend(part.chunks.iter().map(|chunk| (*chunk, place)));
        }
        Ok(Self { each, chunks: Some((levels, chunks)) })
    }

    /// # Errors
    /// A view that is none.
    pub(super) fn levels(&self, scene: &Scene) -> Result<Vec<PlanLevel>, NodeError> {
        self.each.iter().map(|choice| choice.plan(scene)).collect()
    }

    /// Of the bricks of one of the levels.
    pub(super) fn of(&self, place: usize) -> &BrickChoice<'a> {
        &self.each[place].choice
    }

    /// Which of the levels a chunk of the order's store is drawn of, and which of that level's chunks it is.
    ///
    /// # Errors
    /// A chunk that no part has.
    pub(super) fn at(&self, id: ChunkId, chunk: ChunkIndex) -> Result<(usize, ChunkIndex), NodeError> {
        let Some((levels, places)) = &self.chunks else { return Ok((0, chunk)) };
        let place = *places.get(&id).ok_or(NodeError::NoPart(id))?;
        Ok((place, levels.over(self.each[place].level, chunk)))
    }
}

impl Choice<'_> {
    fn plan(&self, scene: &Scene) -> Result<PlanLevel, NodeError> {
        let Self { choice, manifest, level, borders } = self;
        let scene = KernelScene {
            view: scene.view_of(&manifest.geometry)?,
            table: choice.look.main().clone(),
            region_table: choice.look.region().cloned(),
            region_view: scene.look.region_view,
            skip_empty: scene.quality.acceleration.skip_empty,
            early_termination: scene.quality.early_termination,
            filter: scene.quality.filter,
            style: KernelStyle::new(
                &scene.look.style.clone().above_noise(manifest.noise),
                scene.quality.step,
                &manifest.geometry,
                manifest.range,
                choice.slabs.clone(),
            ),
            finest: borders.map_or(1.0, Borders::finest),
            weight: f32::from(*level).exp2(),
        };
        Ok(PlanLevel { scene, tree: MergeTree::of(manifest.grid), borders: borders.cloned() })
    }
}

impl PlanLevel {
    /// Samples of a ray through a box, averaged over the rectangle around its picture: some 0.4 of its diagonal.
    pub(super) fn samples_across(&self, owned: &OwnedBox) -> f64 {
        let view = &self.scene.view;
        let units = owned.dims().as_dvec3() / view.kernel().voxels_per_unit.as_dvec3();
        0.4 * units.length() / view.step()
    }
}

//! Which bricks an order needs, front to back, and how the work is cut.

use std::collections::HashMap;

use brickcast_proto::{LayerOrder, RenderOrder, TileRect};
use brickcast_volume::lod::{Borders, Sides};
use brickcast_volume::merge::{Viewpoint, sort_front_to_back};
use brickcast_volume::regions::Drawn;
use brickcast_volume::store::BrickSource;
use brickcast_volume::{BrickIndex, ChunkIndex, MergeTree, OwnedBox, PixelRect, TreeNode, View};
use glam::UVec2;

use super::choice::{BrickChoice, Chosen};
use super::slices::SliceSize;
use super::workshop::{MAX_BAND_PIXELS, Workshop};
use crate::brick::residency::Wanted;
use crate::error::NodeError;
use crate::interval::IntervalScene;
use crate::kernel::{KernelScene, KernelStyle};

/// A frame cut into pieces and units.
#[derive(Debug)]
pub(super) struct FramePlan {
    pub tree: MergeTree,
    pub from: Viewpoint,
    pub scene: KernelScene,
    /// Where one end of intervals is asked for, and not the picture itself.
    pub interval: Option<IntervalScene>,
    pub bricks: Vec<PlannedBrick>,
    /// In the order in which they are answered.
    pub pieces: Vec<Piece>,
    /// Of all pieces, in the order in which they are rendered.
    pub units: Vec<Unit>,
}

/// A brick that may show something.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlannedBrick {
    pub wanted: Wanted,
    pub drawn: Drawn,
    pub index: BrickIndex,
    /// Where it meets other levels of the volume.
    pub sides: Sides,
    /// Pixels that it can touch.
    pub rect: PixelRect,
    /// What a pixel of them takes, on average and where no ray ends early: a guess.
    samples_per_pixel: f64,
}

/// Whole tile rows of one layer.
#[derive(Debug)]
pub(super) struct Piece {
    /// Position in the order's layers.
    pub layer: usize,
    pub node: TreeNode,
    pub tiles: TileRect,
    pub join: Join,
    /// How many of the plan's units are this piece's.
    pub units: usize,
}

/// How the units of a piece become its picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Join {
    /// Units are in front-to-back order.
    InOrder,
    /// Every unit is a chunk; joined at the merge tree's nodes only.
    Tree,
}

/// One accumulator.
#[derive(Debug)]
pub(super) struct Unit {
    /// The chunk's leaf in exact mode.
    pub leaf: Option<TreeNode>,
    /// Of its bricks in the plan, front to back.
    pub positions: Vec<usize>,
    pub rect: PixelRect,
    /// Of all bricks, as in [`PlannedBrick`], on average.
    pub samples_per_pixel: f64,
}

impl FramePlan {
    pub(super) fn new(order: &RenderOrder, store: &dyn BrickSource, workshop: Workshop<'_>) -> Result<Self, NodeError> {
        let manifest = store.manifest();
        let scene = &order.scene;
        let view = scene.view_of(&manifest.geometry)?;
        let choice = BrickChoice::new(store, scene, workshop.tables)?;
        let tree = MergeTree::of(manifest.grid);
        let mut plan = Self {
            tree,
            from: view.viewpoint(),
            scene: KernelScene {
                view,
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
                finest: order.borders.as_ref().map_or(1.0, Borders::finest),
            },
            interval: scene.quality.extreme.map(|extreme| choice.interval(extreme)),
            bricks: Vec::new(),
            pieces: Vec::new(),
            units: Vec::new(),
        };
        // Every layer is checked before any is planned: a bad order costs nothing.
        let layers = order.layers.iter().map(|layer| check(&tree, layer)).collect::<Result<Vec<_>, _>>()?;
        for (at, (layer, chunks)) in order.layers.iter().zip(layers).enumerate() {
            plan.add_layer(at, layer, &chunks, order, &choice, workshop)?;
        }
        Ok(plan)
    }

    fn add_layer(
        &mut self,
        at: usize,
        layer: &LayerOrder,
        chunks: &[ChunkIndex],
        order: &RenderOrder,
        choice: &BrickChoice<'_>,
        workshop: Workshop<'_>,
    ) -> Result<(), NodeError> {
        let budget = workshop.residency.budget();
        let window = layer.tiles.pixels(order.scene.view.size);
        // Bricks by chunk, front to back within each.
        let mut by_chunk: HashMap<TreeNode, Vec<usize>> = HashMap::new();
        for chunk in chunks {
            let positions = self.visible(*chunk, &window, (choice, order.borders.as_ref()), workshop)?;
            if !positions.is_empty() {
                by_chunk.insert(self.tree.leaf(*chunk), positions);
            }
        }
        let mut leaves = Vec::new();
        self.tree.fold(
            layer.node,
            self.from,
            &mut |node| -> Option<()> {
                leaves.extend(by_chunk.contains_key(&node).then_some(node));
                None
            },
            &mut |(), ()| (),
        );
        if order.scene.quality.exact {
            for leaf in &leaves {
                let bytes = self.bytes(&by_chunk[leaf]);
                if bytes > budget {
                    let chunk = self.tree.chunk_of(self.bricks[by_chunk[leaf][0]].index);
                    return Err(NodeError::ChunkTooLarge { chunk, bytes, budget });
                }
            }
        }
        let all: Vec<usize> = self.front_to_back(by_chunk.values().flatten().copied().collect());
        let pixels = self.band_pixels(&all, &window, workshop);
        for tiles in layer.tiles.bands(pixels) {
            let band = tiles.pixels(order.scene.view.size);
            let before = self.units.len();
            let join = if order.scene.quality.exact {
                for leaf in &leaves {
                    self.add_unit(Some(*leaf), &by_chunk[leaf], &band);
                }
                Join::Tree
            } else {
                for run in self.within_budget(&all, &band, budget) {
                    self.add_unit(None, &run, &band);
                }
                Join::InOrder
            };
            let units = self.units.len() - before;
            self.pieces.push(Piece { layer: at, node: layer.node, tiles, join, units });
        }
        Ok(())
    }

    /// Pixels of a piece: the sooner it is done, the sooner its tiles are on their way. Bricks that do not fit the
    /// memory at once are loaded once for every piece, so that there are as few as possible.
    fn band_pixels(&self, positions: &[usize], window: &PixelRect, workshop: Workshop<'_>) -> u64 {
        if self.bytes(positions) > workshop.residency.budget() {
            return MAX_BAND_PIXELS;
        }
        let per_pixel = self.samples(positions, window) / window.pixel_count().max(1) as f64;
        let pixels = SliceSize::of_piece(workshop.raycaster.info()) / per_pixel.max(1e-9);
        (pixels as u64).min(MAX_BAND_PIXELS)
    }

    /// What the bricks at `positions` take within `rect`: a guess.
    fn samples(&self, positions: &[usize], rect: &PixelRect) -> f64 {
        let of = |brick: &PlannedBrick| brick.rect.intersect(rect).pixel_count() as f64 * brick.samples_per_pixel;
        positions.iter().map(|&p| of(&self.bricks[p])).sum()
    }

    /// Adds the bricks of `chunk` that may show something within `window`; their positions, front to back.
    fn visible(
        &mut self,
        chunk: ChunkIndex,
        window: &PixelRect,
        (choice, borders): (&BrickChoice<'_>, Option<&Borders>),
        workshop: Workshop<'_>,
    ) -> Result<Vec<usize>, NodeError> {
        let budget = workshop.residency.budget();
        let grid = self.tree.grid();
        let chunk_box = self.tree.voxel_box(self.tree.leaf(chunk));
        if chunk_box.is_none_or(|voxels| self.scene.view.project(&voxels).intersect(window).is_empty()) {
            return Ok(Vec::new());
        }
        let mut indices: Vec<BrickIndex> = self.tree.bricks_of(chunk).collect();
        sort_front_to_back(&mut indices, grid.brick_size(), self.from);
        let mut positions = Vec::new();
        for index in indices {
            let rect = self.scene.view.project(&grid.owned_box(index)).intersect(window);
            if rect.is_empty() {
                continue;
            }
            let Some(Chosen { wanted, drawn }) = choice.of(index, workshop.raycaster) else { continue };
            if wanted.bytes > budget {
                return Err(NodeError::BrickTooLarge { brick: index, bytes: wanted.bytes, budget });
            }
            let samples_per_pixel = samples_across(&self.scene.view, &grid.owned_box(index));
            let sides = borders.map_or(Sides::default(), |borders| borders.of_brick(&self.tree, index));
            positions.push(self.bricks.len());
            self.bricks.push(PlannedBrick { wanted, drawn, index, sides, rect, samples_per_pixel });
        }
        Ok(positions)
    }

    fn front_to_back(&self, positions: Vec<usize>) -> Vec<usize> {
        let at: HashMap<BrickIndex, usize> = positions.iter().map(|&p| (self.bricks[p].index, p)).collect();
        let mut indices: Vec<BrickIndex> = at.keys().copied().collect();
        sort_front_to_back(&mut indices, self.tree.grid().brick_size(), self.from);
        indices.iter().map(|index| at[index]).collect()
    }

    /// The bricks at `positions` that touch `band`, cut front to back into runs that fit the budget.
    fn within_budget(&self, positions: &[usize], band: &PixelRect, budget: u64) -> Vec<Vec<usize>> {
        let mut runs: Vec<Vec<usize>> = Vec::new();
        let mut bytes = 0_u64;
        for &position in positions.iter().filter(|&&p| !self.bricks[p].rect.intersect(band).is_empty()) {
            let more = self.bricks[position].wanted.bytes;
            match runs.last_mut() {
                Some(run) if bytes.saturating_add(more) <= budget => run.push(position),
                _ => {
                    runs.push(vec![position]);
                    bytes = 0;
                }
            }
            bytes = bytes.saturating_add(more);
        }
        runs
    }

    fn add_unit(&mut self, leaf: Option<TreeNode>, positions: &[usize], band: &PixelRect) {
        let mut rect = PixelRect { lo: UVec2::ZERO, hi: UVec2::ZERO };
        let mut touching = Vec::new();
        for &position in positions {
            let part = self.bricks[position].rect.intersect(band);
            if !part.is_empty() {
                rect = rect.union(&part);
                touching.push(position);
            }
        }
        if !touching.is_empty() {
            let samples_per_pixel = self.samples(&touching, &rect) / rect.pixel_count().max(1) as f64;
            self.units.push(Unit { leaf, positions: touching, rect, samples_per_pixel });
        }
    }

    pub(super) fn bytes(&self, positions: &[usize]) -> u64 {
        positions.iter().map(|&p| self.bricks[p].wanted.bytes).fold(0, u64::saturating_add)
    }
}

/// Samples of a ray through a box, averaged over the rectangle around its picture: some 0.4 of its diagonal.
fn samples_across(view: &View, owned: &OwnedBox) -> f64 {
    let units = owned.dims().as_dvec3() / view.kernel().voxels_per_unit.as_dvec3();
    0.4 * units.length() / view.step()
}

/// The layer's chunks, if it is one of this store's.
fn check(tree: &MergeTree, layer: &LayerOrder) -> Result<Vec<ChunkIndex>, NodeError> {
    let (lo, hi) = tree.chunk_box(layer.node).ok_or(NodeError::NoSuchLayer(layer.node))?;
    layer
        .chunks
        .iter()
        .map(|&chunk| {
            let last = || tree.chunk_count().saturating_sub(1);
            let index = tree.chunk_at(chunk).ok_or_else(|| NodeError::NoSuchChunk { chunk, last: last() })?;
            let c = glam::UVec3::from(index.0);
            if c.cmpge(lo).all() && c.cmplt(hi).all() {
                Ok(index)
            } else {
                Err(NodeError::ChunkElsewhere { chunk, layer: layer.node })
            }
        })
        .collect()
}

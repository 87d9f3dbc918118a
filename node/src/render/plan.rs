//! Which bricks an order needs, front to back, and how the work is cut.

use std::collections::HashMap;
use std::ops::Range;

use brickcast_proto::{LayerOrder, RenderOrder, TileRect};
use brickcast_volume::lod::{Meets, Sides};
use brickcast_volume::merge::{Viewpoint, sort_front_to_back};
use brickcast_volume::regions::Drawn;
use brickcast_volume::{BrickIndex, ChunkId, ChunkIndex, MergeTree, PixelKind, PixelRect, TreeNode};
use glam::UVec2;

use super::choice::Chosen;
use super::levels::{Choices, PlanLevel};
use super::order::{Seen, by_levels};
use super::slices::SliceSize;
use super::workshop::{MAX_BAND_PIXELS, Workshop};
use crate::brick::residency::Wanted;
use crate::brick::residency::visits::Visits;
use crate::brick::shares::{BrickShares, Need};
use crate::error::NodeError;
use crate::interval::IntervalScene;
use crate::stores::Sources;

/// A frame cut into pieces and units.
#[derive(Debug)]
pub(super) struct FramePlan {
    pub tree: MergeTree,
    pub from: Viewpoint,
    /// Of the order's parts; one where it has none.
    pub levels: Vec<PlanLevel>,
    /// What is drawn at a time is of one of them.
    pub level_by_level: bool,
    /// Where one end of intervals is asked for, and not the picture itself.
    pub interval: Option<IntervalScene>,
    pub bricks: Vec<PlannedBrick>,
    /// In the order in which they are answered.
    pub pieces: Vec<Piece>,
    /// Of all pieces, in the order in which they are rendered.
    pub units: Vec<Unit>,
    /// What its bricks have of the node's memory.
    pub shares: BrickShares,
    /// Bytes of the bricks of a pass, unless it is a single one.
    pub pass_bytes: u64,
    /// All bricks as the units come to them.
    pub visits: Visits,
}

/// The bricks of a layer that may show something: chunks' leaves in front-to-back order, and their bricks in the plan,
/// front to back within each.
struct Gathered {
    leaves: Vec<TreeNode>,
    by_chunk: HashMap<TreeNode, Vec<usize>>,
}

/// A brick that may show something.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlannedBrick {
    pub wanted: Wanted,
    pub drawn: Drawn,
    /// Of the plan's.
    pub level: usize,
    pub index: BrickIndex,
    /// In which it is drawn, of the order's store.
    pub chunk: ChunkId,
    /// Where it meets other levels of the volume by runs that are shorter than its own steps.
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
    /// One after the other into the same pixels; one where all bricks fit the memory.
    pub passes: Vec<Pass>,
}

/// What of a unit's bricks is rendered at a time. A pass goes on where the one before it ended, in the very
/// accumulator: the cut changes no bit.
#[derive(Debug)]
pub(super) struct Pass {
    /// Of the unit's positions.
    pub positions: Range<usize>,
    pub rect: PixelRect,
    /// Of all its bricks, as in [`PlannedBrick`], on average.
    pub samples_per_pixel: f64,
}

impl FramePlan {
    pub(super) fn new(order: &RenderOrder, sources: &Sources<'_>, workshop: Workshop<'_>) -> Result<Self, NodeError> {
        let manifest = sources.root.store.manifest();
        let choices = Choices::new(order, sources, workshop.tables)?;
        let levels = choices.levels(&order.scene)?;
        let tree = MergeTree::of(manifest.grid);
        let extreme = order.scene.quality.extreme;
        let mut plan = Self {
            tree,
            from: order.scene.view_of(&manifest.geometry)?.viewpoint(),
            levels,
            level_by_level: extreme.is_some() || !workshop.raycaster.takes_scenes_together(),
            interval: extreme.map(|extreme| choices.of(0).interval(extreme)),
            bricks: Vec::new(),
            pieces: Vec::new(),
            units: Vec::new(),
            shares: BrickShares { at_once: 1, loading: 0, resident: 0 },
            pass_bytes: 0,
            visits: Visits::default(),
        };
        // Every layer is checked before any is planned: a bad order costs nothing.
        let layers = order.layers.iter().map(|layer| check(&tree, layer)).collect::<Result<Vec<_>, _>>()?;
        let mut gathered = Vec::with_capacity(layers.len());
        for (layer, chunks) in order.layers.iter().zip(layers) {
            gathered.push(plan.gather(layer, &chunks, order, &choices, workshop)?);
        }
        plan.share(workshop, sources.parts.iter().any(|source| source.store.store.is_far()))?;
        for (at, (layer, gathered)) in order.layers.iter().zip(gathered).enumerate() {
            plan.add_layer(at, layer, &gathered, order, workshop)?;
        }
        let visits = plan.units.iter().flat_map(|unit| &unit.positions).map(|&p| plan.bricks[p].wanted);
        plan.visits = Visits::new(visits);
        Ok(plan)
    }

    /// Shares the memory among the bricks of all layers.
    fn share(&mut self, workshop: Workshop<'_>, is_far: bool) -> Result<(), NodeError> {
        let budget = workshop.residency.budget();
        let mut largest = Need::default();
        for brick in &self.bricks {
            let need = brick.wanted.need();
            if workshop.residency.shares(need, is_far).is_none() {
                return Err(NodeError::BrickTooLarge { brick: brick.index, need, budget });
            }
            largest = largest.max(need);
        }
        // The largest brick is the one that takes most to load.
        self.shares = workshop
            .residency
            .shares(largest, is_far)
            .ok_or(NodeError::BatchTooLarge { bytes: largest.bytes.saturating_add(largest.loading), budget })?;
        let all: Vec<usize> = (0..self.bricks.len()).collect();
        self.pass_bytes = self.shares.of_a_pass(self.bytes(&all));
        Ok(())
    }

    fn gather(
        &mut self,
        layer: &LayerOrder,
        chunks: &[ChunkIndex],
        order: &RenderOrder,
        choices: &Choices<'_>,
        workshop: Workshop<'_>,
    ) -> Result<Gathered, NodeError> {
        let window = layer.tiles.pixels(order.scene.view.size);
        let mut by_chunk: HashMap<TreeNode, Vec<usize>> = HashMap::new();
        for chunk in chunks {
            let positions = self.visible(*chunk, &window, choices, workshop)?;
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
        Ok(Gathered { leaves, by_chunk })
    }

    fn add_layer(
        &mut self,
        at: usize,
        layer: &LayerOrder,
        Gathered { leaves, by_chunk }: &Gathered,
        order: &RenderOrder,
        workshop: Workshop<'_>,
    ) -> Result<(), NodeError> {
        let budget = self.shares.resident;
        let window = layer.tiles.pixels(order.scene.view.size);
        // Intervals are known of a ray as a whole: nothing can go on where it ended.
        let in_passes = self.interval.is_none();
        if order.scene.quality.exact && !in_passes {
            for leaf in leaves {
                let bytes = self.bytes(&by_chunk[leaf]);
                if bytes > budget {
                    let chunk = self.bricks[by_chunk[leaf][0]].chunk;
                    return Err(NodeError::ChunkTooLarge { chunk, bytes, budget });
                }
            }
        }
        let all: Vec<usize> = self.front_to_back(leaves, by_chunk);
        let pixels = self.band_pixels(&all, &window, workshop);
        for tiles in layer.tiles.bands(pixels) {
            let band = tiles.pixels(order.scene.view.size);
            let before = self.units.len();
            let join = if order.scene.quality.exact {
                for leaf in leaves {
                    self.add_unit(Some(*leaf), &by_chunk[leaf], &band);
                }
                Join::Tree
            } else if in_passes {
                self.add_unit(None, &all, &band);
                Join::InOrder
            } else {
                let touching: Vec<usize> = self.touching(&all, &band);
                for run in self.runs(&touching, budget) {
                    self.add_unit(None, &touching[run], &band);
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
        if self.bytes(positions) > self.shares.resident {
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
        choices: &Choices<'_>,
        workshop: Workshop<'_>,
    ) -> Result<Vec<usize>, NodeError> {
        let id = self.tree.chunk_id(chunk);
        let (level, chunk) = choices.at(id, chunk)?;
        let PlanLevel { scene, tree, borders } = &self.levels[level];
        let (view, grid) = (&scene.view, tree.grid());
        let chunk_box = tree.voxel_box(tree.leaf(chunk));
        if chunk_box.is_none_or(|voxels| view.project(&voxels).intersect(window).is_empty()) {
            return Ok(Vec::new());
        }
        let mut indices: Vec<BrickIndex> = tree.bricks_of(chunk).collect();
        sort_front_to_back(&mut indices, grid.brick_size(), view.viewpoint());
        let mut positions = Vec::new();
        for index in indices {
            let rect = view.project(&grid.owned_box(index)).intersect(window);
            if rect.is_empty() {
                continue;
            }
            let meets = borders.as_ref().map_or(Meets::default(), |borders| borders.of_brick(tree, index));
            let chosen = choices.of(level).of(index, meets.coarser, workshop.raycaster);
            let Some(Chosen { wanted, drawn }) = chosen else { continue };
            let samples_per_pixel = self.levels[level].samples_across(&grid.owned_box(index));
            // No step is shorter than the finest level's.
            let sides = if borders.as_ref().is_some_and(|b| b.level() > 0) { meets.others } else { Sides::default() };
            positions.push(self.bricks.len());
            let brick = PlannedBrick { wanted, drawn, level, index, chunk: id, sides, rect, samples_per_pixel };
            self.bricks.push(brick);
        }
        Ok(positions)
    }

    /// The bricks of a layer, front to back.
    fn front_to_back(&self, leaves: &[TreeNode], by_chunk: &HashMap<TreeNode, Vec<usize>>) -> Vec<usize> {
        let all = leaves.iter().flat_map(|leaf| by_chunk[leaf].iter().copied());
        if self.levels.len() > 1 {
            let rect = |bricks: &[usize]| bricks.iter().fold(NOTHING, |all, &p| all.union(&self.bricks[p].rect));
            let seen = |leaf: &TreeNode| {
                let bricks = &by_chunk[leaf];
                Seen { level: self.bricks[bricks[0]].level, rect: rect(bricks) }
            };
            let order = by_levels(&leaves.iter().map(seen).collect::<Vec<_>>());
            return order.into_iter().flat_map(|place| by_chunk[&leaves[place]].iter().copied()).collect();
        }
        let at: HashMap<BrickIndex, usize> = all.map(|p| (self.bricks[p].index, p)).collect();
        let mut indices: Vec<BrickIndex> = at.keys().copied().collect();
        // The one level, which may be a coarser one than the order's store: from where its own voxels are seen.
        if let Some(level) = self.levels.first() {
            sort_front_to_back(&mut indices, level.tree.grid().brick_size(), level.scene.view.viewpoint());
        }
        indices.iter().map(|index| at[index]).collect()
    }

    /// Those that touch `band`.
    fn touching(&self, positions: &[usize], band: &PixelRect) -> Vec<usize> {
        let touches = |p: &usize| !self.bricks[*p].rect.intersect(band).is_empty();
        positions.iter().copied().filter(touches).collect()
    }

    /// Cuts positions into runs of at most so many bytes of bricks, and of one level where these are drawn one by one;
    /// a run of a single brick may have more.
    fn runs(&self, positions: &[usize], bytes: u64) -> Vec<Range<usize>> {
        let (mut runs, mut first, mut sum) = (Vec::new(), 0, 0_u64);
        let level = |i: usize| if self.level_by_level { self.bricks[positions[i]].level } else { 0 };
        for (i, &position) in positions.iter().enumerate() {
            let more = self.bricks[position].wanted.bytes;
            if i > first && (sum.saturating_add(more) > bytes || level(i) != level(first)) {
                runs.push(first..i);
                (first, sum) = (i, 0);
            }
            sum = sum.saturating_add(more);
        }
        if first < positions.len() {
            runs.push(first..positions.len());
        }
        runs
    }

    fn add_unit(&mut self, leaf: Option<TreeNode>, positions: &[usize], band: &PixelRect) {
        let positions = self.touching(positions, band);
        let bytes = if self.interval.is_some() { u64::MAX } else { self.pass_bytes };
        let mut rect = NOTHING;
        let mut passes = Vec::new();
        for run in self.runs(&positions, bytes) {
            let of_pass = &positions[run.clone()];
            let parts = of_pass.iter().map(|&p| self.bricks[p].rect.intersect(band));
            let covered = parts.fold(NOTHING, |all, part| all.union(&part));
            let samples_per_pixel = self.samples(of_pass, &covered) / covered.pixel_count().max(1) as f64;
            rect = rect.union(&covered);
            passes.push(Pass { positions: run, rect: covered, samples_per_pixel });
        }
        if !passes.is_empty() {
            self.units.push(Unit { leaf, positions, rect, passes });
        }
    }

    /// What is left in accumulators: of every level the same.
    pub(super) fn pixel_kind(&self) -> PixelKind {
        self.levels.first().map_or(PixelKind::Over, |level| level.scene.pixel_kind())
    }

    pub(super) fn bytes(&self, positions: &[usize]) -> u64 {
        positions.iter().map(|&p| self.bricks[p].wanted.bytes).fold(0, u64::saturating_add)
    }
}

const NOTHING: PixelRect = PixelRect { lo: UVec2::ZERO, hi: UVec2::ZERO };

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

//! What a look shows of each of a volume's finest chunks, whatever the view.

use crate::ids::ChunkIndex;
use crate::look_on::{BricksOf, LookOn, NewTables};
use crate::merge::MergeTree;
use crate::per_chunk::PerChunk;
use crate::scene::Scene;
use crate::style::Mode;
use crate::transfer_function::TableExtremes;

const LAST_CODE: f32 = 65_535.0;

/// Of every finest chunk whether it shows anything, and between which codes its samples lie.
#[derive(Debug, Clone)]
pub struct Content {
    tree: MergeTree,
    shows: PerChunk<bool>,
    /// Smallest and largest; the first above the second where there is no data.
    ranges: PerChunk<[u16; 2]>,
    /// What samples of a range of codes look like; nothing where more than the code decides that.
    looks: Option<TableExtremes>,
    /// Some voxels hold no data, which no range tells.
    has_holes: bool,
}

impl Content {
    /// Of the finest level's `bricks`; `shows` says which of the chunks of `tree` have something to show.
    #[must_use]
    pub fn new(tree: &MergeTree, scene: &Scene, bricks: BricksOf<'_>, shows: PerChunk<bool>) -> Self {
        let (look, style) = (&scene.look, &scene.look.style);
        let by_code = style.mode == Mode::Composite
            && style.shading.is_none()
            && style.surfaces.is_empty()
            && !look.tells_regions_apart();
        let looks = by_code.then(|| TableExtremes::new(LookOn::new(scene, bricks, &NewTables).main()));
        let range = |brick| bricks.ranges.get(tree.grid().id(brick).index()).copied().unwrap_or([0, u16::MAX]);
        let of_chunk = |chunk: ChunkIndex| tree.bricks_of(chunk).map(range).fold([u16::MAX, 0], around);
        let ranges = tree.chunk_ids().filter_map(|chunk| tree.chunk_at(chunk)).map(of_chunk).collect();
        Self { tree: *tree, shows, ranges, looks, has_holes: bricks.manifest.no_data.is_some() }
    }

    /// Of chunks that look different wherever they hold different codes.
    #[cfg(test)]
    pub(super) fn of(tree: &MergeTree, shows: PerChunk<bool>, ranges: PerChunk<[u16; 2]>) -> Self {
        Self { tree: *tree, shows, ranges, looks: None, has_holes: false }
    }

    /// Does any of these chunks show anything?
    pub(super) fn shows(&self, mut chunks: impl Iterator<Item = ChunkIndex>) -> bool {
        chunks.any(|chunk| self.shows[self.tree.chunk_id(chunk)])
    }

    /// How much what samples in these chunks show can differ, from 0 to 1: their opacity, or their colour as far as
    /// they have any.
    pub(super) fn deviation(&self, chunks: impl Iterator<Item = ChunkIndex>) -> f64 {
        let [lo, hi] = chunks.map(|chunk| self.ranges[self.tree.chunk_id(chunk)]).fold([u16::MAX, 0], around);
        if lo >= hi {
            return 0.0;
        }
        let Some(looks) = &self.looks else { return f64::from(hi - lo) / f64::from(LAST_CODE) };
        let shown = looks.over([lo, hi].map(|code| f32::from(code) / LAST_CODE));
        if shown.is_clear() {
            return 0.0;
        }
        let differ = |[least, most]: [f32; 2]| (most - least).max(0.0);
        let color = shown.color.into_iter().map(differ).fold(0.0, f32::max);
        f64::from(differ(shown.alpha).max(shown.alpha[1] * color))
    }

    /// True where all samples in these chunks have one colour and one opacity: a coarser level shows the same.
    pub(super) fn is_flat(&self, chunks: impl Iterator<Item = ChunkIndex>) -> bool {
        let [lo, hi] = chunks.map(|chunk| self.ranges[self.tree.chunk_id(chunk)]).fold([u16::MAX, 0], around);
        if lo >= hi {
            return lo > hi || !self.has_holes;
        }
        let Some(looks) = &self.looks else { return false };
        let shown = looks.over([lo, hi].map(|code| f32::from(code) / LAST_CODE));
        let is_one = |[least, most]: [f32; 2]| least >= most;
        shown.is_clear() || (!self.has_holes && is_one(shown.alpha) && shown.color.into_iter().all(is_one))
    }
}

fn around(a: [u16; 2], b: [u16; 2]) -> [u16; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

//! Which levels can be had (docs/adr/0026-what-cannot-be-had.md).
//!
//! Invariant: what is drawn is the finest that is no finer than what was asked, and than what some node can read.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use brickcast_volume::lod::{Levels, Selection};
use brickcast_volume::{BrickId, ChunkId, ChunkIndex, PerChunk};
use glam::UVec3;

/// After so long what could not be read is tried again: a network may be back.
const TRIED_AGAIN: Duration = Duration::from_secs(60);

/// What no node could read.
#[derive(Debug, Default)]
pub(super) struct Floor {
    /// Of each finest chunk the finest level above all that could not be read; 0: its own.
    levels: BTreeMap<ChunkId, u8>,
    /// Chunks that could be read on no level that was tried: drawn as was asked, and missing.
    lost: BTreeSet<ChunkId>,
    why: BTreeMap<(u8, BrickId), String>,
    since: Option<Instant>,
}

impl Floor {
    /// Nothing is drawn otherwise than asked.
    pub(super) fn is_none(&self) -> bool {
        self.levels.is_empty()
    }

    /// Between frames, so that what is told of one is what it was drawn by: what is long ago is forgotten.
    pub(super) fn forget(&mut self) {
        if self.since.is_some_and(|since| since.elapsed() > TRIED_AGAIN) {
            *self = Self::default();
        }
    }

    /// What is drawn of a selection.
    pub(super) fn had<'a>(&self, selection: &'a Selection) -> Cow<'a, Selection> {
        if self.is_none() {
            return Cow::Borrowed(selection);
        }
        let mut floor = PerChunk::filled(0, selection.per_chunk().count());
        self.levels.iter().for_each(|(chunk, level)| floor[*chunk] = *level);
        Cow::Owned(selection.no_finer(&floor))
    }

    pub(super) fn reasons(&self) -> Vec<String> {
        let mut reasons: Vec<String> = self.why.values().cloned().collect();
        reasons.dedup();
        reasons
    }

    /// Learns of bricks that nobody can read, and why; false where there is nothing to draw in their place.
    pub(super) fn raise(&mut self, levels: &Levels, lacking: impl Iterator<Item = (u8, BrickId, String)>) -> bool {
        let mut changed = false;
        for (level, brick, why) in lacking {
            for chunk in chunks_of(levels, level, brick) {
                if self.lost.contains(&chunk) {
                    continue;
                }
                let above = level + 1;
                if above < levels.count() {
                    let known = self.levels.entry(chunk).or_insert(0);
                    changed |= *known < above;
                    *known = above.max(*known);
                    self.why.entry((level, brick)).or_insert_with(|| why.clone());
                } else if self.levels.remove(&chunk).is_some() {
                    self.lost.insert(chunk);
                    changed = true;
                }
            }
        }
        if self.is_none() {
            self.why.clear();
        }
        if changed {
            self.since = Some(Instant::now());
        }
        changed
    }
}

/// The finest chunks in which a part of a brick lies.
fn chunks_of(levels: &Levels, level: u8, brick: BrickId) -> Vec<ChunkId> {
    let (grid, finest) = (levels.tree(level).grid(), levels.finest());
    if brick.index() as u64 >= grid.brick_count() {
        return Vec::new();
    }
    let index = UVec3::from(grid.index_of(brick).0);
    let edge = finest.chunk_bricks();
    let lo = index * (1 << level) / edge;
    let hi = ((index + 1) * (1 << level)).map(|end| end.div_ceil(edge)).min(finest.chunk_dims());
    let places = (lo.z..hi.z).flat_map(|z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| [x, y, z])));
    places.map(|place| finest.chunk_id(ChunkIndex(place))).collect()
}

#[cfg(test)]
mod tests {
    use brickcast_volume::{BrickGrid, Geometry};

    use super::*;

    /// 64 bricks of 8 voxels, a chunk each, in three levels.
    fn levels() -> Levels {
        let grid = BrickGrid::new(UVec3::splat(32), 8).unwrap();
        Levels::new(&Geometry::new([32; 3], [1.0; 3], [0.0; 3]).unwrap(), grid, 3)
    }

    #[test]
    fn what_is_broken_is_drawn_on_the_next_level_and_what_has_none_as_it_was_asked() {
        let levels = levels();
        let finest = levels.finest();
        assert_eq!(finest.chunk_count(), 64);
        let at = |place| finest.chunk_id(ChunkIndex(place));
        let mut floor = Floor::default();
        let brick = finest.grid().id(brickcast_volume::BrickIndex([1, 0, 2]));
        let of = |level, brick| std::iter::once((level, brick, format!("level {level}")));
        assert!(floor.is_none() && floor.raise(&levels, of(0, brick)) && !floor.is_none());
        assert_eq!(floor.levels, BTreeMap::from([(at([1, 0, 2]), 1)]));
        assert!(!floor.raise(&levels, of(0, brick)), "nothing new");
        // The brick of level 1 over it: its eight chunks.
        let over = levels.tree(1).grid().id(brickcast_volume::BrickIndex([0, 0, 1]));
        assert!(floor.raise(&levels, of(1, over)));
        assert!(floor.levels.len() == 8 && floor.levels.values().all(|&level| level == 2), "{:?}", floor.levels);
        assert_eq!(floor.reasons(), ["level 0", "level 1"]);
        // And the coarsest level, which is one brick.
        assert!(floor.raise(&levels, of(2, BrickId::finest(0))) && floor.is_none());
        assert_eq!((floor.lost.len(), floor.reasons().len()), (8, 0));
        assert!(!floor.raise(&levels, of(0, brick)), "there is nothing left to draw in its place");
        assert!(!floor.raise(&levels, of(2, BrickId::finest(1))), "no brick");
        floor.forget();
        assert_eq!(floor.lost.len(), 8, "just now");
        floor.since = Instant::now().checked_sub(TRIED_AGAIN * 2);
        floor.forget();
        assert!(floor.since.is_none() || floor.lost.is_empty());
        assert!(floor.raise(&levels, of(0, brick)), "tried again");
    }
}

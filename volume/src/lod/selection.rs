//! Which chunk is drawn on which level.

use super::balance::{balance, coarsen};
use super::content::Content;
use super::levels::Levels;
use super::rule::Rule;
use super::sight::Sight;
use crate::brick::OwnedBox;
use crate::ids::{ChunkId, ChunkIndex};
use crate::per_chunk::PerChunk;
use crate::scene::ViewSpec;
use crate::visibility::ViewError;

/// On which level each finest chunk is drawn: every one on exactly one, coarse chunks whole, face neighbours at most
/// one level apart. By look and view alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    levels: Levels,
    of: PerChunk<u8>,
    /// Finest chunks that show something.
    shows: PerChunk<bool>,
}

/// What one level draws of a volume; over the chunks of that level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    pub level: u8,
    /// Chunks that are drawn on this level.
    pub drawn: PerChunk<bool>,
    /// Chunks in which another level draws something.
    pub elsewhere: PerChunk<bool>,
    /// Of these, chunks in which a coarser level does.
    pub coarser: PerChunk<bool>,
}

impl Selection {
    /// From the coarsest level down: a chunk is drawn on the first level that is fine enough by `rule`, and finer where
    /// a neighbour asks for it.
    ///
    /// # Errors
    /// An eye so far away that no picture can be made.
    pub fn new(levels: &Levels, content: &Content, rule: Rule, seen: &ViewSpec) -> Result<Self, ViewError> {
        let sight = Sight::new(levels, content, rule, seen)?;
        let tree = levels.finest();
        let mut of = PerChunk::filled(0, tree.chunk_count() as usize);
        let coarsest = levels.count() - 1;
        let of_coarsest = levels.tree(coarsest);
        let mut open: Vec<(u8, ChunkIndex)> =
            of_coarsest.chunk_ids().filter_map(|c| Some((coarsest, of_coarsest.chunk_at(c)?))).collect();
        while let Some((level, chunk)) = open.pop() {
            if level == 0 || sight.is_fine_enough(level, chunk) {
                levels.under(level, chunk).for_each(|finest| of[tree.chunk_id(finest)] = level);
            } else {
                open.extend(levels.refined(level, chunk).map(|finer| (level - 1, finer)));
            }
        }
        balance(levels, &mut of);
        Ok(Self::of_levels(levels, content, of))
    }

    /// By the level of each finest chunk: coarse chunks whole, and balanced.
    pub(super) fn of_levels(levels: &Levels, content: &Content, of: PerChunk<u8>) -> Self {
        let tree = levels.finest();
        let shows = tree.chunk_ids().filter_map(|c| tree.chunk_at(c)).map(|c| content.shows(std::iter::once(c)));
        Self { shows: shows.collect(), levels: levels.clone(), of }
    }

    /// The same, drawn nowhere finer than `floor` says of each finest chunk, as fine as that allows.
    #[must_use]
    pub fn no_finer(&self, floor: &PerChunk<u8>) -> Self {
        let mut of = self.of.clone();
        let coarsest = self.levels.count() - 1;
        let floor = floor.values().map(|&level| level.min(coarsest)).collect();
        coarsen(&self.levels, &mut of, &floor);
        Self { of, ..self.clone() }
    }

    /// The chunks of all levels that are drawn, whether they show anything or not.
    pub(super) fn parts(&self) -> impl Iterator<Item = (u8, ChunkIndex)> + '_ {
        let tree = self.levels.finest();
        self.of.iter().filter_map(|(id, &level)| {
            let finest = tree.chunk_at(id)?;
            let chunk = self.levels.over(level, finest);
            (self.levels.under(level, chunk).next() == Some(finest)).then_some((level, chunk))
        })
    }

    #[must_use]
    pub fn levels(&self) -> &Levels {
        &self.levels
    }

    /// The level of each finest chunk.
    #[must_use]
    pub fn per_chunk(&self) -> &PerChunk<u8> {
        &self.of
    }

    /// The coarsest level on which any of these voxels of the finest level are drawn.
    #[must_use]
    pub fn level_in(&self, voxels: &OwnedBox) -> u8 {
        let tree = self.levels.finest();
        let edge = tree.chunk_bricks() * tree.grid().brick_size();
        let (lo, hi) = (voxels.lo / edge, voxels.hi.map(|v| v.div_ceil(edge)).min(tree.chunk_dims()));
        let row = |y, z| (lo.x..hi.x).map(move |x| ChunkIndex([x, y, z]));
        let chunks = (lo.z..hi.z).flat_map(|z| (lo.y..hi.y).flat_map(move |y| row(y, z)));
        chunks.map(|chunk| self.of[tree.chunk_id(chunk)]).max().unwrap_or_default()
    }

    /// Does a finest chunk show anything?
    #[must_use]
    pub fn shows(&self, finest: ChunkId) -> bool {
        self.shows[finest]
    }

    /// The levels that draw something, the finest first.
    pub fn used(&self) -> impl Iterator<Item = u8> + '_ {
        let draws = |level: &u8| self.of.iter().any(|(c, of)| of == level && self.shows[c]);
        self.levels.all().filter(move |level| draws(level))
    }

    /// What `level` draws. A chunk that shows nothing on the finest level is drawn on none.
    #[must_use]
    pub fn part(&self, level: u8) -> Part {
        let (tree, finest) = (self.levels.tree(level), self.levels.finest());
        let chunks = || tree.chunk_ids().filter_map(|c| tree.chunk_at(c));
        let shown_on = |chunk: ChunkIndex, is: &dyn Fn(u8) -> bool| {
            let mut under = self.levels.under(level, chunk).map(|c| finest.chunk_id(c));
            under.any(|c| self.shows[c] && is(self.of[c]))
        };
        Part {
            level,
            drawn: chunks().map(|c| shown_on(c, &|of| of == level)).collect(),
            elsewhere: chunks().map(|c| shown_on(c, &|of| of != level)).collect(),
            coarser: chunks().map(|c| shown_on(c, &|of| of > level)).collect(),
        }
    }
}

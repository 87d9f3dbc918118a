//! Which chunks are drawn on which level within what a frame may cost.
//!
//! From the coarsest assignment on, the refinement goes first that takes most error away for what it costs: the size at
//! which a voxel is seen x how much the transfer function changes within the chunk x the pixels that it covers, over
//! the samples that it takes. A refinement takes with it those of its neighbours that balance asks for. What was
//! refined before has precedence, and may take all of the budget; what was not leaves some of it: costs that are
//! measured a little differently change nothing.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashSet};

use super::balance::neighbours;
use super::content::Content;
use super::levels::Levels;
use super::rule::Rule;
use super::selection::Selection;
use super::sight::Sight;
use crate::ids::ChunkIndex;
use crate::per_chunk::PerChunk;
use crate::scene::ViewSpec;
use crate::visibility::ViewError;

/// How much more what was refined before counts.
const PRECEDENCE: f64 = 1.5;
/// What was not refined before leaves so much of a budget.
const SPARED: f64 = 0.15;

/// What a frame may cost.
#[derive(Debug, Clone, Copy)]
pub struct Budget<'a> {
    /// In samples, as [`Selection::cost`] counts.
    pub cost: f64,
    /// What the frame before was drawn with.
    pub before: Option<&'a Selection>,
}

/// A refinement that may be made.
struct Refinement {
    /// What it gains for what it costs.
    worth: f64,
    level: u8,
    chunk: ChunkIndex,
    was_made_before: bool,
}

impl Ord for Refinement {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_place = || (self.level, self.chunk).cmp(&(other.level, other.chunk));
        self.worth.total_cmp(&other.worth).then_with(by_place)
    }
}

impl PartialOrd for Refinement {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Refinement {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Refinement {}

/// An assignment that is being refined.
struct Refining<'a> {
    levels: &'a Levels,
    of: PerChunk<u8>,
    cost: f64,
}

impl Selection {
    /// As [`Selection::new`] where `budget` suffices for that; else as much of it as the budget allows, the best
    /// first, and nothing but the coarsest level where it does not even suffice for that.
    ///
    /// # Errors
    /// As [`Selection::new`].
    pub fn within(
        levels: &Levels,
        content: &Content,
        rule: Rule,
        seen: &ViewSpec,
        budget: Budget<'_>,
    ) -> Result<Self, ViewError> {
        let sight = Sight::new(levels, content, rule, seen)?;
        let (tree, coarsest) = (levels.finest(), levels.count() - 1);
        let of = PerChunk::filled(coarsest, tree.chunk_count() as usize);
        let mut now = Refining { levels, of, cost: 0.0 };
        let roots = levels.tree(coarsest);
        let roots: Vec<ChunkIndex> = roots.chunk_ids().filter_map(|c| roots.chunk_at(c)).collect();
        now.cost = roots.iter().map(|&chunk| sight.cost(coarsest, chunk)).sum();
        let before = budget.before.filter(|before| before.levels() == levels);
        let refinement = |level, chunk| {
            let was_made_before = before.is_some_and(|before| before.is_finer(level, chunk));
            let factor = if was_made_before { PRECEDENCE } else { 1.0 };
            Refinement { worth: factor * sight.worth(level, chunk), level, chunk, was_made_before }
        };
        let is_wanted = |level: u8, chunk| level > 0 && !sight.is_fine_enough(level, chunk);
        let wanted = roots.into_iter().filter(|&chunk| is_wanted(coarsest, chunk));
        let mut open: BinaryHeap<Refinement> = wanted.map(|chunk| refinement(coarsest, chunk)).collect();
        while let Some(Refinement { level, chunk, was_made_before, .. }) = open.pop() {
            if !now.is_drawn(level, chunk) {
                continue;
            }
            let refined = now.with(level, chunk);
            let more: f64 = refined.iter().map(|&(level, chunk)| sight.more_cost(level, chunk)).sum();
            let limit = if was_made_before { budget.cost } else { budget.cost * (1.0 - SPARED) };
            // What costs nothing is refined whatever the rest costs.
            if more > 0.0 && now.cost + more > limit {
                continue;
            }
            now.cost += more;
            for (level, chunk) in refined {
                now.refine(level, chunk);
                let finer = levels.refined(level, chunk).filter(|&finer| is_wanted(level - 1, finer));
                open.extend(finer.map(|finer| refinement(level - 1, finer)));
            }
        }
        Ok(Self::of_levels(levels, content, now.of))
    }

    /// Samples that a view takes of what is drawn, on average and where no ray ends early: a guess, and the same for
    /// the same selection and view.
    ///
    /// # Errors
    /// As [`Selection::new`].
    pub fn cost(&self, content: &Content, seen: &ViewSpec) -> Result<f64, ViewError> {
        let sight = Sight::new(self.levels(), content, Rule::Cone, seen)?;
        Ok(self.parts().map(|(level, chunk)| sight.cost(level, chunk)).sum())
    }

    /// Is any of a level's chunk drawn on a finer level?
    fn is_finer(&self, level: u8, chunk: ChunkIndex) -> bool {
        let tree = self.levels().finest();
        self.levels().under(level, chunk).any(|finest| self.per_chunk()[tree.chunk_id(finest)] < level)
    }
}

impl Refining<'_> {
    /// Is a level's chunk drawn on this level?
    fn is_drawn(&self, level: u8, chunk: ChunkIndex) -> bool {
        let tree = self.levels.finest();
        self.levels.under(level, chunk).next().is_some_and(|finest| self.of[tree.chunk_id(finest)] == level)
    }

    /// A refinement, and before it those of coarser neighbours without which levels would not be balanced.
    fn with(&self, level: u8, chunk: ChunkIndex) -> Vec<(u8, ChunkIndex)> {
        let tree = self.levels.finest();
        let dims = tree.chunk_dims().to_array();
        let (mut all, mut known, mut open) = (Vec::new(), HashSet::from([(level, chunk)]), vec![(level, chunk)]);
        while let Some((level, chunk)) = open.pop() {
            all.push((level, chunk));
            for finest in self.levels.under(level, chunk) {
                for near in neighbours(finest, dims) {
                    let of_near = self.of[tree.chunk_id(near)];
                    let coarser = (of_near, self.levels.over(of_near, near));
                    if of_near > level && known.insert(coarser) {
                        open.push(coarser);
                    }
                }
            }
        }
        all.sort_unstable_by_key(|&refined| std::cmp::Reverse(refined));
        all
    }

    fn refine(&mut self, level: u8, chunk: ChunkIndex) {
        let tree = self.levels.finest();
        for finest in self.levels.under(level, chunk) {
            self.of[tree.chunk_id(finest)] = level - 1;
        }
    }
}

#[cfg(test)]
mod tests;

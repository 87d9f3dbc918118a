//! Which levels a picture was drawn of, as its manifest keeps it: to draw the very same again, whatever chose them.

use std::sync::Arc;

use super::balance::neighbours;
use super::content::Content;
use super::levels::Levels;
use super::rule::LodError;
use super::selection::Selection;
use crate::per_chunk::PerChunk;

/// The level of each of a volume's finest chunks, x fastest, as runs of equal ones: their level and how many.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LevelSet(Arc<[(u8, u32)]>);

impl LevelSet {
    /// # Errors
    /// A run of nothing, more chunks than are counted.
    pub fn new(runs: impl IntoIterator<Item = (u8, u32)>) -> Result<Self, LodError> {
        let set = Self(runs.into_iter().collect());
        let all = set.0.iter().try_fold(0_u32, |sum, (_, run)| sum.checked_add(*run).filter(|_| *run > 0));
        if all.is_some() { Ok(set) } else { Err(LodError::Runs) }
    }

    #[must_use]
    pub fn runs(&self) -> &[(u8, u32)] {
        &self.0
    }

    /// Of how many chunks.
    fn count(&self) -> u32 {
        self.0.iter().map(|(_, run)| run).sum()
    }
}

impl Selection {
    /// What is drawn on which level.
    #[must_use]
    pub fn set(&self) -> LevelSet {
        let mut runs: Vec<(u8, u32)> = Vec::new();
        for &level in self.per_chunk().values() {
            match runs.last_mut() {
                Some((last, run)) if *last == level => *run += 1,
                _ => runs.push((level, 1)),
            }
        }
        LevelSet(runs.into())
    }

    /// By what was written down.
    ///
    /// # Errors
    /// A set of another volume, or one that draws no chunk of a level whole, or face neighbours of which one is more
    /// than a level coarser.
    pub fn of_set(levels: &Levels, content: &Content, set: &LevelSet) -> Result<Self, LodError> {
        let tree = levels.finest();
        let (got, want) = (set.count(), tree.chunk_count());
        if u64::from(got) != want {
            return Err(LodError::SetOfOthers { got, want });
        }
        let runs = set.runs().iter().flat_map(|&(level, run)| std::iter::repeat_n(level, run as usize));
        let of: PerChunk<u8> = runs.collect();
        for (id, &level) in of.iter() {
            let coarsest = levels.count() - 1;
            if level > coarsest {
                return Err(LodError::SetLevel { chunk: id, level, coarsest });
            }
            let Some(chunk) = tree.chunk_at(id) else { continue };
            let mut whole = levels.under(level, levels.over(level, chunk)).map(|same| of[tree.chunk_id(same)]);
            let mut near = neighbours(chunk, tree.chunk_dims().to_array()).map(|near| of[tree.chunk_id(near)]);
            if whole.any(|same| same != level) || near.any(|near| near.abs_diff(level) > 1) {
                return Err(LodError::SetChunk { chunk: id, level });
            }
        }
        Ok(Self::of_levels(levels, content, of))
    }
}

//! A selection as a set that is written down, and one of what was written.

use super::balance::neighbours;
use super::content::Content;
use super::levels::Levels;
use super::rule::LodError;
use super::selection::Selection;
use super::set::LevelSet;
use crate::per_chunk::PerChunk;

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
        LevelSet::of_runs(runs)
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

//! Which levels a picture was drawn of, as its manifest keeps it: to draw the very same again, whatever chose them.

use std::sync::Arc;

use super::rule::LodError;

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

    /// Of runs that are none of nothing, and no more chunks than are counted.
    pub(super) fn of_runs(runs: Vec<(u8, u32)>) -> Self {
        Self(runs.into())
    }

    #[must_use]
    pub fn runs(&self) -> &[(u8, u32)] {
        &self.0
    }

    /// Of how many chunks.
    pub(super) fn count(&self) -> u32 {
        self.0.iter().map(|(_, run)| run).sum()
    }
}

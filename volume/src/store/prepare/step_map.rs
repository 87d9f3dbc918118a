//! What the inputs of all steps have in common, found before the first of them is prepared.

use super::quantise::Scan;

/// One map from voxels to stored numbers and codes for all steps of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepMap {
    /// Of voxels that are mapped to 16 bits: of one step alone.
    pub(crate) own: Option<Scan>,
    /// The same of all steps together.
    pub(crate) all: Option<Scan>,
    /// Smallest and largest value of all steps, data units.
    pub(crate) bounds: (f64, f64),
}

impl StepMap {
    /// This step's, joined with what is known of `others`.
    pub(crate) fn joined(self, others: Self) -> Self {
        let all = match (self.all, others.all) {
            (Some(a), Some(b)) => Some(a.joined(b)),
            (a, b) => a.or(b),
        };
        let bounds = (self.bounds.0.min(others.bounds.0), self.bounds.1.max(others.bounds.1));
        Self { own: self.own, all, bounds }
    }
}

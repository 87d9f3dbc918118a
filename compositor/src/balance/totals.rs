//! What was decided since the start, summed up.

use super::spread::Plan;

/// Sums over the session, and the last frame's loads.
#[derive(Debug, Clone, Default)]
pub(super) struct Totals {
    pub(super) plan: Plan,
    /// Index and load of the nodes that answered last.
    pub(super) measured: Vec<(usize, f64)>,
    pub(super) splits: u64,
    pub(super) handovers: u64,
    pub(super) adoptions: u64,
    pub(super) copies: u64,
    pub(super) moves: u64,
    pub(super) bytes_loaded: u64,
}

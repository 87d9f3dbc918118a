//! What passes between walk and take: the twin's `run.rs`, a lane each.

use super::lanes::Lanes;

/// What a walk knows of positions before they are read: the twin's `Step`, a lane each.
pub(crate) struct Step<L: Lanes> {
    /// Of the position (0..=1), where that is known.
    pub(crate) code: L::F,
    pub(crate) is_known: L::M,
    /// All positions up to `k_exit` are like this one.
    pub(crate) jumps: L::M,
    pub(crate) k_exit: L::F,
    /// The map was asked, and says so: nothing is read.
    pub(crate) looked: L::M,
    pub(crate) is_by_map: L::M,
    /// Deep in a region, as the texel says.
    pub(crate) is_deep: L::M,
    /// Deep in a region or in a cube of one value: no gradient.
    pub(crate) is_flat: L::M,
}

/// Positions from `k` to below `k + n`, of one code: the twin's `Run`, a lane each.
pub(crate) struct Run<L: Lanes> {
    pub(crate) k: L::F,
    pub(crate) n: L::F,
    /// From the first of them to the last where other levels are next to the brick; elsewhere that is `n - 1`.
    pub(crate) within: L::F,
    /// Those of them that the brick owns.
    pub(crate) owns: L::F,
    /// Some lane's run may have another length than a step.
    pub(crate) jumps: bool,
    pub(crate) code: L::F,
    pub(crate) in_region: L::M,
    pub(crate) is_flat: L::M,
    /// The position before it was taken: a slab lies between.
    pub(crate) follows: L::M,
}

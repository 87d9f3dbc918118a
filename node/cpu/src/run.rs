//! What passes between walk and take: the twin's `run.rs`, a lane each.

use super::lanes::Lanes;

/// What a walk knows of positions before they are read: the twin's `Step`, a lane each.
#[derive(Clone, Copy)]
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

/// Positions `k .. k + n` of one code: the twin's `Run`, a lane each.
pub(crate) struct Run<L: Lanes> {
    pub(crate) k: L::F,
    pub(crate) n: L::F,
    /// Those of them that the brick owns.
    pub(crate) owns: L::F,
    /// Some lane's run is longer than one position.
    pub(crate) jumps: bool,
    pub(crate) code: L::F,
    pub(crate) in_region: L::M,
    pub(crate) is_flat: L::M,
    /// The position before it was taken: a slab lies between.
    pub(crate) follows: L::M,
}

impl<L: Lanes> Step<L> {
    /// Nothing is known yet; `k_exit` is any number.
    #[inline(always)]
    pub(crate) fn fresh(l: L, k_exit: L::F) -> Self {
        let none = l.mask(0);
        Self {
            code: l.splat(0.0),
            is_known: none,
            jumps: none,
            k_exit,
            looked: none,
            is_by_map: none,
            is_deep: none,
            is_flat: none,
        }
    }

    /// Nothing is known of the next positions of lanes that were taken; others keep what the map said.
    #[inline(always)]
    pub(crate) fn forget(&mut self, taken: L::M) {
        let others = !taken;
        self.is_known = self.is_known & others;
        self.jumps = self.jumps & others;
        self.looked = self.looked & others;
        self.is_by_map = self.is_by_map & others;
        self.is_deep = self.is_deep & others;
        self.is_flat = self.is_flat & others;
    }
}

//! Where in a brick there is something to see.

use brickcast_volume::OwnedBox;

/// What a brick has to show under a transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Occupied {
    /// The smallest box of macrocells that holds all that are not empty; it may reach beyond the owned box where cells
    /// do. Rays meet nothing outside it: its faces are planes of the global cell grid, so the samples inside are those
    /// that the brick takes anyway, each at the same place. No extent where all cells are empty.
    pub(crate) bounds: OwnedBox,
    /// Empty-space skipping pays where rays are clipped to `bounds`: enough of the cells in there are empty.
    pub(crate) skips: bool,
    /// Empty-space skipping pays where rays cross the whole brick (projections): enough of all its cells are empty.
    pub(crate) skips_uncut: bool,
}

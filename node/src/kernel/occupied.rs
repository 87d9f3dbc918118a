//! Where in a brick there is something to see.

use brickcast_volume::OwnedBox;

/// What a brick has to show under a transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Occupied {
    /// The smallest box of macrocells that holds all that are not empty; it may reach beyond the owned box where cells
    /// do. Rays meet nothing outside it: its faces are planes of the global cell grid, so the samples inside are those
    /// that the brick takes anyway, each at the same place. No extent where all cells are empty.
    pub(crate) bounds: OwnedBox,
    /// Enough of the cells within the bounds are empty for skipping to pay.
    pub(crate) skips: bool,
    /// The same where rays cross the whole box, whatever the bounds.
    pub(crate) skips_uncut: bool,
}

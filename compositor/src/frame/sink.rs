//! Who hears of a frame while it is under way.

use brickcast_proto::TILE;
use brickcast_volume::Premul;

use crate::picture::Picture;

/// A tile of the picture as the frame ends with it: everything that shows in it has arrived and is joined.
#[derive(Debug, Clone, PartialEq)]
pub struct FinishedTile {
    /// Column and row, (0, 0) top left.
    pub tile: [u32; 2],
    /// Row-major, clipped to the picture; nothing where it is clear all over.
    pub pixels: Option<Vec<Premul>>,
}

impl FinishedTile {
    /// Draws it where it belongs, over what was there.
    pub fn draw(&self, picture: &mut Picture) {
        let width = picture.size().width() as usize;
        let from = (self.tile[1] * TILE) as usize * width;
        if let Some(below) = picture.pixels_mut().get_mut(from..) {
            self.draw_in_band(below, width);
        }
    }

    /// The same into the picture's rows from the tile's first one on.
    pub(super) fn draw_in_band(&self, band: &mut [Premul], width: usize) {
        let x0 = (self.tile[0] * TILE) as usize;
        if x0 >= width {
            return;
        }
        let wide = (TILE as usize).min(width - x0);
        for (row, pixels) in band.chunks_mut(width).take(TILE as usize).enumerate() {
            let to = &mut pixels[x0..x0 + wide];
            match self.pixels.as_ref().and_then(|p| p.get(row * wide..(row + 1) * wide)) {
                Some(from) => to.copy_from_slice(from),
                None => to.fill(Premul::CLEAR),
            }
        }
    }
}

/// Hears of the tiles of a frame in the order in which they are finished; the frame's picture is what it is without.
///
/// A trait, not a channel: how much may pile up, and what becomes of a listener that is slow, is the listener's to say,
/// and `()` hears nothing at no cost. It is called by the frame's event loop, which waits for it: whatever may take
/// long belongs into a channel of the listener's own. Where the frame's future is dropped it hears no more.
pub trait FrameSink: Send {
    /// Every tile of a complete frame once: the tiles together are its picture. A tile comes again where what it was
    /// made of turns out to be void (a node's stream was damaged): the last word counts. Tiles of which a part is
    /// missing at the deadline do not come.
    fn tile(&mut self, tile: FinishedTile);

    /// So many of the picture's tiles are finished.
    fn progress(&mut self, _finished: u32, _of: u32) {}

    /// Whether it wants to hear anything: asked once, before the frame begins.
    fn listens(&self) -> bool {
        true
    }
}

impl FrameSink for () {
    fn tile(&mut self, _tile: FinishedTile) {}

    fn listens(&self) -> bool {
        false
    }
}

//! Packets: neighbouring rays, as many as there are lanes.

use brickcast_volume::PixelRect;
use glam::UVec2;

use super::lanes::Lanes;
use super::ray::Rays;
use super::slab::Sum;

/// As many neighbouring pixels as there are lanes, their rays and what they have taken.
pub(crate) struct Packet<L: Lanes> {
    pub(crate) lo: UVec2,
    /// Lanes whose pixels lie in the tile.
    pub(crate) inside: u32,
    pub(crate) rays: Rays<L>,
    pub(crate) sum: Sum<L>,
}

/// Pixels along x and y of a packet of `n`.
pub(crate) const fn shape(n: usize) -> [u32; 2] {
    match n {
        16 => [4, 4],
        8 => [4, 2],
        4 => [2, 2],
        n => [n as u32, 1],
    }
}

/// The pixel of a lane, from its packet's first.
pub(crate) const fn pixel_of(n: usize, lane: usize) -> [u32; 2] {
    let [width, _] = shape(n);
    [lane as u32 % width, lane as u32 / width]
}

/// Lanes whose pixels, in a packet at `lo`, lie in `rect`.
pub(crate) fn lanes_in(n: usize, lo: UVec2, rect: &PixelRect) -> u32 {
    let [width, height] = shape(n);
    let hi = lo + UVec2::new(width, height);
    if lo.cmpge(rect.lo).all() && hi.cmple(rect.hi).all() {
        return (1 << n) - 1;
    }
    if lo.cmpge(rect.hi).any() || hi.cmple(rect.lo).any() {
        return 0;
    }
    let is_in = |lane: usize| {
        let at = lo + UVec2::from(pixel_of(n, lane));
        at.cmpge(rect.lo).all() && at.cmplt(rect.hi).all()
    };
    (0..n).map(|lane| u32::from(is_in(lane)) << lane).sum()
}

impl<L: Lanes> Packet<L> {
    /// Lanes whose pixels lie in the tile and in `rect`.
    pub(crate) fn lanes_in(&self, rect: &PixelRect) -> u32 {
        self.inside & lanes_in(L::N, self.lo, rect)
    }
}

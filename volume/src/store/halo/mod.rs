//! Halos: what bricks need beside their own inner chunks, written and read in one piece.

pub(super) mod bound;
mod gather;
pub(super) mod index;
pub(super) mod reach;
pub(super) mod read;
pub(super) mod regions;
pub(super) mod shell;
mod sort;
pub(super) mod write;
pub(super) mod writer;

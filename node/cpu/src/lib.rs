//! The ray loop on the processor: rays side by side, a lane each, over screen tiles.
//!
//! Its truth is the kernels' twin (`brickcast_shaders::twin`), which goes ray by ray in plain Rust: every instruction
//! set gives every ray the twin's bits, so that pictures do not depend on the processor that draws them. A crate by
//! itself, since it is compiled once for each set, which takes longer than all else of a node.

// Axes and channels of several arrays at once: iterators over them are closures, which need not be inlined, and what is
// not inlined is not compiled for its set.
#![allow(clippy::needless_range_loop)]

mod counts;
mod known;
mod lanes;
mod march;
mod packet;
mod positions;
mod power;
mod probe;
mod ray;
mod read;
mod run;
mod scalar;
mod shown;
mod slab;
mod slab_table;
mod surface;
mod table;
mod take;
mod tile;
mod walk;

pub use lanes::InstructionSet;
pub use shown::ShownEntries;
pub use tile::{Pause, PlacedBrick, Tile, render_tile};

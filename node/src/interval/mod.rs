//! Intervals of pixels (docs/adr/0016-intervals.md): on the processor, whatever a node renders with.

mod brick;
mod render;

pub(crate) use brick::IntervalBrick;
pub(crate) use render::{IntervalScene, render};

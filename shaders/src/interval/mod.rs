//! A picture with its proof: of every pixel, an interval in which it lies both in the picture of V' and in that of the
//! volume (docs/adr/0016-intervals.md).
//!
//! The invariant: *whatever volume has the regions of the store, each of its values within the smallest and the largest
//! of its region, the pixel that the kernels draw of it, and of V', lies within the interval.* Nothing here has a WGSL:
//! it is a walk of its own over the twin's rays and tables, on the processor, whatever the node renders with.

mod light;
mod pixel;
mod read;
mod slab;
mod tables;
mod walk;

pub use pixel::{Interval, RaySamples, Sample};
pub use read::Spans;
pub use tables::IntervalTables;
pub use walk::{BrickSpans, unending, walk_brick};

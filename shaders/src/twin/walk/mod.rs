//! `wgsl/walk/` on the CPU: where a ray goes next. What is asked first is a map of macrocells, then the texels' codes;
//! of each there is a file for bricks that have it, and one for those that have not.

pub(super) mod leap;
mod map;
mod uncoded;
mod unmapped;

pub use super::part::{CodeWalk, MapWalk};
pub use leap::{ENTRY_PROBES, Leap, MARGIN, MARGIN_SHARE, NEARLY_EQUAL, NOTHING_YET};
pub use map::Map;
pub use uncoded::Uncoded;
pub use unmapped::Unmapped;

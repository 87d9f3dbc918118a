//! The plan: which bricks have something to show, who renders which chunk, and what each node is ordered to do.
//!
//! A plan changes nothing in the picture: chunks are joined at the canonical merge tree's nodes whoever renders them.

mod assignment;
mod in_view;
mod level_shown;
mod shown;
mod unordered;

pub use assignment::{Assignment, Share};
pub use in_view::{InView, Orders};
pub use level_shown::LevelShown;
pub(crate) use shown::drawn_in_scene;
pub use shown::{Shown, StoreFacts};
pub use unordered::Unordered;

#[cfg(test)]
mod tests;

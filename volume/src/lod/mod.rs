//! Levels of detail: on which level each part of a volume is drawn, by look and view alone.
//!
//! Level 0 is the volume; each further level has half as many voxels on every axis (docs/definition.md, Levels). What
//! is chosen here depends on the volume, the look and the view, never on nodes, so a picture of several levels is the
//! same whoever renders what of it (docs/adr/0018-level-of-detail.md).

mod again;
mod balance;
mod borders;
mod budget;
mod change;
mod content;
mod hidden;
mod json;
mod levels;
mod rule;
mod seam;
mod selection;
mod set;
mod sight;

pub use self::borders::{Borders, Meets, Sides};
pub use self::budget::Budget;
pub use self::change::{ChangeBounds, Changes};
pub use self::content::Content;
pub use self::hidden::{Hidden, HiddenNote, HiddenPlace, Hides, How, Untold};
pub use self::levels::Levels;
pub use self::rule::{Criterion, Lod, LodError, Rule};
pub use self::seam::take_coarser;
pub use self::selection::{Part, Selection};
pub use self::set::LevelSet;

#[cfg(test)]
mod tests;

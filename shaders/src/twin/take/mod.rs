//! `wgsl/take/` on the CPU: what a run of positions adds to a pixel.

mod projection;
mod sampled;
mod slabs;

use brickcast_volume::Premul;

use super::bindings::{Along, Bindings};
use super::run::Run;
use super::scene::Scene;

pub use projection::Projection;
pub use sampled::Sampled;
pub use slabs::Slabs;

/// What is remembered from run to run.
pub trait Take: Sized {
    type Scene: Scene;
    /// What is empty is taken, as a run of [`Take::neutral_code`], and not skipped.
    const TAKES_EMPTY: bool;

    /// A brick also visits the first position beyond its own: the one that its last slab ends at.
    fn ends_beyond(bound: &Bindings<'_>) -> bool;

    /// The code that changes nothing, 0..=1.
    fn neutral_code(bound: &Bindings<'_>) -> f32;

    fn enter_take(along: &Along<'_>) -> Self;

    /// Adds a run, whose first position lies at `p`; false where nothing of it shows.
    fn take(&mut self, along: &Along<'_>, p: [f32; 3], run: Run, sum: &mut Premul) -> bool;
}

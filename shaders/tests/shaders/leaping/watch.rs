//! A take, watched.

use brickcast_shaders::twin::bindings::{Along, Bindings};
use brickcast_shaders::twin::run::Run;
use brickcast_shaders::twin::take::Take;
use brickcast_volume::Premul;

/// The kernel's take, and the runs that it was given.
pub(crate) struct Watched<T> {
    take: T,
    pub(crate) runs: Vec<Run>,
}

impl<T: Take> Take for Watched<T> {
    type Scene = T::Scene;
    const TAKES_EMPTY: bool = T::TAKES_EMPTY;

    fn ends_beyond(bound: &Bindings<'_>) -> bool {
        T::ends_beyond(bound)
    }

    fn neutral_code(bound: &Bindings<'_>) -> f32 {
        T::neutral_code(bound)
    }

    fn enter_take(along: &Along<'_>) -> Self {
        Self { take: T::enter_take(along), runs: Vec::new() }
    }

    fn take(&mut self, along: &Along<'_>, p: [f32; 3], run: Run, sum: &mut Premul) -> bool {
        self.runs.push(run);
        self.take.take(along, p, run, sum)
    }
}

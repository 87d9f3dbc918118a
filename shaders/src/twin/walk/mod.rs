//! `wgsl/walk/` on the CPU: where a ray goes next. What is asked first is a map of macrocells, then the texels' codes;
//! of each there is a file for bricks that have it, and one for those that have not.

mod leap;
mod map;
mod uncoded;
mod unmapped;

use super::bindings::{Along, Bindings};
use super::run::{self, Step};
use super::take::Take;

pub use leap::{ENTRY_PROBES, Leap, MARGIN, MARGIN_SHARE, NEARLY_EQUAL, NOTHING_YET};
pub use map::Map;
pub use uncoded::Uncoded;
pub use unmapped::Unmapped;

pub(super) use leap::deep_at;

/// Where next, by a map of macrocells.
pub trait MapWalk: Sized {
    /// At the first position.
    fn enter_map(bound: &Bindings<'_>, k: f32) -> Self;

    /// Before the position at `p` is read; `follows`: the one before it was taken.
    fn ask_map<T: Take>(&mut self, bound: &Bindings<'_>, p: [f32; 3], follows: bool) -> Step;

    /// After `n` positions from `k`; `k_exit` is where the step's cube ends; `shows`: something of them does.
    fn leave_map<T: Take>(&mut self, bound: &Bindings<'_>, step: &Step, k: f32, n: f32, k_exit: f32, shows: bool);
}

/// Where next, by texels that may hold leaps.
pub trait CodeWalk: Sized {
    fn enter_code(along: &Along<'_>) -> Self;

    /// Before the position at `p` is read, where the map knows nothing of it; returns the texels read.
    fn ask_code(&mut self, along: &Along<'_>, step: &mut Step, p: [f32; 3]) -> u32;

    /// After positions of this code.
    fn leave_code(&mut self, step: &Step, code: f32);

    /// The first position behind the cube of a step at `k`.
    #[inline(always)]
    fn exit_of(&self, along: &Along<'_>, step: &Step, _k: f32) -> f32 {
        run::exit_of(along.frame(), along.ray, step)
    }
}

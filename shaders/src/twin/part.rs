//! What passes between the loop and its parts, as traits: what every file of a folder of `wgsl/` declares by the same
//! names.

use brickcast_volume::Premul;

use super::bindings::{Along, Bindings};
use super::ray::{Ray, Segment};
use super::run::{Run, Step, exit_of};

/// Which part of a ray there is, and where its positions lie.
pub trait Scene {
    /// What clips leave of what the brick owns; nothing where `k * step >= t_out`.
    fn clipped(bound: &Bindings<'_>, ray: &Ray, owned: Segment) -> Segment;

    /// The place at `k` steps, which need not be whole; index space.
    fn place_at(along: &Along<'_>, k: f32) -> [f32; 3];
}

/// What a run adds: what is remembered from run to run.
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
        exit_of(along.frame(), along.ray, step)
    }
}

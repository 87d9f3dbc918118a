//! `wgsl/walk/unmapped.wgsl` on the CPU: a brick without a map of macrocells.

use super::super::bindings::Bindings;
use super::super::part::{MapWalk, Take};
use super::super::run::Step;

/// Any position may show something.
#[derive(Debug)]
pub struct Unmapped;

impl MapWalk for Unmapped {
    #[inline(always)]
    fn enter_map(_: &Bindings<'_>, _: f32) -> Self {
        Self
    }

    #[inline(always)]
    fn ask_map<T: Take>(&mut self, _: &Bindings<'_>, _: [f32; 3], _: bool) -> Step {
        Step::default()
    }

    #[inline(always)]
    fn leave_map<T: Take>(&mut self, _: &Bindings<'_>, _: &Step, _: f32, _: f32, _: f32, _: bool) {}
}

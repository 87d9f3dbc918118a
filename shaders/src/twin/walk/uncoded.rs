//! `wgsl/walk/uncoded.wgsl` on the CPU: a brick whose texels are all values.

use super::super::bindings::Along;
use super::super::part::CodeWalk;
use super::super::run::Step;

/// No texel is asked before it is read.
#[derive(Debug)]
pub struct Uncoded;

impl CodeWalk for Uncoded {
    #[inline(always)]
    fn enter_code(_: &Along<'_>) -> Self {
        Self
    }

    #[inline(always)]
    fn ask_code(&mut self, _: &Along<'_>, _: &mut Step, _: [f32; 3]) -> u32 {
        0
    }

    #[inline(always)]
    fn leave_code(&mut self, _: &Step, _: f32) {}
}

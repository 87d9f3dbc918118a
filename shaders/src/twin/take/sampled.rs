//! `wgsl/take/sampled.wgsl` on the CPU: single samples, colours as they are.

use brickcast_volume::Premul;

use super::super::bindings::{Along, Bindings};
use super::super::classify::{classify, is_shown};
use super::super::jump::opacity_of;
use super::super::part::Take;
use super::super::run::Run;
use super::super::scene::Plain;

#[derive(Debug)]
pub struct Sampled;

impl Take for Sampled {
    type Scene = Plain;
    const TAKES_EMPTY: bool = false;

    #[inline(always)]
    fn ends_beyond(_: &Bindings<'_>) -> bool {
        false
    }

    #[inline(always)]
    fn neutral_code(_: &Bindings<'_>) -> f32 {
        0.0
    }

    #[inline(always)]
    fn enter_take(_: &Along<'_>) -> Self {
        Self
    }

    #[inline(always)]
    fn take(&mut self, along: &Along<'_>, _: [f32; 3], run: Run, sum: &mut Premul) -> bool {
        let [r, g, b, a] = classify(along.bound, run.in_region, run.code);
        let opacity = if is_shown(along.bound, run.in_region) { a } else { 0.0 };
        // Adding nothing changes no bit.
        if opacity > 0.0 {
            let alpha = if run.n == 1.0 { opacity } else { opacity_of(opacity, run.n) };
            let weight = (1.0 - sum.a) * alpha;
            sum.r += r * weight;
            sum.g += g * weight;
            sum.b += b * weight;
            sum.a += weight;
        }
        opacity > 0.0
    }
}

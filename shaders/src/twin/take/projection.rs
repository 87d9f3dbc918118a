//! `wgsl/take/projection.wgsl` on the CPU: pixels carry codes until a frame is joined.

use brickcast_volume::Premul;

use super::super::bindings::{Along, Bindings};
use super::super::classify::is_shown;
use super::super::part::Take;
use super::super::run::Run;
use super::super::scene::Styled;

#[derive(Debug)]
pub struct Projection;

impl Take for Projection {
    type Scene = Styled;
    const TAKES_EMPTY: bool = true;

    #[inline(always)]
    fn ends_beyond(_: &Bindings<'_>) -> bool {
        false
    }

    #[inline(always)]
    fn neutral_code(bound: &Bindings<'_>) -> f32 {
        f32::from(bound.key.take.pixel_kind().neutral_code()) / 65535.0
    }

    #[inline(always)]
    fn enter_take(_: &Along<'_>) -> Self {
        Self
    }

    #[inline(always)]
    fn take(&mut self, along: &Along<'_>, _: [f32; 3], run: Run, sum: &mut Premul) -> bool {
        if is_shown(along.bound, run.in_region) {
            let mut pixel = sum.to_array();
            let weight = run.n * along.bound.scene.frame.weight;
            along.bound.key.take.pixel_kind().take(&mut pixel, run.code, weight);
            *sum = Premul::from_array(pixel);
        }
        // The map is asked again behind it.
        false
    }
}

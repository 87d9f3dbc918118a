//! What the picture must be: kernels against the referee and against formulas, and the same bits from any number of
//! nodes.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

// Its `#[test]` in place of the compiler's: a test may find out that it can try nothing here.
#[macro_use]
extern crate brickcast_harness;

mod analytic;
mod directions;
mod faces;
mod harness_can_fail;
mod hidden;
mod holes;
mod integral;
mod intervals;
mod leaping;
mod levels;
mod levels_alone;
mod levels_bound;
mod levels_continue;
mod levels_mean;
mod levels_meet;
mod partition;
mod referee;
mod rig;

fn main() -> std::process::ExitCode {
    brickcast_harness::main()
}

//! What the picture must be: kernels against the referee and against formulas, and the same bits from any number of
//! nodes.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

mod analytic;
mod directions;
mod faces;
mod harness_can_fail;
mod holes;
mod integral;
mod leaping;
mod partition;
mod referee;
mod rig;

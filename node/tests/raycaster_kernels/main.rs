//! GPU and CPU raycaster against each other, against formulas, and against every way to cut the volume.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod accelerated;
mod calls;
mod integral;
mod labelled;
mod partition;
mod physics;
mod scene;
mod twins;

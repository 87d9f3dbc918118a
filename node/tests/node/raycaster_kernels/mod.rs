//! GPU and CPU raycaster against each other, against formulas, and against every way to cut the volume.

mod accelerated;
mod calls;
mod integral;
mod labelled;
mod partition;
mod physics;
mod scene;
mod twins;

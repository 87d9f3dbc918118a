//! Rays that leap see the flattened volume V', sample by sample, wherever a brick or a ray starts: the twin's production
//! loop, watched, against the plain raycast of V'.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod extremes;
mod field;
mod hazards;
mod march;
mod property;
mod skipping;

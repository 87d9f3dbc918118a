//! Rays that leap see the flattened volume V', sample by sample, wherever a brick or a ray starts: the twin's
//! only loop, its take watched, against the plain raycast of V'.

mod extremes;
pub(crate) mod field;
mod hazards;
pub(crate) mod march;
pub(crate) mod property;
mod skipping;
mod watch;

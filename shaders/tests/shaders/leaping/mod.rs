//! Rays that leap see the flattened volume V', sample by sample, wherever a brick or a ray starts: the twin's
//! only loop, its take watched, against the plain raycast of V'.

mod extremes;
mod field;
mod hazards;
mod march;
mod property;
mod skipping;
mod watch;

//! How much of it one style may have.

/// The most isosurfaces of a picture.
pub const MAX_SURFACES: usize = 8;
/// The most clip planes apart from the box.
pub const MAX_CLIP_PLANES: usize = 6;
/// The most planes of a clip, its box's six among them.
pub const MAX_PLANES: usize = MAX_CLIP_PLANES + 6;

//! What was asked of levels of detail.

use glam::DVec3;

use super::set::LevelSet;
use crate::ids::ChunkId;
use crate::words::words;

/// Which of a volume's levels a picture is of.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Lod {
    /// Of level 0, the volume itself.
    #[default]
    Full,
    /// Of one level alone: the plain picture of that level's array.
    Level(u8),
    /// Of several, chosen part by part.
    Auto(Rule),
    /// Of those that were chosen before.
    Set(LevelSet),
}

/// By what a part of the volume is taken for fine enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// A voxel of its level is seen at most so large, in pixels of the picture; above 0.
    Error { pixels: f64 },
    /// A tile (a brick of its level) is seen under less than half of the field of view (LaMar, Hamann & Joy 1999, 4.1).
    FieldOfView,
    /// Whatever is in view is drawn on level 0 (the same, Cone criterion): what the others are measured against.
    Cone,
    /// A tile is farther from this point of the world than it is long from corner to corner (the same, section 3).
    Focus(DVec3),
}

/// A [`Rule`] without its numbers, as it is asked for by word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Criterion {
    #[default]
    Error,
    Fov,
    Cone,
}

words!(
    Criterion,
    "criterion of levels",
    [
        (Error, "error", "A voxel is seen at most as large as --pixel-error says"),
        (Fov, "fov", "A brick is seen under less than half of the field of view"),
        (Cone, "cone", "Full resolution wherever anything is in view"),
    ]
);

/// A rule that chooses nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LodError {
    #[error("pixel error {0}: must be finite and above 0 pixels")]
    PixelError(f64),
    #[error("focus {0:?}: every coordinate must be finite")]
    Focus([f64; 3]),
    #[error("a set of levels: each run must have a chunk at least, and all of them at most 2^32")]
    Runs,
    #[error("the set of levels is of {got} chunks, and the volume has {want}: it was of another one")]
    SetOfOthers { got: u32, want: u64 },
    #[error("the set draws chunk {chunk} on level {level}, and the volume has levels 0 to {coarsest}")]
    SetLevel { chunk: ChunkId, level: u8, coarsest: u8 },
    #[error(
        "the set draws chunk {chunk} on level {level}, but not all of that level's chunk, or a face neighbour more \
         than a level coarser or finer"
    )]
    SetChunk { chunk: ChunkId, level: u8 },
}

impl Rule {
    /// # Errors
    /// A pixel error that is not above 0, a focus that is no point.
    pub fn check(&self) -> Result<(), LodError> {
        match *self {
            Self::Error { pixels } if !(pixels.is_finite() && pixels > 0.0) => Err(LodError::PixelError(pixels)),
            Self::Focus(point) if !point.is_finite() => Err(LodError::Focus(point.into())),
            _ => Ok(()),
        }
    }
}

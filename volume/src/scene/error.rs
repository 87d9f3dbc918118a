//! Why a scene is none.

use super::quality::PixelSamples;
use crate::style::{Mode, StyleError};
use crate::visibility::{MAX_PIXELS, MAX_SIDE};

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    #[error("early termination {0}: must lie in (0, 1]; 1 switches it off")]
    EarlyTermination(f32),
    #[error("opacity unit {0}: must be finite and positive (world units)")]
    OpacityUnit(f64),
    #[error("step {0}: must lie between 0.01 and 16 voxels")]
    Step(f64),
    #[error("a macrocell range of {0}: must lie in [0, 1], a share of the store's range")]
    MacrocellRange(f32),
    #[error("leap tolerance {0}: must lie in [0, 1]")]
    LeapTolerance(f32),
    #[error(
        "a picture of {}x{} with {} samples a pixel is {}x{} rays: both sides may have at most {MAX_SIDE}, and all of \
         it {MAX_PIXELS}; make it smaller, or take fewer samples",
        size[0], size[1], samples.count(), rays[0], rays[1]
    )]
    Rays { size: [u32; 2], samples: PixelSamples, rays: [u32; 2] },
    #[error("a picture of mode {0} has no interval: intervals are of colours (mode composite)")]
    Extreme(Mode),
    #[error(transparent)]
    Style(#[from] StyleError),
}

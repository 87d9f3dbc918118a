//! What every layer of a frame has in common: the scene.

use crate::camera::Camera;
use crate::transfer_function::TransferFunction;
use crate::visibility::PictureSize;

/// How a volume value between voxel centres is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Filter {
    /// The adapter's trilinear filter (8-bit weights on most GPUs).
    #[default]
    Hardware,
    /// Eight loads, weights from the global position in f32.
    Exact,
}

/// How pixels travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Transport {
    #[default]
    F16,
    F32,
    U8,
}

/// Camera, picture, transfer function and quality; valid by construction (see [`Scene::new`]).
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    pub camera: Camera,
    pub size: PictureSize,
    /// Sample distance in voxels of the smallest spacing.
    pub step: f64,
    pub transfer_function: TransferFunction,
    /// World length to which opacities refer: `a' = 1 - (1 - a)^(Delta / unit)`.
    pub opacity_unit: f64,
    /// Rays stop at this accumulated opacity, in (0, 1]; 1 switches early termination off.
    pub early_termination: f32,
    pub filter: Filter,
    /// One accumulator per chunk, joined at the merge tree's nodes in f32: the same bits for every assignment.
    pub exact: bool,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    #[error("early termination {0}: must lie in (0, 1]; 1 switches it off")]
    EarlyTermination(f32),
    #[error("opacity unit {0}: must be finite and positive (world units)")]
    OpacityUnit(f64),
    #[error("step {0}: must lie between 0.01 and 16 voxels")]
    Step(f64),
}

impl Scene {
    /// # Errors
    /// Early termination outside (0, 1], an opacity unit that is not positive, a step outside 0.01..=16.
    pub fn validate(self) -> Result<Self, SceneError> {
        if !(self.early_termination > 0.0 && self.early_termination <= 1.0) {
            return Err(SceneError::EarlyTermination(self.early_termination));
        }
        if !(self.opacity_unit.is_finite() && self.opacity_unit > 0.0) {
            return Err(SceneError::OpacityUnit(self.opacity_unit));
        }
        if !(0.01..=16.0).contains(&self.step) {
            return Err(SceneError::Step(self.step));
        }
        Ok(self)
    }
}

//! What every layer of a frame has in common: the scene.

use crate::camera::Camera;
use crate::style::{Mode, Style, StyleError};
use crate::transfer_function::TransferFunction;
use crate::visibility::PictureSize;

pub use crate::filter::Filter;

/// How pixels travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Transport {
    #[default]
    F16,
    F32,
    U8,
}

/// What rays leap through, several sample positions at once.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Leap {
    #[default]
    Off,
    /// Regions of the store (Frey & Ertl 2009): the picture is the plain raycast of V'.
    Regions,
    /// Macrocells whose values span at most this share of the store's range: the rival to regions, which needs no
    /// segmentation.
    Macrocells(f32),
}

/// Voxels per edge of a macrocell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum MacrocellEdge {
    #[default]
    Four,
    /// As in Krueger & Westermann 2003.
    Eight,
}

impl MacrocellEdge {
    #[must_use]
    pub const fn voxels(self) -> u32 {
        match self {
            Self::Four => 4,
            Self::Eight => 8,
        }
    }
}

/// How rays are shortened, early termination apart. Only leaping changes what a picture means, within its bound.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Acceleration {
    /// Skip macrocells without opacity (Krueger & Westermann 2003).
    pub skip_empty: bool,
    pub leap: Leap,
    pub macrocell: MacrocellEdge,
    /// Bricks whose error bound under the current transfer function exceeds this do not leap; premultiplied, 0..=1.
    pub leap_tolerance: Option<f32>,
}

/// Which voxels a picture shows; a sample belongs to its nearest voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RegionView {
    #[default]
    All,
    /// Only voxels of a region.
    Regions,
    /// Only voxels of no region: the defect view (Frey & Ertl 2009, Figure 6).
    Residual,
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
    pub acceleration: Acceleration,
    pub region_view: RegionView,
    /// For samples whose nearest voxel is in a region; none: `transfer_function` serves all.
    pub region_transfer_function: Option<TransferFunction>,
    pub style: Style,
}

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
    #[error(transparent)]
    Style(#[from] StyleError),
}

impl Scene {
    /// # Errors
    /// Early termination outside (0, 1], an opacity unit that is not positive, a step outside 0.01..=16, shares outside
    /// 0..=1, a style that is not valid.
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
        self.style.validate()?;
        self.style.validate_with(self.filter)?;
        let tells_apart = self.region_view != RegionView::All || self.region_transfer_function.is_some();
        if self.style.mode != Mode::Composite && tells_apart {
            return Err(StyleError::Projection.into());
        }
        if let Leap::Macrocells(range) = self.acceleration.leap
            && !(0.0..=1.0).contains(&range)
        {
            return Err(SceneError::MacrocellRange(range));
        }
        match self.acceleration.leap_tolerance {
            Some(tolerance) if !(0.0..=1.0).contains(&tolerance) => Err(SceneError::LeapTolerance(tolerance)),
            _ => Ok(self),
        }
    }
}

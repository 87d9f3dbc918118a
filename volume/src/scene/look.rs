//! What a volume looks like, whatever the view.

use super::error::SceneError;
use crate::style::{Mode, Style, StyleError};
use crate::transfer_function::TransferFunction;
use crate::words::words;

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

words!(
    RegionView,
    "view",
    [
        (All, "all", "Everything"),
        (Regions, "regions", "Only voxels of a region"),
        (Residual, "residual", "Only voxels of no region: the defect view"),
    ]
);

/// What a volume looks like: transfer functions and style. A camera that moves changes nothing of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    pub transfer_function: TransferFunction,
    /// For samples whose nearest voxel is in a region; none: `transfer_function` serves all.
    pub region_transfer_function: Option<TransferFunction>,
    /// World length to which opacities refer: `a' = 1 - (1 - a)^(Delta / unit)`.
    pub opacity_unit: f64,
    pub region_view: RegionView,
    pub style: Style,
}

impl Look {
    /// Everything through one function, in the plain style; `opacity_unit` in world units.
    #[must_use]
    pub fn new(transfer_function: TransferFunction, opacity_unit: f64) -> Self {
        Self {
            transfer_function,
            region_transfer_function: None,
            opacity_unit,
            region_view: RegionView::default(),
            style: Style::default(),
        }
    }

    /// True where voxels in regions show in another way than those in none.
    #[must_use]
    pub fn tells_regions_apart(&self) -> bool {
        self.region_view != RegionView::All || self.region_transfer_function.is_some()
    }

    /// # Errors
    /// An opacity unit that is not positive, a style that is not valid, a projection that tells regions apart.
    pub fn check(&self) -> Result<(), SceneError> {
        if !(self.opacity_unit.is_finite() && self.opacity_unit > 0.0) {
            return Err(SceneError::OpacityUnit(self.opacity_unit));
        }
        self.style.validate()?;
        if self.style.mode != Mode::Composite && self.tells_regions_apart() {
            return Err(StyleError::Projection.into());
        }
        Ok(())
    }
}

//! How rays are shortened, and which voxels show.

use brickcast_volume::scene::{Acceleration, Leap, MacrocellEdge, RegionView};

use super::WireError;
use crate::wire;

impl From<Acceleration> for wire::Acceleration {
    fn from(acceleration: Acceleration) -> Self {
        Self {
            skip_empty: acceleration.skip_empty,
            leap: match acceleration.leap {
                Leap::Off => None,
                Leap::Regions => Some(wire::acceleration::Leap::Regions(true)),
                Leap::Macrocells(range) => Some(wire::acceleration::Leap::Macrocells(range)),
            },
            macrocell: acceleration.macrocell.voxels(),
            leap_tolerance: acceleration.leap_tolerance,
        }
    }
}

impl TryFrom<wire::Acceleration> for Acceleration {
    type Error = WireError;

    fn try_from(acceleration: wire::Acceleration) -> Result<Self, WireError> {
        let macrocell = MacrocellEdge::of_voxels(acceleration.macrocell);
        Ok(Self {
            skip_empty: acceleration.skip_empty,
            leap: match acceleration.leap {
                None | Some(wire::acceleration::Leap::Regions(false)) => Leap::Off,
                Some(wire::acceleration::Leap::Regions(true)) => Leap::Regions,
                Some(wire::acceleration::Leap::Macrocells(range)) => Leap::Macrocells(range),
            },
            macrocell: macrocell.ok_or_else(|| WireError::Unknown {
                what: "macrocell edge",
                value: acceleration.macrocell.to_string(),
            })?,
            leap_tolerance: acceleration.leap_tolerance,
        })
    }
}

pub(super) fn view_to_wire(view: RegionView) -> i32 {
    match view {
        RegionView::All => wire::RegionView::All.into(),
        RegionView::Regions => wire::RegionView::Regions.into(),
        RegionView::Residual => wire::RegionView::Residual.into(),
    }
}

/// Unspecified is everything, so that an order without the field means what it always did.
pub(super) fn view_from_wire(view: i32) -> Result<RegionView, WireError> {
    match wire::RegionView::try_from(view) {
        Ok(wire::RegionView::Unspecified | wire::RegionView::All) => Ok(RegionView::All),
        Ok(wire::RegionView::Regions) => Ok(RegionView::Regions),
        Ok(wire::RegionView::Residual) => Ok(RegionView::Residual),
        Err(_) => Err(WireError::Unknown { what: "region view", value: view.to_string() }),
    }
}

//! What ImageJ writes into the description of its first page.

use glam::DVec3;

use super::order::{Counts, Order};
use crate::units;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct ImageJ {
    pub(super) images: u64,
    pub(super) order: Order,
    /// From slice to slice.
    pub(super) depth: Option<f64>,
    pub(super) unit: Option<&'static str>,
    /// Of the origin, in voxels.
    pub(super) origin: Option<DVec3>,
    /// Slope and intercept.
    pub(super) calibration: Option<(f64, f64)>,
}

impl ImageJ {
    pub(super) fn parse(description: &str) -> Option<Self> {
        if !description.starts_with("ImageJ=") {
            return None;
        }
        let get = |key: &str| {
            description.lines().find_map(|line| line.trim().split_once('=').filter(|(k, _)| *k == key).map(|(_, v)| v))
        };
        let count = |key: &str| get(key).and_then(|v| v.parse::<u64>().ok());
        let float = |key: &str| get(key).and_then(|v| v.parse::<f64>().ok()).filter(|v| v.is_finite());
        let images = count("images").unwrap_or(1).max(1);
        let (c, t) = (count("channels").unwrap_or(1).max(1), count("frames").unwrap_or(1).max(1));
        let z = count("slices").unwrap_or_else(|| images / c.saturating_mul(t).max(1)).max(1);
        let origin = [float("xorigin"), float("yorigin"), float("zorigin")];
        let calibration = match (count("cf"), float("c0"), float("c1")) {
            (Some(0), Some(c0), Some(c1)) => Some((c1, c0)),
            _ => None,
        };
        Some(Self {
            images,
            order: Order { counts: Counts { z, c, t }, axes: *b"czt" },
            // Negative where a stack was acquired downwards; its slices lie as they come.
            depth: float("spacing").map(f64::abs).filter(|d| *d > 0.0),
            unit: get("unit").and_then(units::length).map(|(name, _)| name),
            origin: origin.iter().any(Option::is_some).then(|| DVec3::from(origin.map(|o| o.unwrap_or(0.0)))),
            calibration,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_is_understood() {
        let text = "ImageJ=1.54f\nimages=12\nchannels=2\nslices=3\nframes=2\nunit=\\u00B5m\nspacing=-2.5\n\
                    xorigin=4\ncf=0\nc0=-32768\nc1=1\n";
        let found = ImageJ::parse(text).unwrap();
        assert_eq!(found.order.counts, Counts { z: 3, c: 2, t: 2 });
        assert_eq!((found.depth, found.unit), (Some(2.5), Some("um")));
        assert_eq!((found.origin, found.calibration), (Some(DVec3::new(4.0, 0.0, 0.0)), Some((1.0, -32768.0))));
        assert_eq!(ImageJ::parse("ImageJ=\nimages=7").unwrap().order.counts.z, 7);
        assert_eq!(ImageJ::parse("other"), None);
    }
}

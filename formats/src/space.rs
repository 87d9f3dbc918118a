//! A header's geometry: from axes and origin, overruled by what the user says.

use brickcast_volume::format::{Axes, Placement, RawHints, SourceHeader};
use brickcast_volume::space::Geometry;
use glam::DVec3;

use crate::wrong::Wrong;

/// What the decimals of a header leave; not worth a word.
const TOLD: f64 = 1e-6;

/// What a file says of where it lies.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Place {
    /// From a voxel to the next along each axis, world.
    pub(crate) vectors: [DVec3; 3],
    pub(crate) origin: DVec3,
    pub(crate) said: Placement,
}

impl Place {
    /// Axes x, y, z.
    pub(crate) fn straight(spacing: [f64; 3], origin: [f64; 3], said: Placement) -> Self {
        let [x, y, z] = spacing;
        Self { vectors: [DVec3::X * x, DVec3::Y * y, DVec3::Z * z], origin: origin.into(), said }
    }

    pub(crate) fn unknown() -> Self {
        Self::straight([1.0; 3], [0.0; 3], Placement::default())
    }

    /// Geometry, and notes of what was moved or assumed.
    pub(crate) fn geometry(&self, dims: [u32; 3], notes: &mut Vec<String>) -> Result<Geometry, Wrong> {
        let axes = Axes::of(self.vectors).map_err(|e| Wrong::new("axes", e.to_string(), "correct the header"))?;
        if axes.moved > TOLD {
            notes.push(format!(
                "axes were not quite at right angles or on x, y, z: moved by up to {:.1e} of a voxel",
                axes.moved
            ));
        }
        // -0 is 0.
        let geometry = Geometry::new(dims, axes.spacing, (self.origin + 0.0).to_array())
            .and_then(|geometry| geometry.with_directions(axes.directions))
            .map_err(|e| Wrong::new("size and place", e.to_string(), "correct the header"))?;
        if geometry.is_mirrored() {
            notes.push("stored mirrored: its axes are a left-handed system in space; drawn as it lies in space".into());
        }
        if !self.said.spacing {
            notes.push("spacing not said: 1, 1, 1 assumed (--spacing X,Y,Z overrides)".into());
        }
        Ok(geometry)
    }
}

/// With a word on flags that are for other formats, and the fill value that the user names.
pub(crate) fn noted(mut header: SourceHeader, hints: &RawHints, has_several: bool) -> SourceHeader {
    if !hints.is_empty() {
        header.notes.push("--dims, --type, --endian, --skip are for raw files; the file's own were used".into());
    }
    if !has_several {
        header.notes.extend(hints.of_one_volume());
    }
    header.no_data.extend(hints.no_data);
    header
}

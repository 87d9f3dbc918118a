//! What clipping leaves of a volume: the part of space inside a box and on the kept side of planes.

use glam::{DVec3, DVec4};

use super::error::StyleError;
use super::limits::MAX_CLIP_PLANES;
use crate::space::Geometry;

/// The half space `normal . p >= offset`, world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClipPlane {
    /// Points into what stays; need not be of length one.
    pub normal: DVec3,
    /// In units of `normal . p`.
    pub offset: f64,
}

/// World; a sample counts where its position is inside the box and inside all half spaces.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clip {
    /// Lower and upper corner.
    pub bounds: Option<(DVec3, DVec3)>,
    pub planes: Vec<ClipPlane>,
}

impl Clip {
    pub(super) fn validate(&self) -> Result<(), StyleError> {
        if let Some((lo, hi)) = self.bounds
            && !(lo.is_finite() && hi.is_finite() && lo.cmplt(hi).all())
        {
            return Err(StyleError::ClipBox { lo, hi });
        }
        if self.planes.len() > MAX_CLIP_PLANES {
            return Err(StyleError::ClipPlanes { got: self.planes.len() });
        }
        for ClipPlane { normal, offset } in self.planes.iter().copied() {
            if !(normal.is_finite() && normal.length_squared().is_normal() && offset.is_finite()) {
                return Err(StyleError::ClipPlane { normal, offset });
            }
        }
        Ok(())
    }

    /// All planes in index space, normals of length one there: what stays has `n . p >= w` for each (n, w). At most
    /// [`MAX_PLANES`].
    #[must_use]
    pub fn index_planes(&self, geometry: &Geometry) -> Vec<DVec4> {
        let (spacing, origin) = (geometry.spacing(), geometry.origin());
        // world = origin + R diag(spacing) (index - 1/2)
        let mut planes = Vec::new();
        let mut push = |normal: DVec3, offset: f64| {
            let n = geometry.along_axes(normal) * spacing;
            let w = offset - normal.dot(origin) + 0.5 * n.element_sum();
            let length = n.length();
            planes.push((n / length).extend(w / length));
        };
        if let Some((lo, hi)) = self.bounds {
            for (axis, low, high) in [(DVec3::X, lo.x, hi.x), (DVec3::Y, lo.y, hi.y), (DVec3::Z, lo.z, hi.z)] {
                push(axis, low);
                push(-axis, -high);
            }
        }
        for plane in &self.planes {
            push(plane.normal, plane.offset);
        }
        planes
    }
}

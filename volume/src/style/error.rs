//! What makes no style.

use glam::DVec3;

use super::limits::{MAX_CLIP_PLANES, MAX_SURFACES};

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StyleError {
    #[error("{got} isosurfaces: at most {MAX_SURFACES} are possible")]
    Surfaces { got: usize },
    #[error("isosurface {value}: the value must be finite, red, green, blue and opacity must lie between 0 and 1")]
    Surface { value: f64 },
    #[error("isosurface {value} is given twice: give it once, with one colour")]
    SameSurface { value: f64 },
    #[error("{name} {value}: must lie between 0 and {most}")]
    Light { name: &'static str, value: f32, most: f32 },
    #[error("light direction {0}: must be finite and not zero")]
    LightDirection(DVec3),
    #[error("light from a gradient of {0}: must be finite and not negative, data units per voxel")]
    LightFrom(f64),
    #[error(
        "the nearest filter shows voxels as they are: between them lie no {what}; leave these out, or --filter nearest"
    )]
    Nearest { what: &'static str },
    #[error(
        "a projection (maximum, minimum, average) shows values alone: leave out shading, isosurfaces, region views and \
         region transfer functions"
    )]
    Projection,
    #[error("clip box: the lower corner {lo} must lie below the upper corner {hi} on every axis")]
    ClipBox { lo: DVec3, hi: DVec3 },
    #[error("{got} clip planes: at most {MAX_CLIP_PLANES} are possible")]
    ClipPlanes { got: usize },
    #[error("clip plane {normal}, {offset}: the normal must be finite and not zero, the offset finite")]
    ClipPlane { normal: DVec3, offset: f64 },
}

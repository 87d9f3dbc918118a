//! The scene: camera, transfer function, filter, transport.

use brickcast_volume::scene::{Extreme, Filter, Look, PixelSamples, Quality, Scene, SceneParts, Transport, ViewSpec};
use brickcast_volume::transfer_function::{ColorPoint, MAX_POINTS, OpacityPoint, TransferFunction};
use brickcast_volume::{Camera, PictureSize, Projection};
use glam::DVec3;

use super::acceleration::{view_from_wire, view_to_wire};
use super::{WireError, at_most};
use crate::wire;

impl From<DVec3> for wire::Vec3 {
    fn from(v: DVec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

pub(super) fn vec3(what: &'static str, v: Option<wire::Vec3>) -> Result<DVec3, WireError> {
    v.map(|v| DVec3::new(v.x, v.y, v.z)).ok_or(WireError::Missing(what))
}

impl From<Camera> for wire::Camera {
    fn from(camera: Camera) -> Self {
        Self {
            position: Some(camera.position().into()),
            focal_point: Some(camera.focal_point().into()),
            view_up: Some(camera.view_up().into()),
            projection: Some(match camera.projection() {
                Projection::Perspective { view_angle } => wire::camera::Projection::ViewAngle(view_angle),
                Projection::Parallel { parallel_scale } => wire::camera::Projection::ParallelScale(parallel_scale),
            }),
        }
    }
}

impl TryFrom<wire::Camera> for Camera {
    type Error = WireError;

    fn try_from(camera: wire::Camera) -> Result<Self, WireError> {
        let projection = match camera.projection.ok_or(WireError::Missing("camera projection"))? {
            wire::camera::Projection::ViewAngle(view_angle) => Projection::Perspective { view_angle },
            wire::camera::Projection::ParallelScale(parallel_scale) => Projection::Parallel { parallel_scale },
        };
        Ok(Self::new(
            vec3("camera position", camera.position)?,
            vec3("camera focal_point", camera.focal_point)?,
            vec3("camera view_up", camera.view_up)?,
            projection,
        )?)
    }
}

impl From<&TransferFunction> for wire::TransferFunction {
    fn from(function: &TransferFunction) -> Self {
        let color = |p: &ColorPoint| wire::ColorPoint { x: p.x, r: p.rgb[0], g: p.rgb[1], b: p.rgb[2] };
        let opacity = |p: &OpacityPoint| wire::OpacityPoint { x: p.x, opacity: p.opacity };
        Self {
            colors: function.colors().iter().map(color).collect(),
            opacities: function.opacities().iter().map(opacity).collect(),
        }
    }
}

impl TryFrom<wire::TransferFunction> for TransferFunction {
    type Error = WireError;

    fn try_from(function: wire::TransferFunction) -> Result<Self, WireError> {
        at_most("transfer function colors", function.colors.len(), MAX_POINTS)?;
        at_most("transfer function opacities", function.opacities.len(), MAX_POINTS)?;
        let colors = function.colors.into_iter().map(|p| ColorPoint { x: p.x, rgb: [p.r, p.g, p.b] }).collect();
        let opacities = function.opacities.into_iter().map(|p| OpacityPoint { x: p.x, opacity: p.opacity }).collect();
        Ok(Self::new(colors, opacities)?)
    }
}

fn filter_to_wire(filter: Filter) -> i32 {
    match filter {
        Filter::Hardware => wire::Filter::Hardware.into(),
        Filter::Exact => wire::Filter::Exact.into(),
        Filter::Nearest => wire::Filter::Nearest.into(),
    }
}

fn filter_from_wire(filter: i32) -> Result<Filter, WireError> {
    match wire::Filter::try_from(filter) {
        Ok(wire::Filter::Hardware) => Ok(Filter::Hardware),
        Ok(wire::Filter::Exact) => Ok(Filter::Exact),
        Ok(wire::Filter::Nearest) => Ok(Filter::Nearest),
        _ => Err(WireError::Unknown { what: "filter", value: filter.to_string() }),
    }
}

fn extreme_to_wire(extreme: Option<Extreme>) -> i32 {
    match extreme {
        None => wire::Extreme::None.into(),
        Some(Extreme::Lowest) => wire::Extreme::Lowest.into(),
        Some(Extreme::Highest) => wire::Extreme::Highest.into(),
    }
}

fn extreme_from_wire(extreme: i32) -> Result<Option<Extreme>, WireError> {
    match wire::Extreme::try_from(extreme) {
        Ok(wire::Extreme::None) => Ok(None),
        Ok(wire::Extreme::Lowest) => Ok(Some(Extreme::Lowest)),
        Ok(wire::Extreme::Highest) => Ok(Some(Extreme::Highest)),
        Err(_) => Err(WireError::Unknown { what: "extreme", value: extreme.to_string() }),
    }
}

pub(super) fn format_to_wire(format: Transport) -> i32 {
    match format {
        Transport::F16 => wire::PixelFormat::F16.into(),
        Transport::F32 => wire::PixelFormat::F32.into(),
        Transport::U8 => wire::PixelFormat::U8.into(),
    }
}

pub(super) fn format_from_wire(format: i32) -> Result<Transport, WireError> {
    match wire::PixelFormat::try_from(format) {
        Ok(wire::PixelFormat::F16) => Ok(Transport::F16),
        Ok(wire::PixelFormat::F32) => Ok(Transport::F32),
        Ok(wire::PixelFormat::U8) => Ok(Transport::U8),
        _ => Err(WireError::Unknown { what: "pixel format", value: format.to_string() }),
    }
}

/// Nodes know nothing of pixels that are means: a ray is a pixel there ([`Scene::by_rays`]).
impl From<&Scene> for wire::Scene {
    fn from(scene: &Scene) -> Self {
        let SceneParts { look, view, quality } = &**scene;
        Self {
            camera: Some(view.camera.into()),
            width: scene.rays().width(),
            height: scene.rays().height(),
            step: quality.step,
            transfer_function: Some((&look.transfer_function).into()),
            opacity_unit: look.opacity_unit,
            early_termination: quality.early_termination,
            filter: filter_to_wire(quality.filter),
            exact: quality.exact,
            acceleration: Some(quality.acceleration.into()),
            region_view: view_to_wire(look.region_view),
            region_transfer_function: look.region_transfer_function.as_ref().map(Into::into),
            style: Some((&look.style).into()),
            extreme: extreme_to_wire(quality.extreme),
        }
    }
}

impl TryFrom<wire::Scene> for Scene {
    type Error = WireError;

    fn try_from(scene: wire::Scene) -> Result<Self, WireError> {
        let view = ViewSpec {
            camera: scene.camera.ok_or(WireError::Missing("scene camera"))?.try_into()?,
            size: PictureSize::new(scene.width, scene.height)?,
        };
        let look = Look {
            transfer_function: scene.transfer_function.ok_or(WireError::Missing("transfer function"))?.try_into()?,
            region_transfer_function: scene.region_transfer_function.map(TryInto::try_into).transpose()?,
            opacity_unit: scene.opacity_unit,
            region_view: view_from_wire(scene.region_view)?,
            style: scene.style.map(TryInto::try_into).transpose()?.unwrap_or_default(),
        };
        let quality = Quality {
            step: scene.step,
            early_termination: scene.early_termination,
            filter: filter_from_wire(scene.filter)?,
            exact: scene.exact,
            acceleration: scene.acceleration.map(TryInto::try_into).transpose()?.unwrap_or_default(),
            samples: PixelSamples::One,
            extreme: extreme_from_wire(scene.extreme)?,
        };
        Ok(Self::new(look, view, quality)?)
    }
}

//! What becomes of the values along a ray.

use brickcast_volume::style::{
    Clip, ClipPlane, Integration, Isosurface, Lighting, MAX_CLIP_PLANES, MAX_SURFACES, Mode, Phong, Style, TableSize,
};

use super::scene::vec3;
use super::{WireError, at_most};
use crate::wire;

const MODES: [(Mode, wire::Mode); 4] = [
    (Mode::Composite, wire::Mode::Composite),
    (Mode::Maximum, wire::Mode::Maximum),
    (Mode::Minimum, wire::Mode::Minimum),
    (Mode::Average, wire::Mode::Average),
];

const LIGHTINGS: [(Lighting, wire::Lighting); 3] = [
    (Lighting::Interpolated, wire::Lighting::Interpolated),
    (Lighting::Center, wire::Lighting::Center),
    (Lighting::Centroid, wire::Lighting::Centroid),
];

impl From<Phong> for wire::Phong {
    fn from(phong: Phong) -> Self {
        Self {
            lighting: LIGHTINGS.iter().find(|(l, _)| *l == phong.lighting).map_or(0, |(_, wire)| (*wire).into()),
            light: phong.light.map(Into::into),
            ambient: phong.ambient,
            diffuse: phong.diffuse,
            specular: phong.specular,
            shininess: phong.shininess,
            light_from: phong.light_from,
        }
    }
}

impl TryFrom<wire::Phong> for Phong {
    type Error = WireError;

    fn try_from(phong: wire::Phong) -> Result<Self, WireError> {
        let lighting = LIGHTINGS.into_iter().find(|(_, wire)| i32::from(*wire) == phong.lighting);
        let unknown = || WireError::Unknown { what: "lighting", value: phong.lighting.to_string() };
        Ok(Self {
            lighting: lighting.ok_or_else(unknown)?.0,
            light: phong.light.map(|light| vec3("light", Some(light))).transpose()?,
            ambient: phong.ambient,
            diffuse: phong.diffuse,
            specular: phong.specular,
            shininess: phong.shininess,
            light_from: phong.light_from,
        })
    }
}

impl From<&Style> for wire::Style {
    fn from(style: &Style) -> Self {
        let surface = |s: &Isosurface| {
            let [r, g, b] = s.color;
            wire::Isosurface { value: s.value, r, g, b, opacity: s.opacity }
        };
        let plane = |p: &ClipPlane| wire::ClipPlane { normal: Some(p.normal.into()), offset: p.offset };
        Self {
            table_size: match style.integration {
                Integration::Sampled => 0,
                Integration::Preintegrated(size) => size.entries() as u32,
            },
            shading: style.shading.map(Into::into),
            surfaces: style.surfaces.iter().map(surface).collect(),
            mode: MODES.iter().find(|(mode, _)| *mode == style.mode).map_or(0, |(_, wire)| (*wire).into()),
            clip_lo: style.clip.bounds.map(|(lo, _)| lo.into()),
            clip_hi: style.clip.bounds.map(|(_, hi)| hi.into()),
            clip_planes: style.clip.planes.iter().map(plane).collect(),
        }
    }
}

impl TryFrom<wire::Style> for Style {
    type Error = WireError;

    fn try_from(style: wire::Style) -> Result<Self, WireError> {
        at_most("isosurfaces", style.surfaces.len(), MAX_SURFACES)?;
        at_most("clip planes", style.clip_planes.len(), MAX_CLIP_PLANES)?;
        let unknown = |what, value: String| WireError::Unknown { what, value };
        let integration = match style.table_size {
            0 => Integration::Sampled,
            n => TableSize::of_entries(n)
                .map(Integration::Preintegrated)
                .ok_or_else(|| unknown("pre-integration table size", n.to_string()))?,
        };
        let mode = MODES.into_iter().find(|(_, wire)| i32::from(*wire) == style.mode);
        let surface = |s: wire::Isosurface| Isosurface { value: s.value, color: [s.r, s.g, s.b], opacity: s.opacity };
        let plane = |p: wire::ClipPlane| {
            Ok::<_, WireError>(ClipPlane { normal: vec3("clip plane normal", p.normal)?, offset: p.offset })
        };
        let bounds = match (style.clip_lo, style.clip_hi) {
            (None, None) => None,
            (lo, hi) => Some((vec3("clip_lo", lo)?, vec3("clip_hi", hi)?)),
        };
        Ok(Self {
            integration,
            shading: style.shading.map(TryInto::try_into).transpose()?,
            surfaces: style.surfaces.into_iter().map(surface).collect(),
            mode: mode.ok_or_else(|| unknown("mode", style.mode.to_string()))?.0,
            clip: Clip { bounds, planes: style.clip_planes.into_iter().map(plane).collect::<Result<_, _>>()? },
        })
    }
}

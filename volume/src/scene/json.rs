//! A scene as JSON: the manifest of a picture has these fields. What is written is read back bit for bit.

use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::{Acceleration, Leap, LeapKind, Look, MacrocellEdge, PixelSamples, Quality, Scene, ViewSpec};
use crate::json_fields::{FieldError, Fields};
use crate::style::{Clip, ClipPlane, Integration, IntegrationKind, Isosurface, Phong, Style, TableSize};
use crate::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use crate::visibility::PictureSize;

/// The fields of a scene.
pub const SCENE_FIELDS: [&str; 13] = [
    "camera",
    "size",
    "samples",
    "step",
    "opacity_unit",
    "early_termination",
    "exact",
    "acceleration",
    "view",
    "style",
    "filter",
    "transfer_function",
    "region_transfer_function",
];

impl Scene {
    /// The scene's fields, [`SCENE_FIELDS`].
    #[must_use]
    pub fn to_json(&self) -> Map<String, Value> {
        let (look, view, quality) = (&self.look, &self.view, &self.quality);
        let value = json!({
            "camera": view.camera,
            "size": [view.size.width(), view.size.height()],
            "samples": quality.samples.count(),
            "step": quality.step,
            "opacity_unit": look.opacity_unit,
            "early_termination": quality.early_termination,
            "exact": quality.exact,
            "acceleration": acceleration_to(&quality.acceleration),
            "view": look.region_view,
            "style": style_to(&look.style),
            "filter": quality.filter,
            "transfer_function": function_to(&look.transfer_function),
            "region_transfer_function": look.region_transfer_function.as_ref().map(function_to),
        });
        match value {
            Value::Object(fields) => fields,
            _ => Map::new(),
        }
    }

    /// The scene that an object's fields tell; the object may have others.
    ///
    /// # Errors
    /// A field that is missing, of another kind, not known inside one of these, or out of range: it is named.
    pub fn from_json(fields: &Fields<'_>) -> Result<Self, FieldError> {
        let [width, height] = fields.get("size")?;
        let size = PictureSize::new(width, height).map_err(|error| fields.refused("size", error))?;
        let view = ViewSpec { camera: fields.get("camera")?, size };
        let region = fields.object_optional("region_transfer_function")?;
        let look = Look {
            transfer_function: function_from(&fields.object("transfer_function")?)?,
            region_transfer_function: region.as_ref().map(function_from).transpose()?,
            opacity_unit: fields.get("opacity_unit")?,
            region_view: fields.get("view")?,
            style: style_from(&fields.object("style")?)?,
        };
        let quality = Quality {
            step: fields.get("step")?,
            early_termination: fields.get("early_termination")?,
            filter: fields.get("filter")?,
            exact: fields.get("exact")?,
            acceleration: acceleration_from(&fields.object("acceleration")?)?,
            samples: samples_from(fields)?,
            extreme: None,
        };
        let whole =
            |error: super::SceneError| FieldError { field: "the scene:".to_owned(), problem: error.to_string() };
        Self::new(look, view, quality).map_err(whole)
    }
}

impl Serialize for Scene {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.to_json().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Scene {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let map = Map::deserialize(deserializer)?;
        let fields = Fields::new("", &map);
        fields.only(&[&SCENE_FIELDS]).and_then(|()| Self::from_json(&fields)).map_err(serde::de::Error::custom)
    }
}

/// One where it is not told: earlier versions knew of no others.
fn samples_from(fields: &Fields<'_>) -> Result<PixelSamples, FieldError> {
    let Some(count) = fields.get_optional("samples")? else { return Ok(PixelSamples::One) };
    PixelSamples::of_count(count).ok_or_else(|| fields.refused("samples", "1, 4, 9 or 16"))
}

fn acceleration_to(acceleration: &Acceleration) -> Value {
    json!({
        "skip_empty": acceleration.skip_empty,
        "leap": match acceleration.leap {
            Leap::Off | Leap::Regions => json!(acceleration.leap.kind()),
            Leap::Macrocells(range) => json!({ LeapKind::Macrocells.to_string(): range }),
        },
        "macrocell": acceleration.macrocell.voxels(),
        "leap_tolerance": acceleration.leap_tolerance,
    })
}

fn acceleration_from(fields: &Fields<'_>) -> Result<Acceleration, FieldError> {
    fields.only(&[&["skip_empty", "leap", "macrocell", "leap_tolerance"]])?;
    let leap = match fields.value("leap")? {
        Value::Object(_) => {
            let (leap, key) = (fields.object("leap")?, LeapKind::Macrocells.to_string());
            leap.only(&[&[&key]])?;
            Leap::Macrocells(leap.get(&key)?)
        }
        _ => match fields.get("leap")? {
            LeapKind::Off => Leap::Off,
            LeapKind::Regions => Leap::Regions,
            LeapKind::Macrocells => return Err(fields.refused("leap", "{\"macrocells\": SHARE} is needed")),
        },
    };
    let edge = MacrocellEdge::of_voxels(fields.get("macrocell")?);
    Ok(Acceleration {
        skip_empty: fields.get("skip_empty")?,
        leap,
        macrocell: edge.ok_or_else(|| fields.refused("macrocell", "4 or 8"))?,
        leap_tolerance: fields.get_optional("leap_tolerance")?,
    })
}

fn triple(v: DVec3) -> [f64; 3] {
    v.into()
}

fn style_to(style: &Style) -> Value {
    let shading = style.shading.map(|phong| {
        json!({
            "lighting": phong.lighting,
            "light": phong.light.map(triple),
            "ambient": phong.ambient,
            "diffuse": phong.diffuse,
            "specular": phong.specular,
            "shininess": phong.shininess,
            "light_from": phong.light_from,
        })
    });
    let surface = |s: &Isosurface| {
        let [r, g, b] = s.color;
        json!({ "value": s.value, "color": [r, g, b, s.opacity] })
    };
    let plane = |p: &ClipPlane| [p.normal.x, p.normal.y, p.normal.z, p.offset];
    json!({
        "integration": match style.integration {
            Integration::Sampled => json!(IntegrationKind::Sampled),
            Integration::Preintegrated(size) =>
                json!({ IntegrationKind::Preintegrated.to_string(): size.entries() }),
        },
        "shading": shading,
        "isosurfaces": style.surfaces.iter().map(surface).collect::<Vec<_>>(),
        "mode": style.mode,
        "clip": style.clip.bounds.map(|(lo, hi)| [lo.x, hi.x, lo.y, hi.y, lo.z, hi.z]),
        "clip_planes": style.clip.planes.iter().map(plane).collect::<Vec<_>>(),
    })
}

fn style_from(fields: &Fields<'_>) -> Result<Style, FieldError> {
    fields.only(&[&["integration", "shading", "isosurfaces", "mode", "clip", "clip_planes"]])?;
    let surface = |fields: &Fields<'_>| {
        fields.only(&[&["value", "color"]])?;
        let [r, g, b, opacity] = fields.get("color")?;
        Ok(Isosurface { value: fields.get("value")?, color: [r, g, b], opacity })
    };
    let bounds = fields.get_optional::<[f64; 6]>("clip")?;
    let plane = |[x, y, z, offset]: [f64; 4]| ClipPlane { normal: DVec3::new(x, y, z), offset };
    Ok(Style {
        integration: integration_from(fields)?,
        shading: fields.object_optional("shading")?.as_ref().map(phong_from).transpose()?,
        surfaces: fields.objects("isosurfaces")?.iter().map(surface).collect::<Result<_, FieldError>>()?,
        mode: fields.get("mode")?,
        clip: Clip {
            bounds: bounds.map(|[x0, x1, y0, y1, z0, z1]| (DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1))),
            planes: fields.get::<Vec<_>>("clip_planes")?.into_iter().map(plane).collect(),
        },
    })
}

fn integration_from(fields: &Fields<'_>) -> Result<Integration, FieldError> {
    if fields.value("integration")?.is_object() {
        let (integration, key) = (fields.object("integration")?, IntegrationKind::Preintegrated.to_string());
        integration.only(&[&[&key]])?;
        let size = TableSize::of_entries(integration.get(&key)?);
        return size.map(Integration::Preintegrated).ok_or_else(|| integration.refused(&key, "256 or 1024"));
    }
    match fields.get("integration")? {
        IntegrationKind::Sampled => Ok(Integration::Sampled),
        IntegrationKind::Preintegrated => Err(fields.refused("integration", "{\"preintegrated\": ENTRIES} is needed")),
    }
}

fn phong_from(fields: &Fields<'_>) -> Result<Phong, FieldError> {
    fields.only(&[&["lighting", "light", "ambient", "diffuse", "specular", "shininess", "light_from"]])?;
    Ok(Phong {
        lighting: fields.get("lighting")?,
        light: fields.get_optional::<[f64; 3]>("light")?.map(DVec3::from),
        ambient: fields.get("ambient")?,
        diffuse: fields.get("diffuse")?,
        specular: fields.get("specular")?,
        shininess: fields.get("shininess")?,
        light_from: fields.get_optional("light_from")?,
    })
}

fn function_to(function: &TransferFunction) -> Value {
    json!({
        "RGBPoints": function.colors().iter().map(|p| [p.x, p.rgb[0], p.rgb[1], p.rgb[2]]).collect::<Vec<_>>(),
        "Points": function.opacities().iter().map(|p| [p.x, p.opacity]).collect::<Vec<_>>(),
    })
}

fn function_from(fields: &Fields<'_>) -> Result<TransferFunction, FieldError> {
    fields.only(&[&["RGBPoints", "Points"]])?;
    let colors = fields.get::<Vec<[f64; 4]>>("RGBPoints")?;
    let colors = colors.into_iter().map(|[x, r, g, b]| ColorPoint { x, rgb: [r, g, b] }).collect();
    let opacities = fields.get::<Vec<[f64; 2]>>("Points")?;
    let opacities = opacities.into_iter().map(|[x, opacity]| OpacityPoint { x, opacity }).collect();
    TransferFunction::new(colors, opacities).map_err(|error| {
        let list = if error.to_string().starts_with("opacities") { "Points" } else { "RGBPoints" };
        fields.refused(list, error)
    })
}

#[cfg(test)]
mod tests;

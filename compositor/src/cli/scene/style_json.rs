//! A style as the picture's manifest tells it.

use brickcast_volume::style::{Integration, Lighting, Mode, Style};
use serde_json::{Value, json};

/// Everything that the style says, in the words of the flags.
#[must_use]
pub(crate) fn describe(style: &Style) -> Value {
    let triple = |v: glam::DVec3| json!([v.x, v.y, v.z]);
    json!({
        "integration": match style.integration {
            Integration::Sampled => json!("sampled"),
            Integration::Preintegrated(size) => json!({ "preintegrated": size.entries() }),
        },
        "shading": style.shading.map(|phong| json!({
            "lighting": match phong.lighting {
                Lighting::Interpolated => "interpolated",
                Lighting::Center => "center",
                Lighting::Centroid => "centroid",
            },
            "light": phong.light.map(triple),
            "ambient": phong.ambient,
            "diffuse": phong.diffuse,
            "specular": phong.specular,
            "shininess": phong.shininess,
            "light_from": phong.light_from,
        })),
        "isosurfaces": style.surfaces.iter().map(|s| {
            let [r, g, b] = s.color;
            json!({ "value": s.value, "color": [r, g, b, s.opacity] })
        }).collect::<Vec<_>>(),
        "mode": match style.mode {
            Mode::Composite => "composite",
            Mode::Maximum => "mip",
            Mode::Minimum => "minip",
            Mode::Average => "average",
        },
        "clip": style.clip.bounds.map(|(lo, hi)| json!([lo.x, hi.x, lo.y, hi.y, lo.z, hi.z])),
        "clip_planes": style.clip.planes.iter().map(|p| json!([p.normal.x, p.normal.y, p.normal.z, p.offset]))
            .collect::<Vec<_>>(),
    })
}

//! The `zarr.json` files: OME-Zarr 0.5 groups and the arrays of the profile.
//!
//! Written as text in a fixed order, so that the same volume always gives the same bytes.

use super::manifest::Manifest;
use super::profile::{CHUNK_EDGE, SHARD_EDGE, ZSTD_LEVEL};

/// A JSON string.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// A JSON number that keeps every bit; the manifest's numbers are finite.
fn number(value: f64) -> String {
    serde_json::Value::from(value).to_string()
}

/// x, y, z to a JSON list in the array's order z, y, x.
fn zyx(v: [f64; 3]) -> String {
    format!("[{}, {}, {}]", number(v[2]), number(v[1]), number(v[0]))
}

/// The name that OME-Zarr (UDUNITS-2) has for a unit, where it has one.
fn ome_unit(unit: &str) -> Option<&'static str> {
    Some(match unit.trim() {
        "mm" | "millimeter" | "millimetre" => "millimeter",
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometre" => "micrometer",
        "nm" | "nanometer" | "nanometre" => "nanometer",
        "cm" | "centimeter" | "centimetre" => "centimeter",
        "m" | "meter" | "metre" => "meter",
        "km" | "kilometer" | "kilometre" => "kilometer",
        "in" | "inch" => "inch",
        "ft" | "foot" => "foot",
        "pm" | "picometer" => "picometer",
        "Å" | "angstrom" => "angstrom",
        _ => return None,
    })
}

/// `zarr.json` of the store itself.
pub(super) fn group(m: &Manifest) -> Vec<u8> {
    image(m, m.source.name.as_deref().unwrap_or("volume"), "")
}

/// `labels/zarr.json`: which label images there are.
pub(super) fn labels_group() -> Vec<u8> {
    br#"{
  "zarr_format": 3,
  "node_type": "group",
  "attributes": {
    "ome": {
      "version": "0.5",
      "labels": ["regions"]
    }
  }
}
"#
    .to_vec()
}

/// `labels/regions/zarr.json`: the label image.
pub(super) fn label_image(m: &Manifest) -> Vec<u8> {
    let source = r#",
      "image-label": {
        "source": { "image": "../../" }
      }"#;
    image(m, "regions", source)
}

/// An attribute of ours: OME-Zarr 0.5 knows scale and translation only, which are true of straight volumes. Columns as
/// in the manifest.
fn directions(m: &Manifest) -> String {
    if m.geometry.is_straight() {
        return String::new();
    }
    let axes = m.geometry.directions().to_cols_array_2d().map(|axis| format!("[{}]", axis.map(number).join(", ")));
    format!(
        r#",
    "brickcast": {{ "directions": [{}] }}"#,
        axes.join(", ")
    )
}

/// Scale and translation of a level, along the array's own axes: levels lie on each other where nobody knows of
/// directions, too.
fn dataset(m: &Manifest, level: usize) -> String {
    let factor = (level as f64).exp2();
    let (spacing, origin) = (m.geometry.spacing(), m.geometry.origin());
    format!(
        r#"            {{
              "path": "{level}",
              "coordinateTransformations": [
                {{ "type": "scale", "scale": {scale} }},
                {{ "type": "translation", "translation": {translation} }}
              ]
            }}"#,
        scale = zyx((spacing * factor).to_array()),
        translation = zyx((origin + spacing * ((factor - 1.0) * 0.5)).to_array()),
    )
}

/// An image, whose levels are the arrays `0`, `1`, ... below it; `more` goes on with the attributes of `ome`.
fn image(m: &Manifest, name: &str, more: &str) -> Vec<u8> {
    let unit = m.space_unit.as_deref().and_then(ome_unit);
    let unit = unit.map_or(String::new(), |u| format!(r#", "unit": "{u}""#));
    let directions = directions(m);
    let axes = ["z", "y", "x"].map(|axis| format!(r#"            {{ "name": "{axis}", "type": "space"{unit} }}"#));
    format!(
        r#"{{
  "zarr_format": 3,
  "node_type": "group",
  "attributes": {{
    "ome": {{
      "version": "0.5",
      "multiscales": [
        {{
          "name": {name},
          "axes": [
{axes}
          ],
          "datasets": [
{datasets}
          ]
        }}
      ]{more}
    }}{directions}
  }}
}}
"#,
        name = quoted(name),
        axes = axes.join(",\n"),
        datasets = (0..=m.levels.len()).map(|level| dataset(m, level)).collect::<Vec<_>>().join(",\n"),
    )
    .into_bytes()
}

/// `0/zarr.json`, and that of each level's array. The attribute `brickcast` tells other readers how stored numbers
/// become values.
pub(super) fn array(m: &Manifest) -> Vec<u8> {
    let no_data = m.no_data.as_ref().map_or(String::new(), |n| format!(r#", "no_data": {}"#, n.stored));
    let attributes = format!(
        r#"
    "brickcast": {{ "scale": {scale}, "offset": {offset}, "range": [{lo}, {hi}]{no_data} }}
  "#,
        scale = number(m.scale),
        offset = number(m.offset),
        lo = number(m.data_range.0),
        hi = number(m.data_range.1),
    );
    profile_array(m, m.stored_type.name(), &attributes)
}

/// `labels/regions/0/zarr.json`.
pub(super) fn label_array(m: &Manifest) -> Vec<u8> {
    profile_array(m, "uint32", "")
}

/// `distances/zarr.json`.
pub(super) fn distance_array(m: &Manifest) -> Vec<u8> {
    profile_array(m, "uint8", "")
}

fn profile_array(m: &Manifest, data_type: &str, attributes: &str) -> Vec<u8> {
    let d = m.geometry.dims();
    format!(
        r#"{{
  "zarr_format": 3,
  "node_type": "array",
  "shape": [{nz}, {ny}, {nx}],
  "data_type": "{data_type}",
  "chunk_grid": {{ "name": "regular", "configuration": {{ "chunk_shape": [{shard}, {shard}, {shard}] }} }},
  "chunk_key_encoding": {{ "name": "default", "configuration": {{ "separator": "/" }} }},
  "fill_value": 0,
  "codecs": [
    {{
      "name": "sharding_indexed",
      "configuration": {{
        "chunk_shape": [{chunk}, {chunk}, {chunk}],
        "codecs": [
          {{ "name": "bytes", "configuration": {{ "endian": "little" }} }},
          {{ "name": "zstd", "configuration": {{ "level": {level}, "checksum": false }} }},
          {{ "name": "crc32c" }}
        ],
        "index_codecs": [
          {{ "name": "bytes", "configuration": {{ "endian": "little" }} }},
          {{ "name": "crc32c" }}
        ],
        "index_location": "end"
      }}
    }}
  ],
  "dimension_names": ["z", "y", "x"],
  "attributes": {{{attributes}}}
}}
"#,
        nz = d.z,
        ny = d.y,
        nx = d.x,
        shard = SHARD_EDGE,
        chunk = CHUNK_EDGE,
        level = ZSTD_LEVEL,
    )
    .into_bytes()
}

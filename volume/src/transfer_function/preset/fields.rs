//! The fields of a ParaView preset, checked one by one; errors name the JSON path.

use serde_json::{Map, Value};

use super::error::{MAX_NODES, PresetErrorKind, kind, wrong};
use super::resample::{Node, Shape};
use crate::transfer_function::color_space::ColorSpace;
use crate::transfer_function::function::{MAX_POINTS, MAX_X};

pub(super) fn color_space(path: &str, preset: &Map<String, Value>) -> Result<ColorSpace, PresetErrorKind> {
    let wrap = match preset.get("HSVWrap") {
        None => false,
        Some(Value::Bool(wrap)) => *wrap,
        Some(Value::Number(n)) if n.as_f64() == Some(0.0) => false,
        Some(Value::Number(n)) if n.as_f64() == Some(1.0) => true,
        Some(other) => return Err(wrong(format!("{path}.HSVWrap"), format!("must be true, false, 0 or 1: {other}"))),
    };
    let path = format!("{path}.ColorSpace");
    let name = match preset.get("ColorSpace") {
        None => return Ok(ColorSpace::Rgb),
        Some(Value::String(name)) => name,
        Some(other) => return Err(wrong(path, format!("a colour space is a string, not {}", kind(other)))),
    };
    match name.to_ascii_lowercase().as_str() {
        "rgb" => Ok(ColorSpace::Rgb),
        "lab" | "cielab" => Ok(ColorSpace::Lab),
        "hsv" => Ok(ColorSpace::Hsv { wrap }),
        "diverging" => Ok(ColorSpace::Diverging),
        "step" => Ok(ColorSpace::Step),
        _ => Err(wrong(path, format!("{name:?} is not supported; there are RGB, Lab, HSV, Diverging and Step"))),
    }
}

/// `RGBPoints`: x, r, g, b.
pub(super) fn color_nodes(path: &str, preset: &Map<String, Value>) -> Result<Vec<Node<3>>, PresetErrorKind> {
    if preset.contains_key("volumeProperties") {
        return Err(wrong(
            path,
            "a volume property of 3D Slicer as JSON (.vp.json); save it from Slicer as text (.vp)",
        ));
    }
    let quads = quads(path, "RGBPoints", ["r", "g", "b"], preset)?;
    let quads = quads.ok_or_else(|| wrong(path, "has no RGBPoints: a list x, r, g, b, x, r, g, b, ... is needed"))?;
    Ok(quads.into_iter().map(|[x, r, g, b]| Node { x, values: [r, g, b], midpoint: 0.5, sharpness: 0.0 }).collect())
}

/// `Points`: x, opacity, midpoint, sharpness; `None` where the preset has none.
pub(super) fn opacity_nodes(path: &str, preset: &Map<String, Value>) -> Result<Option<Vec<Node<1>>>, PresetErrorKind> {
    let quads = quads(path, "Points", ["opacity", "midpoint", "sharpness"], preset)?;
    let node = |[x, opacity, midpoint, sharpness]: [f64; 4]| Node { x, values: [opacity], midpoint, sharpness };
    Ok(quads.map(|quads| quads.into_iter().map(node).collect()))
}

/// Every curve needs points of its own: lists with curves may not be as long as others.
pub(super) fn check_curves(
    path: &str,
    space: ColorSpace,
    colors: &[Node<3>],
    opacities: Option<&[Node<1>]>,
) -> Result<(), PresetErrorKind> {
    if space != ColorSpace::Rgb && colors.len() > MAX_NODES {
        return Err(wrong(format!("{path}.RGBPoints"), too_many(colors.len(), MAX_NODES)));
    }
    match opacities {
        Some(nodes) if nodes.len() > MAX_NODES && nodes.windows(2).any(|n| n[0].shape_to(&n[1]) != Shape::Linear) => {
            Err(wrong(format!("{path}.Points"), too_many(nodes.len(), MAX_NODES)))
        }
        _ => Ok(()),
    }
}

pub(super) fn too_many(got: usize, most: usize) -> String {
    format!("{got} points are more than {most}: thin the list out")
}

/// A flat list of x and three fractions called `names`, x not decreasing.
fn quads(
    path: &str,
    key: &str,
    names: [&str; 3],
    preset: &Map<String, Value>,
) -> Result<Option<Vec<[f64; 4]>>, PresetErrorKind> {
    let path = format!("{path}.{key}");
    let list = match preset.get(key) {
        // ParaView writes null for a preset that was saved without opacities.
        None | Some(Value::Null) => return Ok(None),
        Some(Value::Array(list)) => list,
        Some(other) => return Err(wrong(path, format!("must be a list of numbers, not {}", kind(other)))),
    };
    let count = list.len();
    if count == 0 {
        return Err(wrong(path, "the list is empty: at least one point (4 numbers) is needed"));
    }
    if count % 4 != 0 {
        let [a, b, c] = names;
        return Err(wrong(path, format!("{count} numbers are no multiple of 4 (x, {a}, {b}, {c})")));
    }
    if count / 4 > MAX_POINTS {
        return Err(wrong(path, too_many(count / 4, MAX_POINTS)));
    }
    let mut quads: Vec<[f64; 4]> = Vec::with_capacity(count / 4);
    for (i, four) in list.chunks_exact(4).enumerate() {
        let mut quad = [0.0; 4];
        for (k, (slot, value)) in quad.iter_mut().zip(four).enumerate() {
            let at = || format!("{path}[{}]", 4 * i + k);
            let number = value.as_f64().ok_or_else(|| wrong(at(), format!("not a number but {}", kind(value))))?;
            if k == 0 && number.abs() > MAX_X {
                return Err(wrong(at(), format!("x = {number:e} is beyond +-{MAX_X:e}")));
            }
            if k > 0 && !(0.0..=1.0).contains(&number) {
                return Err(wrong(at(), format!("{} = {number} must lie between 0 and 1", names[k - 1])));
            }
            *slot = number;
        }
        if let Some(before) = quads.last()
            && quad[0] < before[0]
        {
            let problem = format!("x = {} is less than the x before it ({}): sort the points by x", quad[0], before[0]);
            return Err(wrong(format!("{path}[{}]", 4 * i), problem));
        }
        quads.push(quad);
    }
    Ok(Some(quads))
}

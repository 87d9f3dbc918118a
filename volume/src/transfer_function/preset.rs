//! ParaView's colour-map presets: a JSON list of presets (the first one counts), or one bare preset.

use serde_json::Value;

use super::color_space::{ColorSpace, interpolate};
use super::preset_fields::{self as fields, PresetErrorKind};
use super::resample::{Node, Shape, resample, shaped};
use super::{ColorPoint, MAX_POINTS, MAX_X, OpacityPoint, TransferFunction};

/// The longest file that is read, bytes.
pub const MAX_BYTES: usize = 8 << 20;
/// The most control points of either list; curves between them are resampled into at most [`MAX_POINTS`] points.
pub const MAX_NODES: usize = MAX_POINTS / 4;

/// What the file does not say.
#[derive(Debug, Clone, PartialEq)]
pub struct PresetOptions {
    /// Stretches the preset's own x-range (over both lists) over this one: `--transfer-function-range LO,HI`.
    pub rescale: Option<(f64, f64)>,
    /// Opacities of a preset that has no `Points`, in data units; not rescaled.
    pub default_opacities: Vec<OpacityPoint>,
}

/// A preset, resampled to what is linear between points.
#[derive(Debug, Clone, PartialEq)]
pub struct Preset {
    /// `Name`, where the file has one.
    pub name: Option<String>,
    pub function: TransferFunction,
    /// False where the opacities are [`PresetOptions::default_opacities`]: worth telling the user.
    pub has_opacities: bool,
}

/// What is wrong with a preset, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{file}: {kind}")]
pub struct PresetError {
    pub file: String,
    pub kind: PresetErrorKind,
}

impl Preset {
    /// Parses the text of a preset; `file` is how errors call it.
    ///
    /// Keys: `RGBPoints` [x, r, g, b, ...], `Points` [x, opacity, midpoint, sharpness, ...], `ColorSpace` (RGB, Lab, HSV,
    /// Diverging, Step; absent: RGB), `HSVWrap` (absent: false, as ParaView writes it), `Name`. Others are ignored. A repeated
    /// x is a step.
    ///
    /// # Errors
    /// Malformed JSON (line and column), a wrong shape or value (JSON path), files and lists over the limits, a range to
    /// rescale to that is not `LO < HI`.
    pub fn from_json(file: &str, text: &str, options: &PresetOptions) -> Result<Self, PresetError> {
        parse(text, options).map_err(|kind| PresetError { file: file.to_owned(), kind })
    }
}

fn parse(text: &str, options: &PresetOptions) -> Result<Preset, PresetErrorKind> {
    if text.len() > MAX_BYTES {
        return Err(PresetErrorKind::TooLong { bytes: text.len() });
    }
    // ParaView's own files start with a byte order mark on some systems.
    let root: Value = serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(PresetErrorKind::json)?;
    let (path, preset) = fields::first_preset(&root)?;
    let space = fields::color_space(&path, preset)?;
    let mut colors = fields::color_nodes(&path, preset)?;
    let mut opacities = fields::opacity_nodes(&path, preset)?;
    if let Some((lo, hi)) = options.rescale {
        rescale(&mut colors, &mut opacities, lo, hi)?;
    }

    let colors = resample(
        &colors,
        MAX_POINTS,
        |a, b| match space {
            _ if a.values == b.values => Shape::Linear,
            ColorSpace::Rgb => Shape::Linear,
            ColorSpace::Step => Shape::Upper,
            ColorSpace::Lab | ColorSpace::Hsv { .. } | ColorSpace::Diverging => Shape::Curve { middle: 0.5 },
        },
        |a, b, s| interpolate(space, a.values, b.values, s),
    );
    let has_opacities = opacities.is_some();
    let opacities = match opacities {
        None => options.default_opacities.clone(),
        Some(nodes) => resample(&nodes, MAX_POINTS, Node::shape_to, |a, b, s| [shaped(a, b, s)])
            .into_iter()
            .map(|(x, [opacity])| OpacityPoint { x, opacity })
            .collect(),
    };
    let colors = colors.into_iter().map(|(x, rgb)| ColorPoint { x, rgb }).collect();
    let name = preset.get("Name").and_then(Value::as_str).map(str::to_owned);
    Ok(Preset { name, function: TransferFunction::new(colors, opacities)?, has_opacities })
}

fn rescale(
    colors: &mut [Node<3>],
    opacities: &mut Option<Vec<Node<1>>>,
    lo: f64,
    hi: f64,
) -> Result<(), PresetErrorKind> {
    if !(lo < hi && lo.abs() <= MAX_X && hi.abs() <= MAX_X) {
        return Err(PresetErrorKind::Range { lo, hi });
    }
    let opacities = opacities.as_deref_mut().unwrap_or_default();
    let xs = || colors.iter().map(|n| n.x).chain(opacities.iter().map(|n| n.x));
    let (first, last) = xs().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    let width = last - first;
    let stretch = |x: f64| match x {
        // The ends exactly; a preset of one x stands at LO.
        _ if x == first || width <= 0.0 => lo,
        _ if x == last => hi,
        _ => (lo + (x - first) / width * (hi - lo)).clamp(lo, hi),
    };
    colors.iter_mut().for_each(|n| n.x = stretch(n.x));
    opacities.iter_mut().for_each(|n| n.x = stretch(n.x));
    Ok(())
}

//! Files of transfer functions: ParaView's colour-map presets, a list of presets or one bare preset, as JSON or in the older
//! XML; and 3D Slicer's volume properties.

use super::color_space::{ColorSpace, interpolate};
use super::preset_categorical::{self as categorical, Categorical};
use super::preset_fields::{self as fields, PresetErrorKind};
use super::preset_list::{Entry, PresetList};
use super::resample::{Node, Shape, resample, shaped};
use super::volume_property;
use super::{ColorPoint, MAX_POINTS, MAX_X, OpacityPoint, TransferFunction};

/// The longest file that is read, bytes.
pub const MAX_BYTES: usize = 16 << 20;
/// The most control points of a list with curves between them, which are resampled into at most [`MAX_POINTS`] points; linear
/// lists may have as many.
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
    /// `Name`, where the file has one; ParaView's files have.
    pub name: Option<String>,
    pub function: TransferFunction,
    /// False where the opacities are [`PresetOptions::default_opacities`]: worth telling the user.
    pub has_opacities: bool,
    /// True where each colour is for one value and its neighbourhood: values between two labels are no labels.
    pub is_categorical: bool,
    /// What the file holds and no picture shows, for people.
    pub notes: Vec<String>,
}

/// What is wrong with a preset, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{file}: {kind}")]
pub struct PresetError {
    pub file: String,
    pub kind: PresetErrorKind,
}

impl Preset {
    /// Parses the text of a preset, the first of several; `file` is how errors call it.
    ///
    /// Keys: `RGBPoints` [x, r, g, b, ...], `Points` [x, opacity, midpoint, sharpness, ...], `ColorSpace` (RGB, Lab, HSV,
    /// Diverging, Step; absent: RGB), `HSVWrap` (absent: false, as ParaView writes it), `Name`. Others are ignored. A repeated
    /// x is a step. A categorical preset has `IndexedColors` [r, g, b, ...], `Annotations` [value, label, ...] and perhaps
    /// `IndexedOpacities` [opacity, ...].
    ///
    /// # Errors
    /// Malformed JSON (line and column), a wrong shape or value (JSON path), files and lists over the limits, a range to
    /// rescale to that is not `LO < HI`.
    pub fn from_json(file: &str, text: &str, options: &PresetOptions) -> Result<Self, PresetError> {
        PresetList::from_json(file, text)?.choose(None, options)
    }

    /// Parses the text of a 3D Slicer volume property (`.vp`): its colours and scalar opacities. Lighting is left out, and
    /// so is gradient opacity, of which [`Preset::notes`] tells.
    ///
    /// # Errors
    /// A line that is missing or holds something else (its number and what was expected there), a range to rescale to that
    /// is not `LO < HI`.
    pub fn from_volume_property(file: &str, text: &str, options: &PresetOptions) -> Result<Self, PresetError> {
        parse_property(text, options).map_err(|kind| PresetError { file: file.to_owned(), kind })
    }

    /// Parses the text of any kind of file, and takes its first preset: see [`PresetList`].
    ///
    /// # Errors
    /// As those.
    pub fn from_text(file: &str, text: &str, options: &PresetOptions) -> Result<Self, PresetError> {
        PresetList::from_text(file, text)?.choose(None, options)
    }
}

pub(super) fn parse_property(text: &str, options: &PresetOptions) -> Result<Preset, PresetErrorKind> {
    let property = volume_property::parse(text)?;
    let (mut colors, mut opacities) = (property.colors, Some(property.opacities));
    if let Some((lo, hi)) = options.rescale {
        rescale(&mut colors, &mut opacities, lo, hi)?;
    }
    let ignored = "its gradient opacity is left out: opacity here depends on the value alone";
    Ok(Preset {
        name: None,
        function: function(&colors, ColorSpace::Rgb, opacities, &options.default_opacities)?,
        has_opacities: true,
        is_categorical: false,
        notes: property.has_gradient_opacity.then(|| ignored.to_owned()).into_iter().collect(),
    })
}

/// The fields of a preset, checked.
enum Read {
    Continuous { space: ColorSpace, colors: Vec<Node<3>>, opacities: Option<Vec<Node<1>>> },
    Categorical(Categorical),
}

fn read(entry: &Entry) -> Result<Read, PresetErrorKind> {
    let (path, preset) = (&entry.path, entry.object()?);
    if categorical::is_categorical(preset) {
        return categorical::read(path, preset).map(Read::Categorical);
    }
    let space = fields::color_space(path, preset)?;
    let colors = fields::color_nodes(path, preset)?;
    let opacities = fields::opacity_nodes(path, preset)?;
    fields::check_curves(path, space, &colors, opacities.as_deref())?;
    Ok(Read::Continuous { space, colors, opacities })
}

/// True where nothing is wrong with its fields.
pub(super) fn is_usable(entry: &Entry) -> bool {
    read(entry).is_ok()
}

pub(super) fn parse(entry: &Entry, options: &PresetOptions) -> Result<Preset, PresetErrorKind> {
    let name = entry.name().map(str::to_owned);
    match read(entry)? {
        Read::Continuous { space, mut colors, mut opacities } => {
            if let Some((lo, hi)) = options.rescale {
                rescale(&mut colors, &mut opacities, lo, hi)?;
            }
            let has_opacities = opacities.is_some();
            let function = function(&colors, space, opacities, &options.default_opacities)?;
            Ok(Preset { name, function, has_opacities, is_categorical: false, notes: Vec::new() })
        }
        Read::Categorical(_) if options.rescale.is_some() => Err(fields::wrong(
            entry.path.as_str(),
            "the values of a categorical preset are labels: leave --transfer-function-range out",
        )),
        Read::Categorical(read) => {
            let function = read.function()?;
            Ok(Preset { name, function, has_opacities: true, is_categorical: true, notes: read.notes })
        }
    }
}

/// Nodes of opacity as a function; its colour is of no meaning.
pub(super) fn opacities_of(nodes: &[Node<1>]) -> Result<TransferFunction, PresetErrorKind> {
    let color = [Node { x: 0.0, values: [0.0; 3], midpoint: 0.5, sharpness: 0.0 }];
    function(&color, ColorSpace::Rgb, Some(nodes.to_vec()), &[])
}

/// Nodes to what is linear in between; `default` where there are no opacities.
fn function(
    colors: &[Node<3>],
    space: ColorSpace,
    opacities: Option<Vec<Node<1>>>,
    default: &[OpacityPoint],
) -> Result<TransferFunction, PresetErrorKind> {
    let colors = resample(
        colors,
        MAX_POINTS,
        |a, b| match space {
            _ if a.values == b.values => Shape::Linear,
            ColorSpace::Rgb => Shape::Linear,
            ColorSpace::Step => Shape::Upper,
            ColorSpace::Lab | ColorSpace::Hsv { .. } | ColorSpace::Diverging => Shape::Curve { middle: 0.5 },
        },
        |a, b, s| interpolate(space, a.values, b.values, s),
    );
    let opacities = match opacities {
        None => default.to_vec(),
        Some(nodes) => resample(&nodes, MAX_POINTS, Node::shape_to, |a, b, s| [shaped(a, b, s)])
            .into_iter()
            .map(|(x, [opacity])| OpacityPoint { x, opacity })
            .collect(),
    };
    let colors = colors.into_iter().map(|(x, rgb)| ColorPoint { x, rgb }).collect();
    Ok(TransferFunction::new(colors, opacities)?)
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

//! A preset: its fields read, and made a function of.

use super::categorical::{self, Categorical};
use super::curves::{function, rescale};
use super::entry::Entry;
use super::error::{PresetErrorKind, wrong};
use super::fields;
use super::resample::Node;
use super::volume_property;
use crate::transfer_function::color_space::ColorSpace;
use crate::transfer_function::function::{OpacityPoint, TransferFunction};

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
        Read::Categorical(_) if options.rescale.is_some() => Err(wrong(
            entry.path.as_str(),
            "the values of a categorical preset are labels: leave --transfer-function-range out",
        )),
        Read::Categorical(read) => {
            let function = read.function()?;
            Ok(Preset { name, function, has_opacities: true, is_categorical: true, notes: read.notes })
        }
    }
}

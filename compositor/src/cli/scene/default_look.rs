//! What a volume looks like where no transfer function is given: chosen from its statistics, and told.

use brickcast_volume::store::Manifest;
use brickcast_volume::style::Mode;
use brickcast_volume::transfer_function::materials::{Body, Materials, materials};
use brickcast_volume::transfer_function::of_projection::{Grays, Values};
use brickcast_volume::transfer_function::{Colormap, TransferFunction, TransferFunctionError, describe_default};

use crate::cli::args::LookArg;

/// A look's opacities refer to this share of the volume's diagonal: a voxel of a cube of 256, and what a larger volume
/// shows in as many pixels.
const UNITS_ACROSS: f64 = 443.0;

/// A transfer function that was chosen for the user.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chosen {
    pub(super) function: TransferFunction,
    /// World units; nothing where it is the usual one.
    pub(super) opacity_unit: Option<f64>,
}

/// It, and what is told of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Told {
    pub(super) chosen: Chosen,
    /// What shows how, all numbers in it.
    what: String,
    is_lit: bool,
}

/// By the look; without one by what `mode` shows of a ray.
pub(super) fn chosen(look: Option<LookArg>, mode: Mode, store: &Manifest) -> Told {
    let made = match (look, mode) {
        (Some(LookArg::Part), _) => of_materials(store, Body::Solid),
        (Some(LookArg::Scan), _) => of_materials(store, Body::Glass),
        (Some(LookArg::Mip), _) => gray(store, Values::of_maximum, "the largest value of each ray").ok(),
        (Some(LookArg::Xray), _) | (None, Mode::Average) => {
            gray(store, Values::of_average, "the mean of each ray").ok()
        }
        (None, Mode::Minimum) => gray(store, Values::of_minimum, "the smallest value of each ray").ok(),
        (None, Mode::Composite | Mode::Maximum) => None,
    };
    made.unwrap_or_else(|| plain(store))
}

impl Told {
    /// One line: every number that was chosen, and the flags that change it; `unit` is the opacity unit that was given.
    pub(super) fn note(&self, unit: Option<f64>) -> String {
        let Some(chosen) = self.chosen.opacity_unit else { return self.what.clone() };
        let unit = unit.unwrap_or(chosen);
        let light = if self.is_lit { "lit; " } else { "" };
        let unlit = if self.is_lit { ", --shading none" } else { "" };
        format!(
            "look: {}, opacities for each {} of depth; {light}change it with --look NAME, --transfer-function FILE, \
             --window LO,HI --opacity X --colormap NAME, --opacity-unit LENGTH{unlit}",
            self.what,
            short(unit)
        )
    }
}

/// The function of docs/definition.md, Transfer function 4.
fn plain(store: &Manifest) -> Told {
    let (otsu, q999) = (store.otsu, store.quantile_999);
    let function = TransferFunction::default_for(otsu, q999);
    let what = describe_default(otsu, q999);
    Told { chosen: Chosen { function, opacity_unit: None }, what, is_lit: false }
}

fn diagonal(store: &Manifest) -> f64 {
    2.0 * store.geometry.radius_world()
}

/// The classes of the histogram as materials. Where a few values lie so far from all others that the histogram tells no
/// classes: all from the middle of the upper half of the voxels on, which quantiles tell.
fn of_materials(store: &Manifest, body: Body) -> Option<Told> {
    let (function, what) = match materials(&store.histogram, store.range, body) {
        Ok(Some(found)) => {
            let words = materials_in_words(&found, body);
            (found.function, words)
        }
        Ok(None) => {
            let (median, q999) = (store.quantiles[4], store.quantile_999);
            let from = 0.5 * (median + q999);
            let function = TransferFunction::window(from, q999, 0.5, Colormap::Cividis).ok()?;
            let what = format!(
                "clear below {from} (half-way between median and 99.9 % quantile), then cividis and opacity to 0.5 at \
                 {q999}"
            );
            (function, what)
        }
        Err(_) => return None,
    };
    let opacity_unit = Some(diagonal(store) / UNITS_ACROSS);
    Some(Told { chosen: Chosen { function, opacity_unit }, what, is_lit: true })
}

fn materials_in_words(found: &Materials, body: Body) -> String {
    let (air, shown) = (&found.classes[0], &found.classes[1..]);
    let of = |class: &brickcast_volume::transfer_function::suggest::ValueClass| {
        let [r, g, b] = class.rgb.map(|c| (c * 255.0).round() as u8);
        format!("from {} #{r:02x}{g:02x}{b:02x} opacity {}", short(class.range.0), short(class.opacity))
    };
    let (count, several) = (shown.len(), if shown.len() == 1 { "" } else { "s" });
    let glass = if body == Body::Glass { "as glass, borders at opacity 0.1, " } else { "" };
    format!(
        "{count} material{several} {glass}by the histogram (Otsu): clear below {}, {}",
        short(air.range.1),
        shown.iter().map(of).collect::<Vec<_>>().join(", ")
    )
}

fn gray(
    store: &Manifest,
    of: impl Fn(&Values) -> Result<Grays, TransferFunctionError>,
    what: &str,
) -> Result<Told, TransferFunctionError> {
    let Manifest { min, max, mean, otsu, quantile_999: q999, quantiles: [.., median, _, _, _, _], .. } = *store;
    let [min, max] = [min, max].map(|value| value.clamp(store.range.0, store.range.1));
    let Grays { function, from, to } = of(&Values { min, max, mean, median, otsu, q999 })?;
    let what = format!(
        "look: {what}, black at {} to white at {}; change it with --window LO,HI --opacity X --colormap NAME or --look \
         NAME",
        short(from),
        short(to)
    );
    Ok(Told { chosen: Chosen { function, opacity_unit: None }, what, is_lit: false })
}

/// To four digits.
fn short(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

//! Files of transfer functions.

use std::path::Path;

use brickcast_volume::small_file::read_text;
use brickcast_volume::store::Manifest;
use brickcast_volume::transfer_function::{
    OpacityPoint, Preset, PresetList, PresetOptions, default_opacities, describe_default_opacities,
};

use super::preset_fit::{Fit, fit};
use crate::cli::failure::Failure;

/// The longest that is read, bytes: presets of 65,536 points, and lists of hundreds.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// What is asked of a file.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wanted<'a> {
    /// Which of several presets; the first without it.
    pub name: Option<&'a str>,
    /// Stretches it over these data values.
    pub range: Option<[f64; 2]>,
}

/// Reads a ParaView preset (JSON or the older XML) or a 3D Slicer volume property (`.vp`). On a volume, a preset
/// without opacities gets the default ones, and one written for other values is stretched or told of: [`Preset::notes`]
/// says all of that. Without a volume such opacities are 0.
///
/// # Errors
/// A file that cannot be read or is none of them, a name that it does not hold, a preset that cannot be used.
pub fn read(path: &Path, wanted: Wanted<'_>, volume: Option<&Manifest>) -> Result<Preset, Failure> {
    let text = read_text("transfer function", path, MAX_FILE_BYTES)?;
    let list = PresetList::from_text(&path.display().to_string(), &text)?;
    let opacities = volume
        .map_or_else(|| vec![OpacityPoint { x: 0.0, opacity: 0.0 }], |m| default_opacities(m.otsu, m.quantile_999));
    let rescale = wanted.range.map(|[lo, hi]| (lo, hi));
    let mut options = PresetOptions { rescale, default_opacities: opacities };
    let mut preset = list.choose(wanted.name, &options)?;
    let Some(volume) = volume else { return Ok(preset) };
    if wanted.range.is_none() {
        match fit(&preset, volume) {
            Fit::AsItIs => {}
            Fit::Told(note) => preset.notes.push(note),
            Fit::Stretched([lo, hi], note) => {
                options.rescale = Some((lo, hi));
                preset = list.choose(wanted.name, &options)?;
                preset.notes.push(note);
            }
        }
    }
    if !preset.has_opacities {
        let ramp = describe_default_opacities(volume.otsu, volume.quantile_999);
        preset.notes.push(format!("no opacities in it: {ramp}, in the colours of the file"));
    }
    Ok(preset)
}

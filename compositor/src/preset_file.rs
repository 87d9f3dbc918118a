//! Files of transfer functions.

use std::path::Path;

use anyhow::Context as _;
use brickcast_volume::transfer_function::{OpacityPoint, Preset, PresetOptions};

use crate::failure::Failure;

/// Reads a ParaView preset or a 3D Slicer volume property (`.vp`), stretched over `range` where one is given; a preset without
/// opacities gets `default_opacities`.
///
/// # Errors
/// A file that cannot be read or is neither.
pub fn read(path: &Path, range: Option<[f64; 2]>, default_opacities: Vec<OpacityPoint>) -> Result<Preset, Failure> {
    let file = path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(|| format!("transfer function {file}: cannot be read"))?;
    let options = PresetOptions { rescale: range.map(|[lo, hi]| (lo, hi)), default_opacities };
    Ok(Preset::from_text(&file, &text, &options)?)
}

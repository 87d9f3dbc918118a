//! Stacks with holes: what is missing or broken is filled, where the user says so, and named.

use brickcast_volume::format::{RawHints, VoxelType};

use crate::number::put;

/// Slices that were filled and are named one by one.
const NAMED: usize = 24;

/// Which slices were filled, and why.
#[derive(Debug, Default)]
pub(crate) struct Filled(Vec<(String, String)>);

impl Filled {
    pub(crate) fn add(&mut self, slice: String, why: impl Into<String>) {
        self.0.push((slice, why.into()));
    }

    pub(crate) fn count(&self) -> usize {
        self.0.len()
    }

    /// What is said of it, of `slices` in all.
    pub(crate) fn notes(&self, slices: usize, voxel_type: VoxelType, hints: &RawHints) -> Vec<String> {
        if self.0.is_empty() {
            return Vec::new();
        }
        let (count, value) = (self.0.len(), fill_value(voxel_type, hints));
        let as_data = if value.is_nan() || hints.no_data.is_some() {
            ""
        } else {
            ", which counts as data (--no-data VALUE says what does not)"
        };
        let mut notes = vec![format!("--skip-broken: {count} of {slices} slices were filled with {value}{as_data}")];
        notes.extend(self.0.iter().take(NAMED).map(|(slice, why)| format!("filled: {slice}, {why}")));
        if count > NAMED {
            notes.push(format!("filled: {} more, the last of them {}", count - NAMED, self.0[count - 1].0));
        }
        notes
    }
}

/// What stands for no data, where the type has such a number.
fn fill_value(voxel_type: VoxelType, hints: &RawHints) -> f64 {
    match voxel_type {
        VoxelType::F32 | VoxelType::F64 => f64::NAN,
        _ => hints.no_data.unwrap_or(0.0),
    }
}

/// A plane of so many voxels.
pub(crate) fn plane(voxel_type: VoxelType, hints: &RawHints, voxels: usize) -> Vec<u8> {
    let mut one = Vec::new();
    put(voxel_type, fill_value(voxel_type, hints), &mut one);
    one.repeat(voxels)
}

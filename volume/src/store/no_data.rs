//! Voxels that hold no data: NaN and declared fill values. They are one stored number, and code 0 once bricks are loaded; data
//! have codes from 1 on (docs/adr/0008-no-data.md).

use serde::{Deserialize, Serialize};

use super::error::{ManifestError, StoreError};
use super::histogram::Histogram;
use super::manifest_file::field;
use super::quantise::Scan;
use super::voxel::{StoredType, Voxel};
use crate::format::VoxelType;

/// The code of voxels without data, in stores that have some.
pub const NO_DATA_CODE: u16 = 0;
/// The smallest code of data in such stores.
pub(super) const FIRST_CODE: u16 = 1;
/// The most fill values that a manifest names.
const MAX_FILL: usize = 16;

/// What a manifest says of voxels without data; a store without any has none of this.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoData {
    /// The stored number that they have.
    pub stored: i32,
    /// How many they are.
    pub voxels: u64,
    /// The declared fill values, as they were declared; none where all are NaN.
    pub fill: Vec<f64>,
}

impl NoData {
    pub(super) fn check(self, stored_type: StoredType, voxels: u64) -> Result<Self, ManifestError> {
        let last = stored_type.min() + (stored_type.values() - 1) as i32;
        if !(stored_type.min()..=last).contains(&self.stored) {
            return Err(field("no_data", format!("{} is no number of type {}", self.stored, stored_type.name())));
        }
        if self.voxels == 0 || self.voxels >= voxels {
            return Err(field("no_data", format!("{} of {voxels} voxels; some, and not all", self.voxels)));
        }
        if self.fill.len() > MAX_FILL || self.fill.iter().any(|v| v.is_nan()) {
            return Err(field("no_data", format!("at most {MAX_FILL} fill values, each a number")));
        }
        Ok(self)
    }

    /// Who they are and what becomes of them, for people; `nan` of them are NaN.
    #[must_use]
    pub fn words(&self, nan: u64) -> String {
        let filled = self.voxels.saturating_sub(nan);
        let values: Vec<String> = self.fill.iter().map(ToString::to_string).collect();
        let why = match (nan, filled) {
            (_, 0) => "NaN".to_owned(),
            (0, _) => format!("fill value {}", values.join(", ")),
            (nan, filled) => format!("{nan} NaN, {filled} of fill value {}", values.join(", ")),
        };
        format!("{} voxels hold no data ({why}) and show nothing", self.voxels)
    }
}

/// What codes 0 and 65535 stand for, so that 1 and 65535 stand for the ends of `range`.
pub(super) fn with_room_below((lo, hi): (f64, f64)) -> (f64, f64) {
    (lo - (hi - lo) / 65534.0, hi)
}

/// Nothing for voxels without data.
pub(super) fn clear_holes<T: Copy + Default>(codes: &[u16], of_voxels: &mut [T]) {
    let holes = codes.iter().zip(of_voxels).filter(|(code, _)| **code == NO_DATA_CODE);
    holes.for_each(|(_, value)| *value = T::default());
}

/// Fill values as the voxels of a source hold them.
#[derive(Debug, Clone, Default)]
pub(super) struct Fill {
    /// As declared.
    declared: Vec<f64>,
    values: Vec<f64>,
}

impl Fill {
    pub(super) fn new(voxel_type: VoxelType, declared: &[f64]) -> Self {
        let declared: Vec<f64> = declared.iter().copied().filter(|v| !v.is_nan()).take(MAX_FILL).collect();
        // A header says -9999.9, the voxel holds the nearest f32.
        let held = |v: &f64| if voxel_type == VoxelType::F32 { f64::from(*v as f32) } else { *v };
        let values = declared.iter().map(held).collect();
        Self { declared, values }
    }

    pub(super) fn declared(&self) -> &[f64] {
        &self.declared
    }

    /// Does a voxel of this value hold no data?
    #[inline(always)]
    pub(super) fn is_no_data(&self, value: f64) -> bool {
        value.is_nan() || self.values.contains(&value)
    }

    /// The ordinals of the fill values that a source of `stored_type` can hold, where it is stored as it is.
    pub(super) fn ordinals(&self, stored_type: StoredType) -> Vec<u16> {
        let ordinal = |v: &f64| {
            let ordinal = v - f64::from(stored_type.min());
            let is_one = ordinal.fract() == 0.0 && (0.0..stored_type.values() as f64).contains(&ordinal);
            is_one.then_some(ordinal as u16)
        };
        self.values.iter().filter_map(ordinal).collect()
    }
}

/// The stored numbers, as ordinals, of voxels without data; the first becomes that of all.
#[derive(Debug, Clone)]
pub(super) struct Missing {
    ordinals: Vec<u16>,
    /// How many are NaN.
    nan: u64,
}

impl Missing {
    /// `scan` of sources that are mapped to 16 bits.
    pub(super) fn new(fill: &Fill, stored_type: StoredType, scan: Option<&Scan>) -> Self {
        match scan {
            None => Self { ordinals: fill.ordinals(stored_type), nan: 0 },
            Some(scan) if scan.no_data > 0 => Self { ordinals: vec![0], nan: scan.not_finite.nan },
            Some(_) => Self { ordinals: Vec::new(), nan: 0 },
        }
    }

    pub(super) fn ordinal(&self) -> Option<u16> {
        self.ordinals.first().copied()
    }

    /// Gives all of `voxels` that lack data the same number.
    pub(super) fn make_one<T: Voxel>(&self, voxels: &mut [T]) {
        if let [first, others @ ..] = &self.ordinals[..]
            && !others.is_empty()
        {
            let first = T::at(*first);
            voxels.iter_mut().filter(|v| others.contains(&v.ordinal())).for_each(|v| *v = first);
        }
    }

    /// Takes them out of the histogram of all voxels; how many they are.
    pub(super) fn leave_out(&self, histogram: &mut Histogram) -> Result<u64, StoreError> {
        let (voxels, nan) = (self.ordinal().map_or(0, |ordinal| histogram.leave_out(ordinal)), self.nan);
        if histogram.total() == 0 {
            return Err(StoreError::NothingHoldsData { voxels, nan, fill: voxels.saturating_sub(nan) });
        }
        Ok(voxels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_1_and_the_last_code_stand_for_the_ends() {
        for (lo, hi) in [(0.0, 255.0), (-1.0, 1.0), (1e15, 1e15 + 4.0), (-1e-9, 3e7)] {
            let (below, top) = with_room_below((lo, hi));
            let first = below + (top - below) / 65535.0;
            assert!(top == hi && (first - lo).abs() <= 1e-12 * (hi - lo).max(lo.abs()), "{lo}..{hi}: {first}");
        }
    }

    #[test]
    fn fill_values_are_met_as_the_voxels_hold_them() {
        let fill = Fill::new(VoxelType::F32, &[-9999.9, f64::NAN]);
        assert!(fill.is_no_data(f64::from(-9999.9f32)) && fill.is_no_data(f64::NAN) && !fill.is_no_data(-9999.0));
        assert_eq!(fill.declared(), [-9999.9]);
        let fill = Fill::new(VoxelType::I16, &[-32768.0, 0.5, 40_000.0, 7.0]);
        assert_eq!(fill.ordinals(StoredType::I16), [0, 32_775]);
        assert_eq!(fill.ordinals(StoredType::U8), [7]);
    }

    #[test]
    fn words_name_what_stands_for_no_data() {
        let of = |voxels, fill: &[f64], nan| NoData { stored: 0, voxels, fill: fill.into() }.words(nan);
        assert_eq!(of(5, &[], 5), "5 voxels hold no data (NaN) and show nothing");
        assert_eq!(of(5, &[-1.0], 0), "5 voxels hold no data (fill value -1) and show nothing");
        assert_eq!(of(5, &[-1.0], 2), "5 voxels hold no data (2 NaN, 3 of fill value -1) and show nothing");
    }
}

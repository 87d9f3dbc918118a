//! Voxels that hold no data: NaN and declared fill values. They are one stored number, and code 0 once bricks are
//! loaded; data have codes from 1 on (docs/adr/0008-no-data.md).

use serde::{Deserialize, Serialize};

use super::error::ManifestError;
use super::manifest::checks::field;
use super::voxel::StoredType;

/// The code of voxels without data, in stores that have some.
pub const NO_DATA_CODE: u16 = 0;
/// The smallest code of data in such stores.
pub(super) const FIRST_CODE: u16 = 1;
/// The most fill values that a manifest names.
pub(super) const MAX_FILL: usize = 16;

/// What a manifest says of voxels without data; a store without any has none of this.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoData {
    /// The stored number that they have.
    pub stored: i32,
    /// How many they are; on a coarser level, none where each of its voxels stands for one with data.
    pub voxels: u64,
    /// The declared fill values, as they were declared; none where all are NaN.
    pub fill: Vec<f64>,
}

impl NoData {
    pub(super) fn check(self, stored_type: StoredType, voxels: u64, level: u8) -> Result<Self, ManifestError> {
        let last = stored_type.min() + (stored_type.values() - 1) as i32;
        if !(stored_type.min()..=last).contains(&self.stored) {
            return Err(field("no_data", format!("{} is no number of type {}", self.stored, stored_type.name())));
        }
        if (self.voxels == 0 && level == 0) || self.voxels >= voxels {
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
    fn words_name_what_stands_for_no_data() {
        let of = |voxels, fill: &[f64], nan| NoData { stored: 0, voxels, fill: fill.into() }.words(nan);
        assert_eq!(of(5, &[], 5), "5 voxels hold no data (NaN) and show nothing");
        assert_eq!(of(5, &[-1.0], 0), "5 voxels hold no data (fill value -1) and show nothing");
        assert_eq!(of(5, &[-1.0], 2), "5 voxels hold no data (2 NaN, 3 of fill value -1) and show nothing");
    }
}

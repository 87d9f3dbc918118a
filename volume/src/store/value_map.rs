//! From stored numbers to values in the file's units, and from those to stretched codes.

use super::error::StoreError;
use super::no_data::{FIRST_CODE, NO_DATA_CODE};
use super::voxel::StoredType;

/// `value = scale * stored + offset`, and `code = round(65535 (value - lo) / (hi - lo))`, clamped to 0..=65535.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueMap {
    pub stored_type: StoredType,
    pub scale: f64,
    pub offset: f64,
    /// File's units; lo < hi.
    pub range: (f64, f64),
    /// The stored number of voxels without data: they alone have code 0.
    pub no_data: Option<i32>,
}

/// A range that codes can be stretched over: finite ends, and a width whose 65,535th part is a normal number.
pub(super) fn check_range(lo: f64, hi: f64) -> Result<(), StoreError> {
    let code_width = (hi - lo) / 65535.0;
    let good = lo.is_finite() && hi.is_finite() && lo < hi && code_width.is_normal();
    if good { Ok(()) } else { Err(StoreError::Range { lo, hi }) }
}

/// The bounds of the data; a constant volume gets a width of one, or of what a large value needs to have a width at
/// all.
pub(super) fn default_range(min: f64, max: f64) -> (f64, f64) {
    if min < max && check_range(min, max).is_ok() { (min, max) } else { (min, min + (min.abs() * 1e-6).max(1.0)) }
}

impl ValueMap {
    /// File's units.
    #[must_use]
    pub fn value_of_stored(&self, stored: i32) -> f64 {
        self.scale * f64::from(stored) + self.offset
    }

    /// Value of the `ordinal`-th stored number, counted from the type's smallest; file's units.
    pub(super) fn value_of_ordinal(&self, ordinal: f64) -> f64 {
        self.scale * (ordinal + f64::from(self.stored_type.min())) + self.offset
    }

    /// The stretched code of a value in the file's units; NaN has code 0 (1 where 0 is for voxels without data).
    #[must_use]
    pub fn code_of_value(&self, value: f64) -> u16 {
        let (lo, hi) = self.range;
        // `as` saturates, and takes NaN to 0.
        let code = (((value - lo) / (hi - lo)).clamp(0.0, 1.0) * 65535.0).round() as u16;
        if self.no_data.is_some() { code.max(FIRST_CODE) } else { code }
    }

    /// The value in the file's units that a stretched code stands for.
    #[must_use]
    pub fn value_of_code(&self, code: u16) -> f64 {
        let (lo, hi) = self.range;
        let t = f64::from(code) / 65535.0;
        lo * (1.0 - t) + hi * t
    }

    /// Stretched code of every ordinal.
    pub(super) fn code_of_ordinal_table(&self) -> Vec<u16> {
        let code = |o| self.code_of_value(self.value_of_ordinal(o as f64));
        let mut codes: Vec<u16> = (0..self.stored_type.values()).map(code).collect();
        let missing = self.no_data.map(|stored| (stored - self.stored_type.min()) as usize);
        if let Some(code) = missing.and_then(|ordinal| codes.get_mut(ordinal)) {
            *code = NO_DATA_CODE;
        }
        codes
    }

    /// Stretched code of every bit pattern of the stored type, so that reading needs no sign arithmetic.
    pub(super) fn code_of_bits_table(&self) -> Vec<u16> {
        let by_ordinal = self.code_of_ordinal_table();
        (0..self.stored_type.values())
            .map(|bits| by_ordinal[usize::from(self.stored_type.ordinal_of_bits(bits as u16))])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_stretched_rounded_and_clamped() {
        let map =
            ValueMap { stored_type: StoredType::I16, scale: 1.0, offset: 0.0, range: (-1000.0, 3000.0), no_data: None };
        assert_eq!(map.code_of_value(-1000.0), 0);
        assert_eq!(map.code_of_value(3000.0), 65535);
        assert_eq!(map.code_of_value(-2e9), 0);
        assert_eq!(map.code_of_value(f64::INFINITY), 65535);
        assert_eq!(map.code_of_value(f64::NAN), 0);
        assert_eq!(map.code_of_value(0.0), (65535.0f64 * 0.25).round() as u16);
        let table = map.code_of_bits_table();
        for stored in [i16::MIN, -1000, -1, 0, 1, 2999, i16::MAX] {
            assert_eq!(table[usize::from(stored as u16)], map.code_of_value(f64::from(stored)));
        }
        for code in [0u16, 1, 777, 65534, 65535] {
            assert_eq!(map.code_of_value(map.value_of_code(code)), code);
        }
    }

    /// A fill value in the midst of the data, and data below the range: one code of its own, which no datum shares.
    #[test]
    fn no_datum_has_the_code_of_no_data() {
        let range = super::super::no_data::with_room_below((-1000.0, 3000.0));
        let (stored_type, scale, offset) = (StoredType::I16, 1.0, 0.0);
        let map = ValueMap { stored_type, scale, offset, range, no_data: Some(-7) };
        let table = map.code_of_bits_table();
        assert_eq!(table.iter().filter(|code| **code == NO_DATA_CODE).count(), 1);
        assert_eq!(table[usize::from(-7i16 as u16)], NO_DATA_CODE);
        assert_eq!((map.code_of_value(-1000.0), map.code_of_value(-2e9), map.code_of_value(3000.0)), (1, 1, 65535));
        assert!(table[usize::from(-6i16 as u16)] > table[usize::from(-8i16 as u16)]);
    }

    #[test]
    fn ranges_that_cannot_be_stretched_are_refused() {
        let bad = [(0.0, 0.0), (1.0, 0.0), (0.0, f64::NAN), (0.0, f64::INFINITY), (0.0, 5e-324), (-1e308, 1e308)];
        for (lo, hi) in bad {
            assert!(check_range(lo, hi).is_err(), "{lo}..{hi}");
        }
        assert!(check_range(-1e300, 1e300).is_ok());
    }
}

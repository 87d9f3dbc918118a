//! From 32- and 64-bit sources to 16-bit stored numbers: a first pass finds the finite values' bounds, the second maps
//! them.

use rayon::prelude::*;

use super::fill::Fill;
use crate::format::VoxelType;
use crate::store::error::StoreError;
use crate::store::manifest::NotFinite;
use crate::store::no_data::FIRST_CODE;
use crate::store::value_map::check_range;

/// What the first pass over a source of 32 or 64 bits finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scan {
    /// Smallest and largest finite value; `min > max` where there is none.
    min: f64,
    max: f64,
    /// True while every finite value was a whole number.
    whole: bool,
    /// 64-bit integers that f64 does not hold: beyond 2^53 not every whole number is one.
    pub(crate) rounded: u64,
    pub(crate) not_finite: NotFinite,
    /// NaN, and fill values.
    pub(crate) no_data: u64,
}

impl Scan {
    pub(crate) const EMPTY: Self = Self {
        min: f64::INFINITY,
        max: f64::NEG_INFINITY,
        whole: true,
        rounded: 0,
        not_finite: NotFinite { nan: 0, negative_infinity: 0, positive_infinity: 0 },
        no_data: 0,
    };

    /// Smallest and largest finite value of the source; `(0, 0)` where it has none.
    pub(crate) fn bounds(&self) -> (f64, f64) {
        if self.min <= self.max { (self.min, self.max) } else { (0.0, 0.0) }
    }

    fn with(mut self, value: f64, fill: &Fill) -> Self {
        if fill.is_no_data(value) {
            self.no_data += 1;
            self.not_finite.nan += u64::from(value.is_nan());
        } else if value.is_finite() {
            self.min = self.min.min(value);
            self.max = self.max.max(value);
            self.whole &= value.trunc() == value;
        } else if value < 0.0 {
            self.not_finite.negative_infinity += 1;
        } else {
            self.not_finite.positive_infinity += 1;
        }
        self
    }

    /// For a file.
    pub(crate) fn numbers(&self) -> [u64; 8] {
        let NotFinite { nan, negative_infinity, positive_infinity } = self.not_finite;
        let Self { whole, rounded, no_data, .. } = *self;
        let [min, max] = [self.min, self.max].map(f64::to_bits);
        [min, max, whole.into(), rounded, nan, negative_infinity, positive_infinity, no_data]
    }

    pub(crate) fn of_numbers(numbers: [u64; 8]) -> Self {
        let [min, max, whole, rounded, nan, negative_infinity, positive_infinity, no_data] = numbers;
        let not_finite = NotFinite { nan, negative_infinity, positive_infinity };
        let [min, max] = [min, max].map(f64::from_bits);
        Self { min, max, whole: whole == 1, rounded, not_finite, no_data }
    }

    pub(crate) fn joined(self, other: Self) -> Self {
        let (a, b) = (self.not_finite, other.not_finite);
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            whole: self.whole && other.whole,
            rounded: self.rounded + other.rounded,
            not_finite: NotFinite {
                nan: a.nan + b.nan,
                negative_infinity: a.negative_infinity + b.negative_infinity,
                positive_infinity: a.positive_infinity + b.positive_infinity,
            },
            no_data: self.no_data + other.no_data,
        }
    }

    /// Takes in a plane of little-endian voxels of 32 or 64 bits.
    pub(crate) fn add(self, voxel_type: VoxelType, fill: &Fill, plane: &[u8]) -> Self {
        plane
            .par_chunks(PIECE * voxel_type.bytes())
            .map(|piece| match voxel_type.bytes() {
                8 => {
                    let (value, exact) = (value_of_8(voxel_type), exact_of_8(voxel_type));
                    let eights = piece.as_chunks::<8>().0.iter();
                    eights.fold(Self::EMPTY, |scan, b| scan.rounding(!exact(*b)).with(value(*b), fill))
                }
                _ => {
                    let value = value_of(voxel_type);
                    piece.as_chunks::<4>().0.iter().fold(Self::EMPTY, |scan, b| scan.with(value(*b), fill))
                }
            })
            .reduce(|| Self::EMPTY, Self::joined)
            .joined(self)
    }

    fn rounding(mut self, rounded: bool) -> Self {
        self.rounded += u64::from(rounded);
        self
    }
}

/// Voxels that one task takes.
const PIECE: usize = 1 << 16;

/// A 32-bit voxel's value. Called per voxel through a pointer only once the type is known.
fn value_of(voxel_type: VoxelType) -> fn([u8; 4]) -> f64 {
    match voxel_type {
        VoxelType::U32 => |b| f64::from(u32::from_le_bytes(b)),
        VoxelType::I32 => |b| f64::from(i32::from_le_bytes(b)),
        _ => |b| f64::from(f32::from_le_bytes(b)),
    }
}

/// A 64-bit voxel's value, whole numbers beyond 2^53 rounded to even.
fn value_of_8(voxel_type: VoxelType) -> fn([u8; 8]) -> f64 {
    match voxel_type {
        VoxelType::U64 => |b| u64::from_le_bytes(b) as f64,
        VoxelType::I64 => |b| i64::from_le_bytes(b) as f64,
        _ => f64::from_le_bytes,
    }
}

/// Says of a 64-bit voxel whether [`value_of_8`] is its very value.
fn exact_of_8(voxel_type: VoxelType) -> fn([u8; 8]) -> bool {
    match voxel_type {
        VoxelType::U64 => |b| u64::from_le_bytes(b) as f64 as u128 == u128::from(u64::from_le_bytes(b)),
        VoxelType::I64 => |b| i64::from_le_bytes(b) as f64 as i128 == i128::from(i64::from_le_bytes(b)),
        _ => |_| true,
    }
}

/// `stored = round((value - offset) / scale)`, clamped to `first..=top`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quantiser {
    pub(crate) scale: f64,
    pub(crate) offset: f64,
    /// Of data: above 0 where 0 is for voxels without.
    first: u16,
    top: u16,
    /// True where every voxel's value survives exactly.
    pub(crate) lossless: bool,
}

impl Quantiser {
    /// Spreads the source's values, or where `range` is given those of them inside it, over 16 bits; whole numbers that
    /// fit are only shifted, and so survive exactly.
    pub(crate) fn new(scan: &Scan, range: Option<(f64, f64)>) -> Result<Self, StoreError> {
        let (min, max) = scan.bounds();
        let (lo, hi) = match range {
            Some((lo, hi)) if lo.max(min) < hi.min(max) => (lo.max(min), hi.min(max)),
            _ => (min, max),
        };
        let first = if scan.no_data > 0 { FIRST_CODE } else { 0 };
        let most = f64::from(u16::MAX - first);
        let whole = scan.whole && lo.fract() == 0.0 && hi.fract() == 0.0 && hi - lo <= most;
        if whole || lo == hi {
            let infinite = scan.not_finite.negative_infinity > 0 || scan.not_finite.positive_infinity > 0;
            let offset = lo - f64::from(first);
            // A constant that is no whole number need not survive the shift.
            let lossless = (lo, hi) == (min, max) && !infinite && scan.rounded == 0 && offset + f64::from(first) == lo;
            return Ok(Self { scale: 1.0, offset, first, top: (hi - lo) as u16 + first, lossless });
        }
        check_range(lo, hi)?;
        let scale = (hi - lo) / most;
        Ok(Self { scale, offset: lo - scale * f64::from(first), first, top: u16::MAX, lossless: false })
    }

    /// Maps little-endian voxels of 32 or 64 bits; `out` has one entry for each. Without data they become 0, -Inf the
    /// smallest of data, +Inf `top`.
    pub(crate) fn map(&self, voxel_type: VoxelType, fill: &Fill, bytes: &[u8], out: &mut [u16]) {
        let pieces = out.par_chunks_mut(PIECE).zip(bytes.par_chunks(PIECE * voxel_type.bytes()));
        pieces.for_each(|(out, bytes)| self.map_here(voxel_type, fill, bytes, out));
    }

    /// The same in this thread alone.
    pub(crate) fn map_here(&self, voxel_type: VoxelType, fill: &Fill, bytes: &[u8], out: &mut [u16]) {
        let (offset, inverse, first, top) = (self.offset, 1.0 / self.scale, self.first, self.top);
        // `as` saturates, and takes NaN to 0.
        let stored = |value: f64| match fill.is_no_data(value) {
            true => 0,
            false => (((value - offset) * inverse + 0.5) as u16).clamp(first, top),
        };
        let (eights, fours) = (bytes.as_chunks::<8>().0, bytes.as_chunks::<4>().0);
        match voxel_type {
            VoxelType::U64 => out.iter_mut().zip(eights).for_each(|(o, b)| *o = stored(u64::from_le_bytes(*b) as f64)),
            VoxelType::I64 => out.iter_mut().zip(eights).for_each(|(o, b)| *o = stored(i64::from_le_bytes(*b) as f64)),
            VoxelType::F64 => out.iter_mut().zip(eights).for_each(|(o, b)| *o = stored(f64::from_le_bytes(*b))),
            VoxelType::U32 => out.iter_mut().zip(fours).for_each(|(o, b)| *o = stored(u32::from_le_bytes(*b).into())),
            VoxelType::I32 => out.iter_mut().zip(fours).for_each(|(o, b)| *o = stored(i32::from_le_bytes(*b).into())),
            _ => out.iter_mut().zip(fours).for_each(|(o, b)| *o = stored(f32::from_le_bytes(*b).into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapped(values: &[f32], range: Option<(f64, f64)>) -> (Quantiser, Vec<u16>) {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let scan = Scan::EMPTY.add(VoxelType::F32, &Fill::default(), &bytes);
        let quantiser = Quantiser::new(&scan, range).unwrap();
        let mut out = vec![0; values.len()];
        quantiser.map(VoxelType::F32, &Fill::default(), &bytes, &mut out);
        (quantiser, out)
    }

    #[test]
    fn nan_is_no_data_and_infinities_are_counted_and_take_the_ends() {
        let values = [f32::NAN, f32::NEG_INFINITY, -1.5, 2.25, f32::INFINITY];
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let scan = Scan::EMPTY.add(VoxelType::F32, &Fill::default(), &bytes);
        assert_eq!(scan.no_data, 1);
        assert_eq!(scan.not_finite, NotFinite { nan: 1, negative_infinity: 1, positive_infinity: 1 });
        assert_eq!(scan.bounds(), (-1.5, 2.25));
        let (quantiser, stored) = mapped(&values, None);
        assert_eq!(stored, [0, 1, 1, 65535, 65535]);
        assert!(!quantiser.lossless);
        assert_eq!(mapped(&[f32::NAN; 3], None).1, [0; 3]);
    }

    /// A fill value counts in no bound, and its stored number is no datum's.
    #[test]
    fn fill_values_are_stored_as_nothing_else_is() {
        let values = [-9999.0f32, 0.0, 3.0, -9999.0, f32::NAN];
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let fill = Fill::new(VoxelType::F32, &[-9999.0]);
        let scan = Scan::EMPTY.add(VoxelType::F32, &fill, &bytes);
        assert_eq!((scan.bounds(), scan.no_data, scan.not_finite.nan), ((0.0, 3.0), 3, 1));
        let quantiser = Quantiser::new(&scan, None).unwrap();
        let mut out = vec![9; values.len()];
        quantiser.map(VoxelType::F32, &fill, &bytes, &mut out);
        assert_eq!(out, [0, 1, 4, 0, 0]);
        assert_eq!((quantiser.scale, quantiser.offset, quantiser.lossless), (1.0, -1.0, true));
    }

    #[test]
    fn the_error_is_at_most_half_a_step() {
        let values: Vec<f32> = (0..1000).map(|i| (i as f32 * 0.37).sin() * 1e-3).collect();
        let (q, stored) = mapped(&values, None);
        for (v, s) in values.iter().zip(stored) {
            let back = q.scale * f64::from(s) + q.offset;
            assert!((back - f64::from(*v)).abs() <= q.scale * 0.500_001, "{v} came back as {back}");
        }
    }

    #[test]
    fn whole_numbers_that_fit_survive_exactly() {
        let (q, stored) = mapped(&[-1000.0, 0.0, 3000.0], None);
        assert_eq!((q.scale, q.offset, q.lossless), (1.0, -1000.0, true));
        assert_eq!(stored, [0, 1000, 4000]);
        // +Inf becomes the largest value that occurs, not the largest that 16 bits hold.
        assert_eq!(mapped(&[5.0, 7.0, f32::INFINITY], None).1, [0, 2, 2]);
    }

    #[test]
    fn a_given_range_keeps_precision_beside_outliers() {
        let (q, stored) = mapped(&[0.0, 0.5, 1.0, 1e30], Some((0.0, 1.0)));
        assert_eq!(q.scale, 1.0 / 65535.0);
        assert_eq!(stored, [0, 32768, 65535, 65535]);
        // A range that misses the data leaves the data's own bounds.
        assert_eq!(mapped(&[0.0, 0.5, 1.0], Some((5.0, 6.0))).1, [0, 32768, 65535]);
    }

    fn scanned(voxel_type: VoxelType, bytes: &[[u8; 8]]) -> (Scan, Result<Vec<u16>, StoreError>) {
        let fill = Fill::default();
        let scan = Scan::EMPTY.add(voxel_type, &fill, &bytes.concat());
        let stored = Quantiser::new(&scan, None).map(|q| {
            let mut out = vec![0; bytes.len()];
            q.map(voxel_type, &fill, &bytes.concat(), &mut out);
            out
        });
        (scan, stored)
    }

    #[test]
    fn extremes_of_64_bits_neither_overflow_nor_pass_for_exact() {
        let whole = [i64::MIN, -1, 0, i64::MAX].map(i64::to_le_bytes);
        let (scan, stored) = scanned(VoxelType::I64, &whole);
        assert_eq!((scan.bounds(), scan.rounded), ((-(2f64.powi(63)), 2f64.powi(63)), 1));
        assert_eq!(stored.unwrap(), [0, 32768, 32768, 65535]);
        let (scan, stored) = scanned(VoxelType::U64, &[0, u64::MAX].map(u64::to_le_bytes));
        assert_eq!((scan.rounded, stored.unwrap()), (1, vec![0, 65535]));
        // Neighbours beyond 2^53 fall together, and that is counted.
        let (scan, _) = scanned(VoxelType::I64, &[(1 << 53) + 1, 1 << 53].map(i64::to_le_bytes));
        assert_eq!(scan.rounded, 1);
        assert!(!Quantiser::new(&scan, None).unwrap().lossless);
        let (scan, stored) = scanned(VoxelType::I64, &[-70_000, -4_465].map(i64::to_le_bytes));
        assert_eq!((Quantiser::new(&scan, None).unwrap().lossless, stored.unwrap()), (true, vec![0, 65535]));
        // Too far apart, or too near: an error that names both ends.
        for ends in [[f64::MIN, f64::MAX], [0.0, 5e-324]] {
            assert!(matches!(scanned(VoxelType::F64, &ends.map(f64::to_le_bytes)).1, Err(StoreError::Range { .. })));
        }
        let (scan, stored) = scanned(VoxelType::F64, &[f64::NAN, 1e300, -1e300, 0.0].map(f64::to_le_bytes));
        // Code 0 is for what holds no data.
        assert_eq!((scan.not_finite.nan, stored.unwrap()), (1, vec![0, 65535, 1, 32768]));
    }
}

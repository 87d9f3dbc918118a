//! Voxels without data on their way into a store.

use super::fill::Fill;
use super::histogram::Histogram;
use super::quantise::Scan;
use crate::store::error::StoreError;
use crate::store::voxel::{StoredType, Voxel};

/// The stored numbers, as ordinals, of voxels without data; the first becomes that of all.
#[derive(Debug, Clone)]
pub(crate) struct Missing {
    ordinals: Vec<u16>,
    /// How many are NaN.
    nan: u64,
}

impl Missing {
    /// `scan` of sources that are mapped to 16 bits.
    pub(crate) fn new(fill: &Fill, stored_type: StoredType, scan: Option<&Scan>) -> Self {
        match scan {
            None => Self { ordinals: fill.ordinals(stored_type), nan: 0 },
            Some(scan) if scan.no_data > 0 => Self { ordinals: vec![0], nan: scan.not_finite.nan },
            Some(_) => Self { ordinals: Vec::new(), nan: 0 },
        }
    }

    pub(crate) fn ordinal(&self) -> Option<u16> {
        self.ordinals.first().copied()
    }

    /// Those of a coarser level, which has only the one number for all.
    pub(crate) fn on_level(&self) -> Self {
        Self { ordinals: self.ordinal().into_iter().collect(), nan: 0 }
    }

    /// Gives all of `voxels` that lack data the same number.
    pub(crate) fn make_one<T: Voxel>(&self, voxels: &mut [T]) {
        if let [first, others @ ..] = &self.ordinals[..]
            && !others.is_empty()
        {
            let first = T::at(*first);
            voxels.iter_mut().filter(|v| others.contains(&v.ordinal())).for_each(|v| *v = first);
        }
    }

    /// Takes them out of the histogram of all voxels; how many they are.
    pub(crate) fn leave_out(&self, histogram: &mut Histogram) -> Result<u64, StoreError> {
        let (voxels, nan) = (self.ordinal().map_or(0, |ordinal| histogram.leave_out(ordinal)), self.nan);
        if histogram.total() == 0 {
            return Err(StoreError::NothingHoldsData { voxels, nan, fill: voxels.saturating_sub(nan) });
        }
        Ok(voxels)
    }
}

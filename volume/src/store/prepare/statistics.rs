//! What is counted of all voxels of a volume.

use super::histogram::Histogram;
use super::noise::NoiseHistogram;
use crate::store::voxel::{StoredType, Voxel};

pub(crate) struct Statistics {
    pub(crate) histogram: Histogram,
    pub(crate) noise: NoiseHistogram,
}

impl Statistics {
    pub(crate) fn new(stored_type: StoredType) -> Self {
        Self { histogram: Histogram::new(), noise: NoiseHistogram::new(stored_type) }
    }

    /// Counts whole planes of `nx * ny` voxels, the first of which has an even z. Noise leaves out what stands for no
    /// data.
    pub(crate) fn add<T: Voxel>(&mut self, plane: [usize; 2], voxels: &[T], no_data: Option<u16>) {
        self.histogram.add(voxels);
        match no_data {
            Some(no_data) => self.noise.add(plane, voxels, |v| v.ordinal() != no_data),
            None => self.noise.add(plane, voxels, |_| true),
        }
    }
}

//! What is counted of all voxels of a volume.

use super::histogram::Histogram;
use super::noise::NoiseHistogram;
use super::voxel::{StoredType, Voxel};

pub(super) struct Statistics {
    pub(super) histogram: Histogram,
    pub(super) noise: NoiseHistogram,
}

impl Statistics {
    pub(super) fn new(stored_type: StoredType) -> Self {
        Self { histogram: Histogram::new(), noise: NoiseHistogram::new(stored_type) }
    }

    /// Counts whole planes of `nx * ny` voxels, the first of which has an even z.
    pub(super) fn add<T: Voxel>(&mut self, plane: [usize; 2], voxels: &[T]) {
        self.histogram.add(voxels);
        self.noise.add(plane, voxels, |_| true);
    }
}

//! What is counted of all voxels of a volume.

use super::histogram::Histogram;
use super::noise::NoiseHistogram;
use crate::store::voxel::{StoredType, Voxel};

pub(crate) struct Statistics {
    pub(crate) histogram: Histogram,
    /// Nothing on coarser levels, which have the noise of the finest.
    pub(crate) noise: Option<NoiseHistogram>,
}

impl Statistics {
    pub(crate) fn new(stored_type: StoredType) -> Self {
        Self { histogram: Histogram::new(), noise: Some(NoiseHistogram::new(stored_type)) }
    }

    pub(crate) fn of_coarser_level() -> Self {
        Self { histogram: Histogram::new(), noise: None }
    }

    /// Counts whole planes of `nx * ny` voxels, the first of which has an even z. Noise leaves out what stands for no
    /// data.
    pub(crate) fn add<T: Voxel>(&mut self, plane: [usize; 2], voxels: &[T], no_data: Option<u16>) {
        self.histogram.add(voxels);
        match (&mut self.noise, no_data) {
            (Some(noise), Some(no_data)) => noise.add(plane, voxels, |v| v.ordinal() != no_data),
            (Some(noise), None) => noise.add(plane, voxels, |_| true),
            (None, _) => {}
        }
    }
}

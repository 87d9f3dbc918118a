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

    /// All counts, u64 little endian.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        self.counts().flat_map(|count| count.to_le_bytes()).collect()
    }

    /// Adds what was counted elsewhere, which are as many bytes as is returned.
    pub(crate) fn join(&mut self, bytes: &[u8]) -> usize {
        let noise = self.noise.iter_mut().flat_map(NoiseHistogram::counts_mut);
        let counts = self.histogram.counts_mut().iter_mut().chain(noise);
        counts.zip(bytes.as_chunks::<8>().0).for_each(|(sum, count)| *sum += u64::from_le_bytes(*count));
        self.counts().count() * size_of::<u64>()
    }

    fn counts(&self) -> impl Iterator<Item = u64> {
        self.histogram.counts().iter().chain(self.noise.iter().flat_map(NoiseHistogram::counts)).copied()
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

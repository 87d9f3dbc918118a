//! Regions that somebody else found: a label volume taken as it is, 0 for no region.

use std::collections::HashMap;

use rayon::prelude::*;

use super::block::{Part, Slab};

/// Voxels whose labels are told apart at once by a thread: the most that a map of its own can hold, unless a row is
/// longer.
const PIECE_VOXELS: usize = 1 << 16;

/// More labels than were allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TooManyParts;

/// Statistics of every label met so far, but for 0.
#[derive(Debug)]
pub(crate) struct GivenParts {
    parts: HashMap<u32, Part>,
    max: usize,
}

impl GivenParts {
    /// For at most `max` labels.
    pub(crate) fn new(max: usize) -> Self {
        Self { parts: HashMap::new(), max }
    }

    /// Takes in a slab of whole planes and its labels. Where every voxel has a label of its own, no more is held than
    /// the labels that are allowed and a piece of rows for each thread.
    ///
    /// # Errors
    /// More labels than are allowed, as soon as a batch of pieces shows it.
    pub(crate) fn add(&mut self, slab: &Slab<'_>, labels: &[u32]) -> Result<(), TooManyParts> {
        let [nx, ny, _] = slab.dims;
        let piece = nx * (PIECE_VOXELS / nx).max(1);
        let batch = piece * rayon::current_num_threads();
        for (i, batch_labels) in labels.chunks(batch).enumerate() {
            let pieces = batch_labels.par_chunks(piece).enumerate().map(|(j, labels)| {
                let mut parts: HashMap<u32, Part> = HashMap::new();
                let mut start = i * batch + j * piece;
                // Runs may cross rows: statistics do not mind.
                for run in labels.chunk_by(|a, b| a == b) {
                    let voxels = start..start + run.len();
                    start = voxels.end;
                    if run[0] != 0 {
                        let root = (slab.z0 * ny * nx + voxels.start) as u64;
                        let part = parts.entry(run[0]).or_insert(Part::EMPTY);
                        part.add(root, &slab.codes[voxels.clone()], &slab.distances[voxels]);
                    }
                }
                parts
            });
            for (label, part) in pieces.collect::<Vec<_>>().into_iter().flatten() {
                self.parts.entry(label).or_insert(Part::EMPTY).merge(&part);
            }
            if self.parts.len() > self.max {
                return Err(TooManyParts);
            }
        }
        Ok(())
    }

    /// Labels with a leap voxel and at least `min_region` voxels, by value, and what is known of each.
    pub(crate) fn finish(self, min_region: u64) -> (Vec<u32>, Vec<Part>) {
        let mut kept: Vec<_> = self.parts.into_iter().filter(|(_, p)| p.leaps > 0 && p.voxels >= min_region).collect();
        kept.sort_unstable_by_key(|(_, part)| part.root);
        kept.into_iter().unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every voxel a label of its own: the slab is given up after its first pieces, not when all of it is in memory.
    #[test]
    fn a_slab_of_nothing_but_labels_ends_soon_after_the_limit() {
        let dims = [256, 256, 32];
        let voxels: usize = dims.iter().product();
        let (codes, distances) = (vec![7; voxels], vec![1; voxels]);
        let labels: Vec<u32> = (1..).take(voxels).collect();
        let slab = Slab { dims, z0: 0, codes: &codes, distances: &distances };
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let mut parts = GivenParts::new(1000);
        assert_eq!(one_thread.install(|| parts.add(&slab, &labels)), Err(TooManyParts));
        assert_eq!(parts.parts.len(), PIECE_VOXELS);
        let mut parts = GivenParts::new(voxels);
        assert_eq!(parts.add(&slab, &labels), Ok(()));
    }

    /// Rows that do not divide a piece, and more than one batch: each voxel is counted once, roots are global.
    #[test]
    fn pieces_and_batches_count_every_voxel_once() {
        let dims = [301, 67, 32];
        let voxels: usize = dims.iter().product();
        let codes: Vec<u16> = (0..voxels).map(|i| (i * 31 % 65_536) as u16).collect();
        let distances: Vec<u8> = (0..voxels).map(|i| (i % 5) as u8).collect();
        let labels: Vec<u32> = (0..voxels as u32).map(|i| i / 700 % 5).collect();
        let slab = Slab { dims, z0: 32, codes: &codes, distances: &distances };
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut parts = GivenParts::new(4);
            assert_eq!(pool.install(|| parts.add(&slab, &labels)), Ok(()));
            for label in 1..5 {
                let mut want = Part::EMPTY;
                for i in (0..voxels).filter(|i| labels[*i] == label) {
                    let root = (32 * 301 * 67 + i) as u64;
                    want.add(root, &codes[i..=i], &distances[i..=i]);
                }
                assert_eq!(parts.parts[&label], want);
            }
        }
    }
}

//! Regions that somebody else found: a label volume taken as it is, 0 for no region.

use std::collections::HashMap;

use rayon::prelude::*;

use super::block::{CodeTables, Part, Slab};

/// Statistics of every label met so far, but for 0.
#[derive(Debug, Default)]
pub(crate) struct GivenParts(pub(crate) HashMap<u32, Part>);

impl GivenParts {
    /// Takes in a slab of whole planes and its labels.
    pub(crate) fn add(&mut self, slab: &Slab<'_>, labels: &[u32], tables: &CodeTables) {
        let [nx, ny, _] = slab.dims;
        let found = labels.par_chunks(nx * ny).enumerate().map(|(plane, labels)| {
            let mut parts: HashMap<u32, Part> = HashMap::new();
            for (y, row) in labels.chunks_exact(nx).enumerate() {
                let mut start = (plane * ny + y) * nx;
                for run in row.chunk_by(|a, b| a == b) {
                    let voxels = start..start + run.len();
                    start = voxels.end;
                    if run[0] != 0 {
                        let root = (slab.z0 * ny * nx + voxels.start) as u64;
                        let part = parts.entry(run[0]).or_insert(Part::EMPTY);
                        part.add(root, &slab.codes[voxels.clone()], &slab.distances[voxels], &tables.density);
                    }
                }
            }
            parts
        });
        for parts in found.collect::<Vec<_>>() {
            for (label, part) in parts {
                self.0.entry(label).or_insert(Part::EMPTY).merge(&part);
            }
        }
    }

    /// Labels with a leap voxel and at least `min_region` voxels, by value, and what is known of each.
    pub(crate) fn finish(self, min_region: u64) -> (Vec<u32>, Vec<Part>) {
        let mut kept: Vec<_> = self.0.into_iter().filter(|(_, p)| p.leaps > 0 && p.voxels >= min_region).collect();
        kept.sort_unstable_by_key(|(_, part)| part.root);
        kept.into_iter().unzip()
    }
}

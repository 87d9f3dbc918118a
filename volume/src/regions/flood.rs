//! The seeded flood fill of Frey & Ertl (2009), for comparison: regions grow from seeds in raster order as long as
//! their values' range allows. What belongs to a region depends on the order, and the whole volume must be in memory.

use std::collections::{TryReserveError, VecDeque};

use super::code::Density;

/// The most voxels that a flood fill takes. It holds 6 bytes a voxel (density and label), and 4 for each voxel in the
/// queue: a region's growing front, usually a surface, at the very worst as many as there are voxels (twice that while
/// it grows).
pub const MAX_FLOOD_VOXELS: u64 = 1 << 30;

/// Labels 1, 2, ... in the order of seeds; 0 for regions too small to hold a leap voxel. `width` is the largest
/// difference between two voxels of a region. Labels and voxel numbers above `u32::MAX` cannot come about below
/// [`MAX_FLOOD_VOXELS`].
///
/// # Errors
/// Memory that the system does not give.
pub(crate) fn flood(densities: &[Density], dims: [usize; 3], width: Density) -> Result<Vec<u32>, TryReserveError> {
    const UNSEEN: u32 = u32::MAX;
    let mut labels = Vec::new();
    labels.try_reserve_exact(densities.len())?;
    labels.resize(densities.len(), UNSEEN);
    // A leap voxel needs all of a cube of five, or the three layers that a corner of the volume leaves of it.
    let smallest: usize = dims.iter().map(|n| (*n).min(3)).product();
    let strides = [1, dims[0], dims[0] * dims[1]];
    let (mut next, mut queue, mut region) = (1, VecDeque::new(), Vec::new());
    for seed in 0..densities.len() {
        if labels[seed] != UNSEEN {
            continue;
        }
        let (mut min, mut max) = (densities[seed], densities[seed]);
        labels[seed] = next;
        region.clear();
        queue.push_back(seed as u32);
        while let Some(voxel) = queue.pop_front() {
            let voxel = voxel as usize;
            queue.try_reserve(6)?;
            // Only small regions are taken back, so no more need be remembered.
            if region.len() < smallest {
                region.push(voxel);
            }
            for (stride, n) in strides.into_iter().zip(dims) {
                let at = voxel / stride % n;
                let low = (at > 0).then(|| voxel - stride);
                let high = (at + 1 < n).then(|| voxel + stride);
                for neighbour in [low, high].into_iter().flatten() {
                    let value = densities[neighbour];
                    let (lo, hi) = (min.min(value), max.max(value));
                    if labels[neighbour] == UNSEEN && hi - lo <= width {
                        (min, max) = (lo, hi);
                        labels[neighbour] = next;
                        queue.push_back(neighbour as u32);
                    }
                }
            }
        }
        if region.len() < smallest {
            region.iter().for_each(|voxel| labels[*voxel] = 0);
        } else {
            next += 1;
        }
    }
    Ok(labels)
}

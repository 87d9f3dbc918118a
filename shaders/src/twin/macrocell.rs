//! `wgsl/macrocell.wgsl` and `wgsl/distance.wgsl` on the CPU: which macrocells are empty, and how far the next is that
//! is not.

use brickcast_volume::macrocell::MAX_CELL_DISTANCE;

/// Is a cell of this range empty? `counts` are [`brickcast_volume::transfer_function::TransferTable::opaque_counts`].
/// Where `min` is above `max` nothing holds data.
#[must_use]
pub fn is_empty(counts: &[[u32; 2]], [min, max]: [u16; 2]) -> bool {
    min > max || counts[usize::from(max)][1] == counts[usize::from(min)][0]
}

/// Cells from each cell to the nearest that is not empty (Chebyshev, 0 for itself), at most 255. Cells outside count as
/// empty. x fastest.
#[must_use]
pub fn empty_distances(counts: &[[u32; 2]], ranges: &[[u16; 2]], dims: [u32; 3]) -> Vec<u8> {
    let mut distances: Vec<u8> =
        ranges.iter().map(|&range| if is_empty(counts, range) { MAX_CELL_DISTANCE as u8 } else { 0 }).collect();
    for axis in 0..3 {
        distances = nearer_along(&distances, dims, axis);
    }
    distances
}

/// One pass of the distance transform: along one axis the smallest of what lies there, no less than how far it lies.
fn nearer_along(distances: &[u8], dims: [u32; 3], axis: usize) -> Vec<u8> {
    let strides = [1, dims[0] as usize, dims[0] as usize * dims[1] as usize];
    let (stride, count) = (strides[axis], dims[axis] as usize);
    (0..distances.len())
        .map(|i| {
            let at = i / stride % count;
            let mut best = distances[i];
            let mut away = 1;
            while away < usize::from(best) {
                if away <= at {
                    best = best.min(distances[i - away * stride].max(away as u8));
                }
                if at + away < count {
                    best = best.min(distances[i + away * stride].max(away as u8));
                }
                away += 1;
            }
            best
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against every pair of cells.
    #[test]
    fn distances_are_those_of_the_nearest_cell() {
        let counts: Vec<[u32; 2]> =
            (0..=u16::MAX).map(|code| [u32::from(code > 100), u32::from(code >= 100)]).collect();
        for (dims, sparse) in [([7, 5, 6], 3), ([7, 5, 6], 40), ([16, 1, 9], 20), ([1, 1, 1], 2), ([4, 4, 4], 1000)] {
            let [nx, ny, nz] = dims;
            let count = nx * ny * nz;
            let at = |i: u32| [i % nx, i / nx % ny, i / nx / ny];
            let ranges: Vec<[u16; 2]> =
                (0..count).map(|i| if (i * 7919 + 13) % sparse == 1 { [50, 100] } else { [3, 99] }).collect();
            let got = empty_distances(&counts, &ranges, dims);
            for i in 0..count {
                let away = |j: u32| (0..3).map(|a| at(i)[a].abs_diff(at(j)[a])).max().unwrap_or(0);
                let want = (0..count).filter(|&j| ranges[j as usize][1] >= 100).map(away).min().unwrap_or(255);
                assert_eq!(u32::from(got[i as usize]), want, "cell {i} of {dims:?}, one in {sparse}");
            }
        }
    }
}

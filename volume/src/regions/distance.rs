//! Chebyshev distances to the nearest voxel of another label, exact, in one sweep forward and one backward.
//!
//! A voxel is *flat* where its 26 neighbours have its label, else a *border*.
//! `D = 1 + (distance to the nearest border)`: on the way to the nearest voxel of another label, the last voxel of the
//! own label is a border, and a nearer border would mean a nearer voxel of another label. So labels are compared once,
//! for borders, and the sweeps are those of an ordinary distance transform (Rosenfeld & Pfaltz 1966), whose minima over
//! 3 x 3 neighbours separate by axis. Beyond the volume's edge voxels have the label of the nearest one inside, which
//! never makes a border.

use rayon::prelude::*;

use super::code::MAX_DISTANCE;

/// What lies beyond the volume's edge: nothing near.
const FAR: u8 = MAX_DISTANCE;

/// The forward sweep: planes of labels in, upper bounds of the distances out, one plane later.
#[derive(Debug)]
pub(crate) struct ForwardSweep<L> {
    width: usize,
    /// The last plane: labels, and 1 where all nine voxels about one in the plane have one label.
    last: Option<(Vec<L>, Vec<u8>)>,
    /// 1 where a voxel of the last plane and those of the plane before about it all have one label.
    towards_before: Option<Vec<u8>>,
    /// Bounds of the plane that came out last.
    bounds: Vec<u8>,
}

impl<L: Copy + Eq + Send + Sync> ForwardSweep<L> {
    /// Planes of rows of `width` voxels, x fastest.
    pub(crate) fn new(width: usize) -> Self {
        Self { width, last: None, towards_before: None, bounds: Vec::new() }
    }

    /// Takes the next plane's labels; the bounds that follow are those of the plane before, if there is one.
    pub(crate) fn push(&mut self, labels: Vec<L>) -> Option<&[u8]> {
        let flat = flat_in_plane(&labels, self.width);
        let (last, last_flat) = self.last.replace((labels, flat))?;
        let (labels, flat) = self.last.as_ref().map(|(l, f)| (l, f))?;
        let mut pair = vec![0; last.len()];
        let rows = last.par_chunks(self.width).zip(labels.par_chunks(self.width));
        let flats = last_flat.par_chunks(self.width).zip(flat.par_chunks(self.width));
        pair.par_chunks_mut(self.width).zip(rows).zip(flats).for_each(|((out, (a, b)), (fa, fb))| {
            let labels = a.iter().zip(b).map(|(a, b)| u8::from(a == b));
            out.iter_mut().zip(labels).zip(fa.iter().zip(fb)).for_each(|((o, same), (a, b))| *o = same & a & b);
        });
        let mut done = pair.clone();
        if let Some(before) = self.towards_before.replace(pair) {
            done.iter_mut().zip(before).for_each(|(d, b)| *d &= b);
        }
        self.sweep(&done);
        Some(&self.bounds)
    }

    /// The bounds of the last plane.
    pub(crate) fn finish(&mut self) -> Option<&[u8]> {
        let (_, flat) = self.last.take()?;
        let flat = self.towards_before.take().unwrap_or(flat);
        self.sweep(&flat);
        Some(&self.bounds)
    }

    fn sweep(&mut self, flat: &[u8]) {
        let above = nearest_of_nine(&self.bounds, self.width, flat.len());
        self.bounds.resize(flat.len(), FAR);
        let mut around = vec![FAR; self.width];
        for (y, flat) in flat.chunks_exact(self.width).enumerate() {
            around.copy_from_slice(&above[y * self.width..][..self.width]);
            if y > 0 {
                lower_to_min3(&self.bounds[(y - 1) * self.width..][..self.width], &mut around);
            }
            let mut before = FAR;
            let out = &mut self.bounds[y * self.width..][..self.width];
            for ((out, near), flat) in out.iter_mut().zip(&around).zip(flat) {
                let further = (*near).min(before).saturating_add(1);
                before = if *flat == 1 { further } else { 1 };
                *out = before;
            }
        }
    }
}

/// The backward sweep: bounds in, planes from the last to the first, distances out.
#[derive(Debug)]
pub(crate) struct BackwardSweep {
    width: usize,
    /// Distances of the plane before (the one of higher z).
    distances: Vec<u8>,
}

impl BackwardSweep {
    pub(crate) fn new(width: usize) -> Self {
        Self { width, distances: Vec::new() }
    }

    /// Turns the bounds of the next lower plane into distances.
    pub(crate) fn push(&mut self, plane: &mut [u8]) {
        let below = nearest_of_nine(&self.distances, self.width, plane.len());
        let mut around = vec![FAR; self.width];
        let rows = plane.len() / self.width;
        for y in (0..rows).rev() {
            around.copy_from_slice(&below[y * self.width..][..self.width]);
            let (rows_to_here, behind) = plane.split_at_mut((y + 1) * self.width);
            if let Some(next) = behind.get(..self.width) {
                lower_to_min3(next, &mut around);
            }
            let mut before = FAR;
            for (out, near) in rows_to_here[y * self.width..].iter_mut().zip(&around).rev() {
                before = (*near).min(before).saturating_add(1).min(*out);
                *out = before;
            }
        }
        self.distances.clear();
        self.distances.extend_from_slice(plane);
    }
}

/// 1 where all nine voxels about one within its plane have one label.
fn flat_in_plane<L: Copy + Eq + Send + Sync>(labels: &[L], width: usize) -> Vec<u8> {
    let mut along_x = vec![1; labels.len()];
    along_x.par_chunks_mut(width).zip(labels.par_chunks(width)).for_each(|(out, row)| {
        let pairs = row.iter().zip(&row[1..]).map(|(a, b)| u8::from(a == b));
        out.iter_mut().zip(pairs.clone()).for_each(|(o, same)| *o = same);
        out[1..].iter_mut().zip(pairs).for_each(|(o, same)| *o &= same);
    });
    let mut flat = along_x.clone();
    let rows = labels.len() / width;
    flat.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let row = |y: usize| y * width..(y + 1) * width;
        for other in [y.wrapping_sub(1), y + 1].into_iter().filter(|other| *other < rows) {
            let same = labels[row(y)].iter().zip(&labels[row(other)]).map(|(a, b)| u8::from(a == b));
            out.iter_mut().zip(same).zip(&along_x[row(other)]).for_each(|((o, same), flat)| *o &= same & flat);
        }
    });
    flat
}

/// Lowers each of `out` to the least of the three of `row` about it.
fn lower_to_min3(row: &[u8], out: &mut [u8]) {
    out.iter_mut().zip(row).for_each(|(o, v)| *o = (*o).min(*v));
    out[1..].iter_mut().zip(row).for_each(|(o, v)| *o = (*o).min(*v));
    out.iter_mut().zip(&row[1..]).for_each(|(o, v)| *o = (*o).min(*v));
}

/// The least of the nine of a neighbouring plane about each voxel; far everywhere where there is no such plane.
fn nearest_of_nine(plane: &[u8], width: usize, voxels: usize) -> Vec<u8> {
    let mut out = vec![FAR; voxels];
    if plane.is_empty() {
        return out;
    }
    let rows = voxels / width;
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for y in y.saturating_sub(1)..(y + 2).min(rows) {
            lower_to_min3(&plane[y * width..][..width], out);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn swept(labels: &[u16], [nx, ny, nz]: [usize; 3]) -> Vec<u8> {
        let mut forward = ForwardSweep::new(nx);
        let mut bounds = Vec::new();
        for plane in labels.chunks(nx * ny) {
            bounds.extend_from_slice(forward.push(plane.to_vec()).unwrap_or_default());
        }
        bounds.extend_from_slice(forward.finish().unwrap());
        assert_eq!(bounds.len(), nx * ny * nz);
        let mut backward = BackwardSweep::new(nx);
        bounds.chunks_mut(nx * ny).rev().for_each(|plane| backward.push(plane));
        bounds
    }

    fn brute_force(labels: &[u16], [nx, ny, nz]: [usize; 3]) -> Vec<u8> {
        let at = |i: usize| [i % nx, i / nx % ny, i / nx / ny];
        let distance = |i: usize| {
            let others = (0..nx * ny * nz).filter(|j| labels[*j] != labels[i]);
            let d = others.map(|j| (0..3).map(|a| at(i)[a].abs_diff(at(j)[a])).max().unwrap_or(0)).min();
            d.unwrap_or(usize::MAX).min(255) as u8
        };
        (0..labels.len()).map(distance).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

        /// Few labels and few odd voxels, so that distances grow; planes, rows and columns one voxel thin.
        #[test]
        fn distances_are_those_of_the_definition(
            dims in prop_oneof![
                [1..12usize, 1..12usize, 1..12usize],
                [1..3usize, 1..20usize, 1..20usize],
                [1..40usize, 1..3usize, 1..3usize],
            ],
            odd in prop::collection::vec((any::<usize>(), 0..3u16), 0..12),
            split in 0..20usize,
        ) {
            let voxels = dims.iter().product::<usize>();
            let mut labels: Vec<u16> = (0..voxels).map(|i| u16::from(i % dims[0] >= split)).collect();
            odd.into_iter().for_each(|(i, label)| labels[i % voxels] = label);
            prop_assert_eq!(swept(&labels, dims), brute_force(&labels, dims));
        }
    }

    #[test]
    fn distances_stop_at_255_and_need_a_border_to_be_less() {
        assert!(swept(&[7; 3 * 4 * 5], [3, 4, 5]).iter().all(|d| *d == 255));
        let mut labels = vec![0; 600];
        labels[0] = 1;
        let swept = swept(&labels, [600, 1, 1]);
        let want = (0..600usize).map(|i| i.clamp(1, 255) as u8);
        assert!(swept.into_iter().eq(want));
    }
}

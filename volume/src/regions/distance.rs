//! Chebyshev distances to the nearest voxel of another label, exact.
//!
//! A voxel is *flat* where its 26 neighbours have its label, else a *border*.
//! `D = 1 + (distance to the nearest border)`: on the way to the nearest voxel of another label, the last voxel of the
//! own label is a border, and a nearer border would mean a nearer voxel of another label. So labels are compared once,
//! for borders. Beyond the volume's edge voxels have the label of the nearest one inside, which never makes a border.
//!
//! A way of d steps to a border goes along its longest axis in each of them, so it can be ordered: first steps that
//! change z, then those of the rest that change y, then those that change x alone. So D is what is left when planes are
//! swept along z in both directions ([`PlaneSweep`]), then each plane along y and each row along x ([`spread`]). No
//! voxel waits for its neighbour in a row: 16 of them and more are taken at once, whatever the processor.

use rayon::prelude::*;

use super::code::MAX_DISTANCE;

/// What lies beyond the volume's edge: nothing near. Also the mask of flat voxels; 0 is that of borders.
const FAR: u8 = MAX_DISTANCE;
/// Rows that are not worth another thread.
const ROWS: usize = 16;

/// Where voxels are flat: planes of labels in, masks out, one plane later. Planes come in order or in reverse.
#[derive(Debug)]
pub(crate) struct FlatPlanes<L> {
    width: usize,
    /// The last plane: labels, and the mask of voxels with one label in all nine about them in the plane. Empty before
    /// the first.
    labels: Vec<L>,
    in_plane: Vec<u8>,
    /// The mask of voxels of the last plane that have one label with those of the plane before about them.
    towards_before: Vec<u8>,
    /// Work space, and what came out last.
    along_x: Vec<u8>,
    of_new: Vec<u8>,
    flat: Vec<u8>,
}

impl<L: Copy + Eq + Send + Sync> FlatPlanes<L> {
    /// Planes of rows of `width` voxels, x fastest.
    pub(crate) fn new(width: usize) -> Self {
        let none = Vec::new;
        let (in_plane, towards_before, along_x, of_new, flat) = (none(), none(), none(), none(), none());
        Self { width, labels: Vec::new(), in_plane, towards_before, along_x, of_new, flat }
    }

    /// Takes the next plane's labels; the mask that follows is that of the plane before, if there is one.
    pub(crate) fn push(&mut self, labels: &[L]) -> Option<&[u8]> {
        let Self { width, labels: last, in_plane, towards_before, along_x, of_new, flat } = self;
        [&mut *along_x, of_new, flat].into_iter().for_each(|plane| plane.resize(labels.len(), 0));
        flat_in_plane(labels, *width, along_x, of_new);
        let has_last = !last.is_empty();
        if has_last {
            let rows = last.par_chunks(*width).zip(labels.par_chunks(*width));
            let masks = in_plane.par_chunks(*width).zip(of_new.par_chunks(*width));
            let out = flat.par_chunks_mut(*width).zip(towards_before.par_chunks_mut(*width));
            out.zip(rows.zip(masks)).with_min_len(ROWS).for_each(|((out, before), ((a, b), (ma, mb)))| {
                // As long as the others, for all that the compiler knows.
                let n = out.len();
                let (before, a, b, ma, mb) = (&mut before[..n], &a[..n], &b[..n], &ma[..n], &mb[..n]);
                for i in 0..n {
                    let pair = same(a[i], b[i]) & ma[i] & mb[i];
                    out[i] = before[i] & pair;
                    before[i] = pair;
                }
            });
        } else {
            towards_before.resize(labels.len(), FAR);
        }
        last.clear();
        last.extend_from_slice(labels);
        std::mem::swap(in_plane, of_new);
        has_last.then_some(flat)
    }

    /// The mask of the last plane.
    pub(crate) fn finish(&mut self) -> Option<&[u8]> {
        let Self { in_plane, towards_before, .. } = self;
        in_plane.iter_mut().zip(towards_before).for_each(|(mask, before)| *mask &= *before);
        (!self.labels.is_empty()).then_some(&self.in_plane)
    }
}

/// Where voxels are at least 3 from another label, as far as leaping goes (`LEAP_DISTANCE`): those with nothing but
/// flat voxels about them. Masks of flat voxels in, masks out, one plane later.
#[derive(Debug)]
pub(crate) struct LeapPlanes {
    width: usize,
    /// The last plane's nines, and those of the plane before; empty before there are any.
    last: Vec<u8>,
    before: Vec<u8>,
    of_new: Vec<u8>,
    leaps: Vec<u8>,
}

impl LeapPlanes {
    pub(crate) fn new(width: usize) -> Self {
        Self { width, last: Vec::new(), before: Vec::new(), of_new: Vec::new(), leaps: Vec::new() }
    }

    /// Takes the next plane; the mask that follows is that of the plane before, if there is one.
    pub(crate) fn push(&mut self, flat: &[u8]) -> Option<&[u8]> {
        let Self { width, last, before, of_new, leaps } = self;
        of_new.clear();
        of_new.resize(flat.len(), FAR);
        each_row_with_nine(of_new, flat, *width, |row, column| {
            row.iter_mut().zip(threes(column)).for_each(|(out, least)| *out = least);
        });
        if last.is_empty() {
            before.resize(flat.len(), FAR);
        } else {
            leaps.resize(flat.len(), 0);
            let all = before.iter().zip(&*last).zip(&*of_new);
            leaps.iter_mut().zip(all).for_each(|(out, ((a, b), c))| *out = a & b & c);
            std::mem::swap(before, last);
        }
        let has_last = !last.is_empty();
        std::mem::swap(last, of_new);
        has_last.then_some(leaps)
    }

    /// The mask of the last plane.
    pub(crate) fn finish(&mut self) -> Option<&[u8]> {
        self.last.iter_mut().zip(&self.before).for_each(|(mask, before)| *mask &= *before);
        (!self.last.is_empty()).then_some(&self.last)
    }
}

/// What planes know of borders in those before them. Two sweeps, one in each direction of z, and [`spread`] leave
/// distances.
#[derive(Debug)]
pub(crate) struct PlaneSweep {
    width: usize,
    /// Bounds of the plane before; empty before the first.
    before: Vec<u8>,
}

impl PlaneSweep {
    pub(crate) fn new(width: usize) -> Self {
        Self { width, before: Vec::new() }
    }

    /// Voxels of a row.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// Starts over at the first plane.
    pub(crate) fn start_over(&mut self) {
        self.before.clear();
    }

    /// As [`PlaneSweep::push`] of a mask of flat voxels: the first of the two sweeps.
    pub(crate) fn push_flat(&mut self, flat: &[u8], bounds: &mut Vec<u8>) {
        bounds.clear();
        bounds.extend(flat.iter().map(|mask| mask | 1));
        self.push(bounds);
    }

    /// Lowers the next plane's bounds by those of the plane before.
    pub(crate) fn push(&mut self, plane: &mut [u8]) {
        if !self.before.is_empty() {
            each_row_with_nine(plane, &self.before, self.width, |row, column| lower(row, threes(column)));
        }
        self.before.clear();
        self.before.extend_from_slice(plane);
    }
}

/// Takes a plane that was swept along z in both directions to its distances.
pub(crate) fn spread(plane: &mut [u8], width: usize) {
    let rows = plane.len() / width;
    let (mut about, mut along) = (vec![FAR; width + 2], vec![FAR; width + 2 * FURTHEST]);
    let mut lower_by = |row: &mut [u8], other: &[u8]| {
        about[1..=width].copy_from_slice(other);
        lower(row, threes(&about));
    };
    for y in 1..rows {
        let (done, rest) = plane.split_at_mut(y * width);
        lower_by(&mut rest[..width], &done[(y - 1) * width..]);
    }
    for y in (0..rows).rev() {
        let (rest, done) = plane.split_at_mut((y + 1) * width);
        let row = &mut rest[y * width..];
        if let Some(next) = done.get(..width) {
            lower_by(row, next);
        }
        spread_along(row, &mut along);
    }
}

/// The longest step along a row, half of the way to what is far.
const FURTHEST: usize = 128;

/// Lowers each voxel of a row to the least of what the others are, and how far: over ways of 1, then up to 3, then up
/// to 7, and so on, until no longer one changes anything. `padded` is the row with `FURTHEST` voxels more on each side,
/// which are far.
fn spread_along(row: &mut [u8], padded: &mut [u8]) {
    let width = row.len();
    let mut step = 1;
    while step <= FURTHEST {
        padded[FURTHEST..][..width].copy_from_slice(row);
        let (left, right) = (&padded[FURTHEST - step..][..width], &padded[FURTHEST + step..][..width]);
        let mut changed = 0;
        for ((out, left), right) in row.iter_mut().zip(left).zip(right) {
            let lowered = (*left).min(*right).saturating_add(step as u8).min(*out);
            changed |= *out ^ lowered;
            *out = lowered;
        }
        if changed == 0 {
            return;
        }
        step *= 2;
    }
}

/// The mask of voxels with one label in all nine about them within a plane.
fn flat_in_plane<L: Copy + Eq + Send + Sync>(labels: &[L], width: usize, along_x: &mut [u8], flat: &mut [u8]) {
    along_x.par_chunks_mut(width).zip(labels.par_chunks(width)).with_min_len(ROWS).for_each(|(out, row)| {
        out[0] = FAR;
        let pairs = || row.iter().zip(&row[1..]).map(|(a, b)| same(*a, *b));
        out[1..].iter_mut().zip(pairs()).for_each(|(o, same)| *o = same);
        out.iter_mut().zip(pairs()).for_each(|(o, same)| *o &= same);
    });
    let (along_x, rows) = (&*along_x, labels.len() / width);
    flat.par_chunks_mut(width).enumerate().with_min_len(ROWS).for_each(|(y, out)| {
        let row = |y: usize| y * width..(y + 1) * width;
        out.copy_from_slice(&along_x[row(y)]);
        for other in [y.wrapping_sub(1), y + 1].into_iter().filter(|other| *other < rows) {
            let same = labels[row(y)].iter().zip(&labels[row(other)]).map(|(a, b)| same(*a, *b));
            out.iter_mut().zip(same).zip(&along_x[row(other)]).for_each(|((o, same), flat)| *o &= same & flat);
        }
    });
}

#[inline(always)]
fn same<L: Eq>(a: L, b: L) -> u8 {
    if a == b { FAR } else { 0 }
}

/// Lowers voxels to one more than the least of those about them in another row or plane.
#[inline(always)]
fn lower(row: &mut [u8], least: impl Iterator<Item = u8>) {
    row.iter_mut().zip(least).for_each(|(out, least)| *out = (*out).min(least.saturating_add(1)));
}

/// The least of each three in a row; `padded` has one voxel more on each side.
#[inline(always)]
fn threes(padded: &[u8]) -> impl Iterator<Item = u8> {
    padded.iter().zip(&padded[1..]).zip(&padded[2..]).map(|((a, b), c)| (*a).min(*b).min(*c))
}

/// Calls `take` with each row of `plane`, and with the row whose [`threes`] are the least of the nine about each of its
/// voxels in `other`.
fn each_row_with_nine(plane: &mut [u8], other: &[u8], width: usize, take: impl Fn(&mut [u8], &[u8]) + Send + Sync) {
    let rows = plane.len() / width;
    let all = plane.par_chunks_mut(width).enumerate().with_min_len(ROWS);
    all.for_each_init(
        || vec![FAR; width + 2],
        |padded, (y, row)| {
            let column = &mut padded[1..=width];
            column.copy_from_slice(&other[y * width..][..width]);
            for near in [y.wrapping_sub(1), y + 1].into_iter().filter(|near| *near < rows) {
                let near = &other[near * width..][..width];
                column.iter_mut().zip(near).for_each(|(least, v)| *least = (*least).min(*v));
            }
            take(row, padded);
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regions::block::LEAP_DISTANCE;
    use proptest::prelude::*;

    /// Distances, and the masks of leap voxels, of planes that come from the last to the first and back.
    fn swept(labels: &[u16], [nx, ny, nz]: [usize; 3]) -> (Vec<u8>, Vec<u8>) {
        let plane = nx * ny;
        let (mut flat, mut leaps) = (FlatPlanes::new(nx), LeapPlanes::new(nx));
        let (mut descending, mut ascending) = (PlaneSweep::new(nx), PlaneSweep::new(nx));
        let (mut of_planes, mut masks, mut bounds) = (Vec::new(), Vec::new(), Vec::new());
        let mut take = |flat: &[u8]| {
            descending.push_flat(flat, &mut bounds);
            of_planes.push(bounds.clone());
            masks.extend(leaps.push(flat).map(<[u8]>::to_vec));
        };
        labels.chunks(plane).rev().for_each(|labels| flat.push(labels).into_iter().for_each(&mut take));
        flat.finish().into_iter().for_each(&mut take);
        masks.extend(leaps.finish().map(<[u8]>::to_vec));
        assert_eq!((of_planes.len(), masks.len()), (nz, nz));
        for plane in of_planes.iter_mut().rev() {
            ascending.push(plane);
        }
        of_planes.iter_mut().for_each(|plane| spread(plane, nx));
        [of_planes, masks].map(|planes| planes.into_iter().rev().flatten().collect::<Vec<u8>>()).into()
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
            let (distances, masks) = swept(&labels, dims);
            prop_assert!(distances.iter().zip(masks).all(|(d, mask)| (*d >= LEAP_DISTANCE) == (mask == FAR)));
            prop_assert_eq!(distances, brute_force(&labels, dims));
        }
    }

    #[test]
    fn distances_stop_at_255_and_need_a_border_to_be_less() {
        assert!(swept(&[7; 3 * 4 * 5], [3, 4, 5]).0.iter().all(|d| *d == 255));
        let mut labels = vec![0; 600];
        labels[0] = 1;
        for dims in [[600, 1, 1], [1, 600, 1], [1, 1, 600], [1, 300, 2]] {
            let (swept, _) = swept(&labels, dims);
            let distance = |i: usize| (i % dims[0]).max(i / dims[0] % dims[1]).max(i / dims[0] / dims[1]);
            assert!(swept.into_iter().eq((0..600).map(|i| distance(i).clamp(1, 255) as u8)), "{dims:?}");
        }
    }
}

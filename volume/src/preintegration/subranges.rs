//! All slabs between n nodes in O(n^2), after Lum, Wilson and Ma 2004 ("Incremental subrange integration"), for nodes
//! that do not stand at equal distances.
//!
//! Where two slabs are of one width, an element has one opacity in both, so that sums over elements can be shared.
//! Widths differ here from pair to pair, so they are taken in bands: for the widths at both ends of a band all slabs of
//! the band are integrated, as if each were that wide, and between the two the straight colour (colour over opacity),
//! which is all but constant within a band, is interpolated. Opacity is known in closed form.
//!
//! For one width, cells are gathered in bins no wider than the narrowest slab. A slab is the end of a bin, up to two
//! whole bins, and the start of another; ends and starts are summed once.

use rayon::prelude::*;

use super::Elements;
use super::nodes::ALL;

/// An entry of a table, of red, green, blue and opacity.
pub(super) trait Entry: Copy + Send + Sync {
    fn pack(rgba: [f64; 4]) -> Self;
}

impl Entry for [f32; 4] {
    fn pack(rgba: [f64; 4]) -> Self {
        rgba.map(|v| v as f32)
    }
}

/// Tests see what is computed.
#[cfg(test)]
impl Entry for [f64; 4] {
    fn pack(rgba: [f64; 4]) -> Self {
        rgba
    }
}

/// Bands to an octave of widths.
const BANDS: u32 = 8;
/// Rows that a thread takes at once.
const ROWS: usize = 16;

/// What a run of elements gives off from the front on, per channel (r, g, b, 1 and, where lit, the same times its
/// place), and what it lets through.
#[derive(Clone, Copy)]
struct Run<const N: usize> {
    light: [f64; N],
    through: f64,
}

impl<const N: usize> Run<N> {
    const NOTHING: Self = Self { light: [0.0; N], through: 1.0 };

    #[inline(always)]
    fn then(&self, next: &Self) -> Self {
        let light = std::array::from_fn(|k| self.light[k] + self.through * next.light[k]);
        Self { light, through: self.through * next.through }
    }
}

/// Going up (the front is the lower end) and down.
type Both<const N: usize> = [Run<N>; 2];

/// Sums for slabs of one width.
struct Sums<const N: usize> {
    /// From the start of a node's bin to the node.
    starts: Vec<Both<N>>,
    /// From a node to the end of its bin.
    ends: Vec<Both<N>>,
    bins: Vec<Both<N>>,
}

/// Widths of slabs that are made at a time, in parts of a code, and the ends between which they are interpolated.
struct Band {
    widths: std::ops::Range<u32>,
    ends: [f64; 2],
    /// Binary logarithm of the widest bin.
    bin: u32,
}

fn bands(narrowest: u32) -> impl Iterator<Item = Band> {
    let octaves = narrowest.ilog2()..=ALL.ilog2();
    octaves.flat_map(|bin| {
        let end = move |k: u32| f64::from(1_u32 << bin) * libm::exp2(f64::from(k) / f64::from(BANDS));
        (0..BANDS).filter_map(move |k| {
            let (lo, hi) = (end(k), end(k + 1));
            let widths = lo.ceil() as u32..(hi.ceil() as u32).min(ALL + 1);
            let one = f64::from(widths.start);
            let ends = if widths.len() == 1 { [one, one] } else { [lo, hi] };
            (!widths.is_empty()).then_some(Band { widths, ends, bin })
        })
    })
}

/// The tables of all n^2 slabs, index front * n + back. `<4, 1>`: total; `<8, 3>`: total, front-weighted,
/// back-weighted, packed as [`super::Lit`] says.
pub(super) fn integrate<const N: usize, const K: usize, E: Entry>(elements: &Elements, length: f64) -> [Vec<E>; K] {
    let nodes = &elements.nodes;
    let n = nodes.len();
    let mut tables: [Vec<E>; K] = std::array::from_fn(|_| vec![E::pack([0.0; 4]); n * n]);
    let mut rows: Vec<Vec<&mut [E]>> = (0..n).map(|_| Vec::with_capacity(K)).collect();
    for table in &mut tables {
        rows.iter_mut().zip(table.chunks_mut(n)).for_each(|(rows, row)| rows.push(row));
    }
    let narrowest = nodes.windows(2).map(|w| w[1] - w[0]).min().unwrap_or(ALL);
    let depths = elements.depths();
    for band in bands(narrowest) {
        let bin_of = bins_of(nodes, band.bin);
        let sums = |width: f64| Sums::<N>::new(elements, &bin_of, length / width);
        let near = || sums(band.ends[0]);
        let far = || (band.ends[0] != band.ends[1]).then(|| sums(band.ends[1]));
        let (near, far) = rayon::join(near, far);
        let far = far.as_ref().unwrap_or(&near);
        let slabs = Slabs { nodes, depths: &depths, bin_of: &bin_of, band: &band, sums: [&near, far], length };
        rows.par_iter_mut().enumerate().with_min_len(ROWS).for_each(|(i, row)| slabs.fill::<K, E>(i, row));
    }
    for (i, entry) in elements.entries.iter().enumerate() {
        let opacity = entry.opacity(length);
        let depth = mean_depth(-entry.log_transparency * length, opacity);
        let total = glow_of::<4>(entry.color).map(|v| v * opacity);
        for (row, value) in rows[i].iter_mut().zip(pack::<K, E>(total, total.map(|v| v * depth))) {
            row[i] = value;
        }
    }
    tables
}

/// By node: the bin of the cell that starts there.
fn bins_of(nodes: &[u32], bin: u32) -> Vec<usize> {
    let mut count = 0;
    let starts = nodes.windows(2).map(|w| {
        count += usize::from(w[0] >> bin != w[1] >> bin);
        count
    });
    std::iter::once(0).chain(starts).collect()
}

fn glow_of<const N: usize>([r, g, b]: [f64; 3]) -> [f64; N] {
    let channels = [r, g, b, 1.0];
    std::array::from_fn(|k| channels[k % 4])
}

/// How far from its front, as a share of its length, the light of a homogeneous slab comes from on average:
/// `1 / tau - 1 / (exp(tau) - 1)` for optical depth tau, a half for a clear one. Elements in their middles, as in the
/// paper, would let the light at the back shine through an opaque slab.
#[inline(always)]
pub(super) fn mean_depth(depth: f64, opacity: f64) -> f64 {
    // The two terms cancel: the series is good to 1e-13 here.
    if depth < 1e-2 {
        0.5 - depth / 12.0 + depth * depth * depth / 720.0
    } else {
        1.0 / depth - (1.0 - opacity) / opacity
    }
}

#[inline(always)]
fn pack<const K: usize, E: Entry>(total: [f64; 4], weighted: [f64; 4]) -> [E; K] {
    let weighted: [f64; 4] = std::array::from_fn(|c| weighted[c].max(0.0).min(total[c]));
    let front = [total[0] - weighted[0], total[1] - weighted[1], total[2] - weighted[2], total[3]];
    std::array::from_fn(|k| E::pack([total, front, weighted][k]))
}

impl<const N: usize> Sums<N> {
    /// `share`: opacity units to a part of a code.
    fn new(elements: &Elements, bin_of: &[usize], share: f64) -> Self {
        let n = bin_of.len();
        let nothing = [Run::NOTHING; 2];
        let count = bin_of.last().map_or(0, |last| last + 1);
        let mut sums = Self { starts: vec![nothing; n], ends: vec![nothing; n], bins: vec![nothing; count] };
        let of = |piece: &(u32, u32, super::Element)| own::<N>(piece, share);
        let pieces: Vec<Option<Both<N>>> = elements.pieces.iter().map(of).collect();
        let cell = |i: usize| pieces[elements.first[i]..elements.first[i + 1]].iter().flatten();
        let mut run = nothing;
        for i in 0..n - 1 {
            sums.starts[i] = run;
            for [up, down] in cell(i) {
                run = [run[0].then(up), down.then(&run[1])];
            }
            if bin_of[i + 1] != bin_of[i] {
                sums.bins[bin_of[i]] = run;
                run = nothing;
            }
        }
        let mut run = nothing;
        for i in (0..n - 1).rev() {
            if bin_of[i + 1] != bin_of[i] {
                run = nothing;
            }
            for [up, down] in cell(i).rev() {
                run = [up.then(&run[0]), run[1].then(down)];
            }
            sums.ends[i] = run;
        }
        sums
    }
}

/// One element, seen from below and from above; none where it is clear.
#[inline(always)]
fn own<const N: usize>((at, width, element): &(u32, u32, super::Element), share: f64) -> Option<Both<N>> {
    let depth = -element.log_transparency * f64::from(*width) * share;
    if depth == 0.0 {
        return None;
    }
    let opacity = -libm::expm1(-depth);
    let glow = glow_of::<N>(element.color);
    let (from, width) = (f64::from(*at), f64::from(*width));
    let inward = if N == 8 { mean_depth(depth, opacity) * width } else { 0.0 };
    let seen = |place: f64| {
        let light = std::array::from_fn(|k| if k < 4 { glow[k] * opacity } else { glow[k] * opacity * place });
        Run { light, through: 1.0 - opacity }
    };
    Some([seen(from + inward), seen(from + width - inward)])
}

struct Slabs<'a, const N: usize> {
    nodes: &'a [u32],
    depths: &'a [f64],
    bin_of: &'a [usize],
    band: &'a Band,
    sums: [&'a Sums<N>; 2],
    length: f64,
}

impl<const N: usize> Slabs<'_, N> {
    /// The slabs of the band with their front at node `i`.
    fn fill<const K: usize, E: Entry>(&self, i: usize, row: &mut [&mut [E]]) {
        let (at, nodes, bin_of) = (self.nodes[i], self.nodes, self.bin_of);
        let place = |place: u32| nodes.partition_point(|&node| node < place);
        let above = place(at.saturating_add(self.band.widths.start))..place(at.saturating_add(self.band.widths.end));
        let (mut runs, mut bin) = (self.sums.map(|sums| sums.ends[i][0]), bin_of[i] + 1);
        for j in above {
            while bin < bin_of[j] {
                runs = [0, 1].map(|k| runs[k].then(&self.sums[k].bins[bin][0]));
                bin += 1;
            }
            let whole = [0, 1].map(|k| runs[k].then(&self.sums[k].starts[j][0]).light);
            self.put::<K, E>((i, j), whole, row);
        }
        let Some(top) = (at + 1).checked_sub(self.band.widths.start) else { return };
        let below = place((at + 1).saturating_sub(self.band.widths.end))..place(top);
        let (mut runs, mut bin) = (self.sums.map(|sums| sums.starts[i][1]), bin_of[i]);
        for j in below.rev() {
            while bin > bin_of[j] + 1 {
                bin -= 1;
                runs = [0, 1].map(|k| runs[k].then(&self.sums[k].bins[bin][1]));
            }
            let whole = [0, 1].map(|k| runs[k].then(&self.sums[k].ends[j][1]).light);
            self.put::<K, E>((i, j), whole, row);
        }
    }

    /// `whole`: what the slab gives off at either end of the band.
    #[inline(always)]
    fn put<const K: usize, E: Entry>(&self, (i, j): (usize, usize), whole: [[f64; N]; 2], row: &mut [&mut [E]]) {
        let (low, high) = (i.min(j), i.max(j));
        let (from, to) = (f64::from(self.nodes[low]), f64::from(self.nodes[high]));
        let opacity = -libm::expm1(-(self.depths[high] - self.depths[low]) / (to - from) * self.length);
        if opacity <= 0.0 || whole[0][3] <= 0.0 || whole[1][3] <= 0.0 {
            return;
        }
        let [near, far] = self.band.ends;
        let t = if near == far { 0.0 } else { (to - from - near) / (far - near) };
        let scale = [(1.0 - t) * opacity / whole[0][3], t * opacity / whole[1][3]];
        let total: [f64; 4] = std::array::from_fn(|c| whole[0][c] * scale[0] + whole[1][c] * scale[1]);
        let weighted: [f64; 4] = std::array::from_fn(|c| {
            if N < 8 {
                return 0.0;
            }
            // Lum, Wilson and Ma 2004: W(x) = (x - i) / (j - i), so that i times the whole is taken off.
            let place = whole[0][4 + c] * scale[0] + whole[1][4 + c] * scale[1];
            (if i < j { place - from * total[c] } else { to * total[c] - place }) / (to - from)
        });
        for (row, value) in row.iter_mut().zip(pack::<K, E>(total, weighted)) {
            row[j] = value;
        }
    }
}

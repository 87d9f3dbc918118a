//! Incremental subrange integration (Lum, Wilson and Ma 2004, "Incremental subrange integration"; here over both directions
//! at once): all slabs that run through L elements, for one L after the other, in O(n) each.
//!
//! For one L every element has one opacity, whatever the slab. The elements are cut into bins of L; a slab of L elements is
//! either a bin, or the end of one bin and the start of the next. Ends (`ends`) are integrated backwards through a bin and
//! kept, starts forwards through the next bin, and joined with the end that completes them at once.

use rayon::prelude::*;

use super::Elements;

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

/// Lengths of which all slabs are made before they go to their places: a row takes that many neighbours at a time.
const BAND: usize = 16;
/// Rows that a thread takes at once.
const ROWS: usize = 16;

/// What an element gives off per opacity: r, g, b, 1 and, where lit, the same times the place of its middle, in elements.
type Glow<const N: usize> = [f64; N];

/// The slabs of one length: K entries for the slab with entry i at its lower end, up (front at i) and down (back at i).
struct Diagonal<const K: usize, E> {
    up: Vec<[E; K]>,
    down: Vec<[E; K]>,
}

/// Subranges that end where a bin ends.
#[derive(Clone, Copy)]
struct BinEnd<const N: usize> {
    up: [f64; N],
    down: [f64; N],
    through: f64,
}

/// What one thread needs for one length.
struct Scratch<const N: usize> {
    opacity: Vec<f64>,
    ends: Vec<BinEnd<N>>,
}

impl<const N: usize> Scratch<N> {
    fn new(elements: usize) -> Self {
        let end = BinEnd { up: [0.0; N], down: [0.0; N], through: 1.0 };
        Self { opacity: vec![0.0; elements], ends: vec![end; elements] }
    }
}

/// The tables of all n^2 slabs, index front * n + back. `<4, 1>`: total; `<8, 3>`: total, front-weighted, back-weighted, packed
/// as [`super::Lit`] says.
pub(super) fn integrate<const N: usize, const K: usize, E: Entry>(elements: &Elements, length: f64) -> [Vec<E>; K] {
    let n = elements.entries.len();
    let m = n - 1;
    let glow: Vec<Glow<N>> =
        elements.between.iter().enumerate().map(|(x, e)| glow_of(e.color, x as f64 + 0.5)).collect();
    let logs: Vec<f64> = elements.between.iter().map(|e| e.log_transparency * length).collect();
    let nothing = [E::pack([0.0; 4]); K];
    let mut tables: [Vec<E>; K] = std::array::from_fn(|_| vec![E::pack([0.0; 4]); n * n]);
    let mut band: Vec<Diagonal<K, E>> =
        (0..BAND.min(m)).map(|_| Diagonal { up: vec![nothing; n], down: vec![nothing; n] }).collect();
    for first in (1..=m).step_by(BAND) {
        let lengths = BAND.min(m + 1 - first);
        band[..lengths].par_iter_mut().enumerate().for_each_init(
            || Scratch::new(m),
            |scratch, (k, diagonal)| diagonal.fill(first + k, &glow, &logs, scratch),
        );
        scatter(&mut tables, &band[..lengths], first, n);
    }
    for (i, entry) in elements.entries.iter().enumerate() {
        let opacity = entry.opacity(length);
        let total: [f64; N] = glow_of::<N>(entry.color, i as f64 + 0.5).map(|v| v * opacity);
        let packed = pack::<N, K, E>(&total, |g, t| g - i as f64 * t);
        for (table, value) in tables.iter_mut().zip(packed) {
            table[i * n + i] = value;
        }
    }
    tables
}

fn glow_of<const N: usize>([r, g, b]: [f64; 3], place: f64) -> Glow<N> {
    let channels = [r, g, b, 1.0];
    std::array::from_fn(|k| if k < 4 { channels[k] } else { channels[k - 4] * place })
}

/// `back` makes the back-weighted part of a channel from its globally weighted and its whole integral.
#[inline(always)]
fn pack<const N: usize, const K: usize, E: Entry>(sum: &[f64; N], back: impl Fn(f64, f64) -> f64) -> [E; K] {
    let total = [sum[0], sum[1], sum[2], sum[3]];
    let weighted: [f64; 4] =
        std::array::from_fn(|c| if N == 8 { back(sum[4 + c], total[c]).max(0.0).min(total[c]) } else { 0.0 });
    let front = [total[0] - weighted[0], total[1] - weighted[1], total[2] - weighted[2], total[3]];
    std::array::from_fn(|k| E::pack([total, front, weighted][k]))
}

impl<const K: usize, E: Entry> Diagonal<K, E> {
    /// All slabs through `count` elements. `logs`: ln of each element's transparency over the whole slab.
    fn fill<const N: usize>(&mut self, count: usize, glow: &[Glow<N>], logs: &[f64], scratch: &mut Scratch<N>) {
        let m = glow.len();
        let share = 1.0 / count as f64;
        for (opacity, log) in scratch.opacity.iter_mut().zip(logs) {
            // Most of a function is often clear.
            *opacity = if *log == 0.0 { 0.0 } else { -(log * share).exp_m1() };
        }
        let (opacity, ends) = (&scratch.opacity[..m], &mut scratch.ends[..m]);
        for bin in (0..m).step_by(count) {
            let end = (bin + count).min(m);
            let (mut up, mut down, mut through) = ([0.0; N], [0.0; N], 1.0);
            for x in bin..end {
                let (a, t) = (opacity[x], 1.0 - opacity[x]);
                for k in 0..N {
                    let own = glow[x][k] * a;
                    up[k] += through * own;
                    down[k] = own + t * down[k];
                }
                through *= t;
                let Some(i) = (x + 1).checked_sub(count) else { continue };
                let (low, high) = (i as f64, (i + count) as f64);
                let (mut whole_up, mut whole_down) = (up, down);
                if x + 1 < bin + count {
                    let lower = &ends[i];
                    for k in 0..N {
                        whole_up[k] = lower.up[k] + lower.through * up[k];
                        whole_down[k] = down[k] + through * lower.down[k];
                    }
                }
                // Lum, Wilson and Ma 2004: W(x) = (x - i) / (j - i), so that i times the whole is taken off.
                self.up[i] = pack(&whole_up, |g, t| (g - low * t) * share);
                self.down[i] = pack(&whole_down, |g, t| (high * t - g) * share);
            }
            if end == m {
                break;
            }
            let (mut up, mut down, mut through) = ([0.0; N], [0.0; N], 1.0);
            for x in (bin..end).rev() {
                let (a, t) = (opacity[x], 1.0 - opacity[x]);
                for k in 0..N {
                    let own = glow[x][k] * a;
                    up[k] = own + t * up[k];
                    down[k] += through * own;
                }
                through *= t;
                ends[x] = BinEnd { up, down, through };
            }
        }
    }
}

/// The slabs through `first`, `first + 1`, ... elements to their places.
fn scatter<const K: usize, E: Entry>(tables: &mut [Vec<E>; K], band: &[Diagonal<K, E>], first: usize, n: usize) {
    let mut rows: Vec<Vec<&mut [E]>> = (0..n.div_ceil(ROWS)).map(|_| Vec::with_capacity(K)).collect();
    for table in tables.iter_mut() {
        for (rows, block) in rows.iter_mut().zip(table.chunks_mut(ROWS * n)) {
            rows.push(block);
        }
    }
    rows.par_iter_mut().enumerate().for_each(|(block, tables)| {
        for row in 0..tables[0].len() / n {
            let i = block * ROWS + row;
            for (k, diagonal) in band.iter().enumerate() {
                let count = first + k;
                if i + count < n {
                    for (table, value) in tables.iter_mut().zip(diagonal.up[i]) {
                        table[row * n + i + count] = value;
                    }
                }
                if i >= count {
                    for (table, value) in tables.iter_mut().zip(diagonal.down[i - count]) {
                        table[row * n + i - count] = value;
                    }
                }
            }
        }
    });
}

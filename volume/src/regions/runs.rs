//! A block cut into runs of voxels of one window along x, and the 6-connected parts that the runs form.

use super::block::CodeTables;

/// Voxels per edge of the blocks that parts are found in: fixed, so that nothing depends on bricks or threads.
pub(crate) const BLOCK_EDGE: usize = 32;

/// Codes that are compared at once.
pub(crate) const AT_ONCE: usize = 16;

/// Voxels of one row with one window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    pub(crate) label: u16,
    /// Half-open, within the row.
    pub(crate) start: u16,
    pub(crate) end: u16,
    /// Part that it belongs to, counted by first voxel.
    pub(crate) part: u32,
}

/// The runs of a block, x fastest.
#[derive(Debug, Default)]
pub(crate) struct Runs {
    pub(crate) runs: Vec<Run>,
    /// First run of each row, and the number of runs at the end.
    pub(crate) rows: Vec<u32>,
    pub(crate) parts: u32,
    /// Work space.
    parents: Vec<u32>,
    /// The window of the last run, and codes that have it.
    known: Option<(u16, [u16; 2])>,
}

impl Runs {
    /// Cuts rows of codes, `height` of them a plane, and joins runs of one window that touch along y or z.
    pub(crate) fn find<'a>(&mut self, rows: impl Iterator<Item = &'a [u16]>, tables: &CodeTables, height: usize) {
        self.runs.clear();
        self.rows.clear();
        // Of other tables, perhaps.
        self.known = None;
        for row in rows {
            self.rows.push(self.runs.len() as u32);
            self.cut(row, tables);
        }
        let rows = self.rows.len();
        self.rows.push(self.runs.len() as u32);
        self.parts = 1;
        // Most blocks are one part, runs of which have its number already.
        if self.runs.len() == rows && self.runs.windows(2).all(|pair| pair[0].label == pair[1].label) {
            return;
        }
        let mut parents = std::mem::take(&mut self.parents);
        parents.clear();
        parents.extend(0..self.runs.len() as u32);
        for row in 0..rows {
            if row % height > 0 {
                self.join(row - 1, row, &mut parents);
            }
            if row >= height {
                self.join(row - height, row, &mut parents);
            }
        }
        self.parts = 0;
        for i in 0..self.runs.len() {
            // A parent comes before its children, so it has its number already.
            let root = find(&mut parents, i as u32) as usize;
            self.runs[i].part = if root == i { self.parts } else { self.runs[root].part };
            self.parts += u32::from(root == i);
        }
        self.parents = parents;
    }

    fn cut(&mut self, row: &[u16], tables: &CodeTables) {
        let first = self.runs.len();
        let mut start = 0;
        while start < row.len() {
            let (label, span) = match self.known {
                Some((label, span)) if (span[0]..=span[1]).contains(&row[start]) => (label, span),
                _ => (tables.window[usize::from(row[start])], tables.span[usize::from(row[start])]),
            };
            self.known = Some((label, span));
            let end = start + within(&row[start..], span);
            match self.runs[first..].last_mut() {
                // Codes between those of a window may have another.
                Some(last) if last.label == label => last.end = end as u16,
                _ => self.runs.push(Run { label, start: start as u16, end: end as u16, part: 0 }),
            }
            start = end;
        }
    }

    /// Rows and their runs.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (usize, &[Run])> {
        let bounds = self.rows.windows(2).map(|b| b[0] as usize..b[1] as usize);
        bounds.map(|b| &self.runs[b]).enumerate()
    }

    fn join(&self, a: usize, b: usize, parents: &mut [u32]) {
        let (mut i, mut j) = (self.rows[a] as usize, self.rows[b] as usize);
        let (i_end, j_end) = (self.rows[a + 1] as usize, self.rows[b + 1] as usize);
        while i < i_end && j < j_end {
            let (p, q) = (&self.runs[i], &self.runs[j]);
            if p.label == q.label {
                join(parents, i as u32, j as u32);
            }
            // Both rows end at the same voxel: whichever run ends first has met all that it can meet.
            i += usize::from(p.end <= q.end);
            j += usize::from(q.end <= p.end);
        }
    }
}

/// How many of `codes` lie within a span before one does not.
pub(crate) fn within(codes: &[u16], [low, high]: [u16; 2]) -> usize {
    let beyond = |code: &u16| code.wrapping_sub(low).saturating_sub(high - low);
    let (at_once, rest) = codes.as_chunks::<AT_ONCE>();
    let whole = at_once.iter().take_while(|codes| codes.iter().fold(0, |any, code| any | beyond(code)) == 0).count();
    let tail = at_once.get(whole).map_or(rest, |codes| &codes[..]);
    whole * AT_ONCE + tail.iter().position(|code| beyond(code) != 0).unwrap_or(tail.len())
}

/// The root of `i`: the smallest of its set.
pub(crate) fn find(parents: &mut [u32], mut i: u32) -> u32 {
    while parents[i as usize] != i {
        parents[i as usize] = parents[parents[i as usize] as usize];
        i = parents[i as usize];
    }
    i
}

/// Joins the sets of `a` and `b`; the smaller root becomes the root of both.
pub(crate) fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parents, a), find(parents, b));
    let (low, high) = (a.min(b), a.max(b));
    parents[high as usize] = low;
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Windows of codes that lie in several spans, one of them without another between: what is told by spans is
        /// what each code's window says.
        #[test]
        fn runs_and_parts_are_those_of_each_voxels_window(
            ends in prop::collection::vec((0..60_u16, 0..3_u16), 1..9),
            [nx, ny, nz] in [1..BLOCK_EDGE + 1, 1..6_usize, 1..4_usize],
            mut codes in prop::collection::vec(0..60_u16, BLOCK_EDGE * 5 * 3),
            same in 0..40_usize,
        ) {
            let mut window = vec![7; 1 << 16];
            ends.iter().for_each(|(end, label)| window[..usize::from(*end)].fill(*label));
            let tables = CodeTables::new(window.clone());
            codes.truncate(nx * ny * nz);
            let first = codes[0];
            codes.iter_mut().skip(same).step_by(3).for_each(|code| *code = first);
            let labels: Vec<u16> = codes.iter().map(|code| window[usize::from(*code)]).collect();
            let mut told = vec![9; codes.len()];
            tables.windows(&codes, &mut told);
            prop_assert_eq!(&told, &labels);

            let mut runs = Runs::default();
            // What an earlier block left is forgotten.
            runs.find([[59_u16; 4].as_slice(); 2].into_iter(), &CodeTables::new(vec![1; 1 << 16]), 2);
            runs.find(codes.chunks(nx), &tables, ny);
            let mut parts = vec![u32::MAX; codes.len()];
            for (row, of_row) in runs.rows() {
                let naive = labels[row * nx..][..nx].chunk_by(|a, b| a == b);
                let naive: Vec<_> = naive.map(|run| (run[0], run.len())).collect();
                let found: Vec<_> = of_row.iter().map(|run| (run.label, usize::from(run.end - run.start))).collect();
                prop_assert_eq!(found, naive);
                for run in of_row {
                    parts[row * nx..][usize::from(run.start)..usize::from(run.end)].fill(run.part);
                }
            }
            // The smallest voxel that each is joined with, by as many rounds as it takes.
            let mut roots: Vec<usize> = (0..codes.len()).collect();
            loop {
                let before = roots.clone();
                for i in 0..codes.len() {
                    let [x, y, z] = [i % nx, i / nx % ny, i / nx / ny];
                    let next = [(x + 1 < nx, 1), (y + 1 < ny, nx), (z + 1 < nz, nx * ny)];
                    for (_, step) in next.into_iter().filter(|(there, step)| *there && labels[i] == labels[i + step]) {
                        let least = roots[i].min(roots[i + step]);
                        (roots[i], roots[i + step]) = (least, least);
                    }
                }
                if roots == before {
                    break;
                }
            }
            let mut numbers = std::collections::HashMap::new();
            for (i, root) in roots.iter().enumerate() {
                let count = numbers.len() as u32;
                prop_assert_eq!(parts[i], *numbers.entry(root).or_insert(count), "voxel {}", i);
            }
            prop_assert_eq!(runs.parts as usize, numbers.len());
        }
    }
}

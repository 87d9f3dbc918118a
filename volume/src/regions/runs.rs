//! A block cut into runs of voxels of one window along x, and the 6-connected parts that the runs form.

use super::block::CodeTables;

/// Voxels per edge of the blocks that parts are found in: fixed, so that nothing depends on bricks or threads.
pub(crate) const BLOCK_EDGE: usize = 32;

/// Codes that are compared at once.
const AT_ONCE: usize = 16;

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
}

impl Runs {
    /// Cuts rows of codes, `height` of them a plane, and joins runs of one window that touch along y or z.
    pub(crate) fn find<'a>(&mut self, rows: impl Iterator<Item = &'a [u16]>, tables: &CodeTables, height: usize) {
        self.runs.clear();
        self.rows.clear();
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
            let code = usize::from(row[start]);
            let (label, end) = (tables.window[code], start + within(&row[start..], tables.span[code]));
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
fn within(codes: &[u16], [low, high]: [u16; 2]) -> usize {
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

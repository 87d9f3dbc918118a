//! A block cut into runs of voxels of one label along x, and the 6-connected parts that the runs form.

/// Voxels per edge of the blocks that parts are found in: fixed, so that nothing depends on bricks or threads.
pub(crate) const BLOCK_EDGE: usize = 32;

/// Voxels of one row with one label.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    pub(crate) label: u32,
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
}

impl Runs {
    /// Cuts `labels`, rows of `dims[0]` voxels, and joins runs of equal label that touch along y or z.
    pub(crate) fn find(&mut self, labels: &[u32], dims: [usize; 3]) {
        self.cut(labels, dims[0]);
        let mut parents: Vec<u32> = (0..self.runs.len() as u32).collect();
        for row in 0..dims[1] * dims[2] {
            if row % dims[1] > 0 {
                self.join(row - 1, row, &mut parents);
            }
            if row >= dims[1] {
                self.join(row - dims[1], row, &mut parents);
            }
        }
        self.parts = 0;
        for i in 0..self.runs.len() {
            // A parent comes before its children, so it has its number already.
            let root = find(&mut parents, i as u32) as usize;
            self.runs[i].part = if root == i { self.parts } else { self.runs[root].part };
            self.parts += u32::from(root == i);
        }
    }

    /// As [`Runs::find`] for labels that are regions as they are: no parts.
    pub(crate) fn cut(&mut self, labels: &[u32], width: usize) {
        self.runs.clear();
        self.rows.clear();
        for row in labels.chunks_exact(width) {
            self.rows.push(self.runs.len() as u32);
            let mut start = 0;
            for run in row.chunk_by(|a, b| a == b) {
                let end = start + run.len();
                self.runs.push(Run { label: run[0], start: start as u16, end: end as u16, part: 0 });
                start = end;
            }
        }
        self.rows.push(self.runs.len() as u32);
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

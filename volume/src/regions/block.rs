//! The parts of one block of a slab, and which of them the rest of the volume must hear of.

use std::ops::Range;

use super::code::{Density, density_by_shifts, density_of_code};
use super::runs::{AT_ONCE, BLOCK_EDGE, Run, Runs, within};

/// Planes of codes and distances, x fastest: one layer of blocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slab<'a> {
    /// Of the volume.
    pub(crate) dims: [usize; 3],
    /// Its first plane, a multiple of [`BLOCK_EDGE`].
    pub(crate) z0: usize,
    pub(crate) codes: &'a [u16],
    pub(crate) distances: &'a [u8],
}

/// The window of every 16-bit code; nothing where labels are given.
#[derive(Debug)]
pub(crate) struct CodeTables {
    pub(crate) window: Vec<u16>,
    /// First and last of the codes about a code that all have its window: most rows are told by them without looking
    /// up any other code.
    pub(crate) span: Vec<[u16; 2]>,
}

impl CodeTables {
    pub(crate) fn new(window: Vec<u16>) -> Self {
        let spans = window.chunk_by(|a, b| a == b).scan(0, |start, codes| {
            let first = *start;
            *start += codes.len();
            Some(std::iter::repeat_n([first as u16, (*start - 1) as u16], codes.len()))
        });
        let span = spans.flatten().collect();
        Self { window, span }
    }

    /// The windows of `codes`.
    pub(crate) fn windows(&self, codes: &[u16], windows: &mut [u16]) {
        let parts = codes.chunks(AT_ONCE).zip(windows.chunks_mut(AT_ONCE));
        parts.for_each(|(codes, windows)| {
            let first = usize::from(codes[0]);
            match within(codes, self.span[first]) == codes.len() {
                true => windows.fill(self.window[first]),
                false => windows.iter_mut().zip(codes).for_each(|(w, code)| *w = self.window[usize::from(*code)]),
            }
        });
    }
}

/// The smallest distance of a leap voxel with the narrowest guard, of width 2.
pub(crate) const LEAP_DISTANCE: u8 = 3;

/// A component, or as much of one as is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Part {
    /// Smallest global voxel index.
    pub(crate) root: u64,
    pub(crate) voxels: u64,
    /// Of its voxels' densities.
    pub(crate) sum: u64,
    /// Voxels at least [`LEAP_DISTANCE`] from the nearest voxel of another label.
    pub(crate) leaps: u64,
    pub(crate) min: Density,
    pub(crate) max: Density,
    pub(crate) window: u16,
}

impl Part {
    pub(crate) const EMPTY: Self =
        Self { root: u64::MAX, voxels: 0, sum: 0, leaps: 0, min: Density::MAX, max: 0, window: 0 };

    pub(crate) fn merge(&mut self, other: &Self) {
        self.root = self.root.min(other.root);
        self.voxels += other.voxels;
        self.sum += other.sum;
        self.leaps += other.leaps;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// Takes in voxels that start at the global index `root`.
    pub(crate) fn add(&mut self, root: u64, codes: &[u16], distances: &[u8]) {
        /// Sums of 32 bits hold as many densities.
        const SUMMED: usize = 1 << 16;
        self.root = self.root.min(root);
        self.voxels += codes.len() as u64;
        for (codes, distances) in codes.chunks(SUMMED).zip(distances.chunks(SUMMED)) {
            self.sum += u64::from(codes.iter().map(|c| density_by_shifts(*c)).sum::<u32>());
            self.leaps += u64::from(distances.iter().map(|d| u32::from(*d >= LEAP_DISTANCE)).sum::<u32>());
        }
        let (low, high) = codes.iter().fold((u16::MAX, 0), |(low, high), c| (low.min(*c), high.max(*c)));
        if low <= high {
            // Densities ascend with their codes.
            self.min = self.min.min(density_of_code(low));
            self.max = self.max.max(density_of_code(high));
        }
    }
}

impl Slab<'_> {
    pub(crate) fn planes(&self) -> usize {
        self.codes.len() / (self.dims[0] * self.dims[1])
    }

    /// Blocks along x and y; a slab is one block deep.
    pub(crate) fn blocks(&self) -> [usize; 2] {
        [self.dims[0], self.dims[1]].map(|n| n.div_ceil(BLOCK_EDGE))
    }

    /// First voxel (x, y) and size of the `i`-th block, x fastest.
    pub(crate) fn block(&self, i: usize) -> ([usize; 2], [usize; 3]) {
        let bx = self.blocks()[0];
        let lo = [i % bx * BLOCK_EDGE, i / bx * BLOCK_EDGE];
        (lo, [BLOCK_EDGE.min(self.dims[0] - lo[0]), BLOCK_EDGE.min(self.dims[1] - lo[1]), self.planes()])
    }

    /// First voxel of a block's row, within the slab.
    pub(crate) fn row(&self, lo: [usize; 2], size: [usize; 3], row: usize) -> usize {
        ((row / size[1]) * self.dims[1] + lo[1] + row % size[1]) * self.dims[0] + lo[0]
    }

    /// For the low and the high side of each axis: does the volume go on there?
    fn goes_on(&self, lo: [usize; 2], size: [usize; 3]) -> [[bool; 2]; 3] {
        let lo = [lo[0], lo[1], self.z0];
        std::array::from_fn(|a| [lo[a] > 0, lo[a] + size[a] < self.dims[a]])
    }
}

/// The work space of a thread.
#[derive(Debug, Default)]
pub(crate) struct BlockSpace {
    pub(crate) runs: Runs,
    /// Per part of the block: 1 + its node, or 0 where nobody else needs to hear of it.
    pub(crate) node_of_part: Vec<u32>,
    parts: Vec<Part>,
    on_face: Vec<bool>,
}

/// Parts of a block that may go on in others or be kept: its *nodes*, and where they lie on its faces.
#[derive(Debug)]
pub(crate) struct BlockNodes {
    pub(crate) nodes: Vec<Part>,
    /// All of the block is one part.
    pub(crate) is_whole: bool,
    /// For the low and high side of each axis the nodes of the face's voxels, lower axis fastest; empty at the volume's
    /// edge.
    pub(crate) faces: [[Vec<u32>; 2]; 3],
}

impl BlockSpace {
    /// Finds the parts of the `i`-th block; parts within the block that hold no leap voxel are nothing to anybody.
    pub(crate) fn find(&mut self, slab: &Slab<'_>, i: usize, tables: &CodeTables) -> BlockNodes {
        let (lo, size) = self.cut(slab, i, tables);
        self.measure(slab, lo, size);
        let mut nodes = Vec::new();
        self.node_of_part.clear();
        for (part, on_face) in self.parts.iter().zip(&self.on_face) {
            let is_node = *on_face || part.leaps > 0;
            if is_node {
                nodes.push(*part);
            }
            self.node_of_part.push(if is_node { nodes.len() as u32 } else { 0 });
        }
        let is_whole = self.parts.len() == 1;
        BlockNodes { nodes, is_whole, faces: self.faces(size, slab.goes_on(lo, size)) }
    }

    /// The same parts and nodes, where nothing else need be known of them.
    pub(crate) fn find_again(&mut self, slab: &Slab<'_>, i: usize, tables: &CodeTables) {
        let (lo, size) = self.cut(slab, i, tables);
        let Self { runs, on_face: is_node, node_of_part, .. } = self;
        is_node.clear();
        is_node.resize(runs.parts as usize, false);
        each_run(runs, slab, lo, size, |run, voxels, on_face| {
            let is_node = &mut is_node[run.part as usize];
            *is_node = *is_node || on_face || slab.distances[voxels].iter().any(|d| *d >= LEAP_DISTANCE);
        });
        let mut nodes = 0;
        node_of_part.clear();
        node_of_part.extend(is_node.iter().map(|is_node| {
            nodes += u32::from(*is_node);
            if *is_node { nodes } else { 0 }
        }));
    }

    /// Cuts the `i`-th block into runs and parts: its first voxel (x, y), and its size.
    fn cut(&mut self, slab: &Slab<'_>, i: usize, tables: &CodeTables) -> ([usize; 2], [usize; 3]) {
        let (lo, size) = slab.block(i);
        let rows = (0..size[1] * size[2]).map(|row| &slab.codes[slab.row(lo, size, row)..][..size[0]]);
        self.runs.find(rows, tables, size[1]);
        (lo, size)
    }

    fn measure(&mut self, slab: &Slab<'_>, lo: [usize; 2], size: [usize; 3]) {
        let Self { runs, parts, on_face, .. } = self;
        parts.clear();
        parts.resize(runs.parts as usize, Part::EMPTY);
        on_face.clear();
        on_face.resize(runs.parts as usize, false);
        let volume_start = slab.z0 * slab.dims[1] * slab.dims[0];
        each_run(runs, slab, lo, size, |run, voxels, is_on_face| {
            let part = &mut parts[run.part as usize];
            part.window = run.label;
            let root = (volume_start + voxels.start) as u64;
            part.add(root, &slab.codes[voxels.clone()], &slab.distances[voxels]);
            on_face[run.part as usize] |= is_on_face;
        });
    }

    fn faces(&self, size: [usize; 3], goes_on: [[bool; 2]; 3]) -> [[Vec<u32>; 2]; 3] {
        let mut faces: [[Vec<u32>; 2]; 3] = Default::default();
        // A part on a face is a node.
        let node = |run: &Run| self.node_of_part[run.part as usize] - 1;
        for (row, runs) in self.runs.rows() {
            let (y, z) = (row % size[1], row / size[1]);
            for (side, run) in [runs.first(), runs.last()].into_iter().enumerate() {
                if let (true, Some(run)) = (goes_on[0][side], run) {
                    faces[0][side].push(node(run));
                }
            }
            for (axis, at) in [(1, y), (2, z)] {
                for side in 0..2 {
                    if goes_on[axis][side] && at == side * (size[axis] - 1) {
                        for run in runs {
                            let count = usize::from(run.end - run.start);
                            faces[axis][side].extend(std::iter::repeat_n(node(run), count));
                        }
                    }
                }
            }
        }
        faces
    }
}

/// Calls `take` with each run of a block, its voxels in the slab, and whether it lies on a face behind which the volume
/// goes on.
fn each_run(
    runs: &Runs,
    slab: &Slab<'_>,
    lo: [usize; 2],
    size: [usize; 3],
    mut take: impl FnMut(&Run, Range<usize>, bool),
) {
    let goes_on = slab.goes_on(lo, size);
    for (row, runs) in runs.rows() {
        let (y, z) = (row % size[1], row / size[1]);
        let at_yz = goes_on[1][0] && y == 0
            || goes_on[1][1] && y + 1 == size[1]
            || goes_on[2][0] && z == 0
            || goes_on[2][1] && z + 1 == size[2];
        let first = slab.row(lo, size, row);
        for run in runs {
            let voxels = first + usize::from(run.start)..first + usize::from(run.end);
            let at_x = goes_on[0][0] && run.start == 0 || goes_on[0][1] && usize::from(run.end) == size[0];
            take(run, voxels, at_yz || at_x);
        }
    }
}

//! The parts of one block of a slab, and which of them the rest of the volume must hear of.

use super::code::Density;
use super::runs::{BLOCK_EDGE, Run, Runs};

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

/// Window and density of every 16-bit code.
#[derive(Debug)]
pub(crate) struct CodeTables {
    pub(crate) window: Vec<u16>,
    pub(crate) density: Vec<Density>,
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
    pub(crate) fn add(&mut self, root: u64, codes: &[u16], distances: &[u8], density: &[Density]) {
        self.root = self.root.min(root);
        self.voxels += codes.len() as u64;
        let densities = codes.iter().map(|c| density[usize::from(*c)]);
        self.sum += densities.clone().map(u64::from).sum::<u64>();
        self.leaps += distances.iter().map(|d| u64::from(*d >= LEAP_DISTANCE)).sum::<u64>();
        (self.min, self.max) = densities.fold((self.min, self.max), |(lo, hi), d| (lo.min(d), hi.max(d)));
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
    labels: Vec<u32>,
    /// Per part of the block: 1 + its node, or 0 where nobody else needs to hear of it.
    pub(crate) node_of_part: Vec<u32>,
    parts: Vec<Part>,
    on_face: Vec<bool>,
}

/// Parts of a block that may go on in others or be kept: its *nodes*, and where they lie on its faces.
#[derive(Debug)]
pub(crate) struct BlockNodes {
    pub(crate) nodes: Vec<Part>,
    /// For the low and high side of each axis the nodes of the face's voxels, lower axis fastest; empty at the volume's
    /// edge.
    pub(crate) faces: [[Vec<u32>; 2]; 3],
}

impl BlockSpace {
    /// Finds the parts of the `i`-th block; parts within the block that hold no leap voxel are nothing to anybody.
    pub(crate) fn find(&mut self, slab: &Slab<'_>, i: usize, tables: &CodeTables) -> BlockNodes {
        let (lo, size) = slab.block(i);
        self.labels.clear();
        for row in 0..size[1] * size[2] {
            let codes = &slab.codes[slab.row(lo, size, row)..][..size[0]];
            self.labels.extend(codes.iter().map(|c| u32::from(tables.window[usize::from(*c)])));
        }
        self.runs.find(&self.labels, size);
        self.measure(slab, lo, size, tables);
        let mut nodes = Vec::new();
        self.node_of_part.clear();
        for (part, on_face) in self.parts.iter().zip(&self.on_face) {
            let is_node = *on_face || part.leaps > 0;
            if is_node {
                nodes.push(*part);
            }
            self.node_of_part.push(if is_node { nodes.len() as u32 } else { 0 });
        }
        BlockNodes { nodes, faces: self.faces(size, slab.goes_on(lo, size)) }
    }

    fn measure(&mut self, slab: &Slab<'_>, lo: [usize; 2], size: [usize; 3], tables: &CodeTables) {
        let goes_on = slab.goes_on(lo, size);
        self.parts.clear();
        self.parts.resize(self.runs.parts as usize, Part::EMPTY);
        self.on_face.clear();
        self.on_face.resize(self.runs.parts as usize, false);
        let volume_start = slab.z0 * slab.dims[1] * slab.dims[0];
        for (row, runs) in self.runs.rows() {
            let (y, z) = (row % size[1], row / size[1]);
            let at_yz = goes_on[1][0] && y == 0
                || goes_on[1][1] && y + 1 == size[1]
                || goes_on[2][0] && z == 0
                || goes_on[2][1] && z + 1 == size[2];
            let first = slab.row(lo, size, row);
            for run in runs {
                let voxels = first + usize::from(run.start)..first + usize::from(run.end);
                let part = &mut self.parts[run.part as usize];
                part.window = run.label as u16;
                let root = (volume_start + voxels.start) as u64;
                part.add(root, &slab.codes[voxels.clone()], &slab.distances[voxels], &tables.density);
                let at_x = goes_on[0][0] && run.start == 0 || goes_on[0][1] && usize::from(run.end) == size[0];
                self.on_face[run.part as usize] |= at_yz || at_x;
            }
        }
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

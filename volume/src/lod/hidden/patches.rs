//! Cells that are joined to what is drawn: without a look at cells whose block is drawn as before.

use glam::UVec3;

use super::blocks::Blocks;

/// Cells all of whose finest voxels are of one kind, in patches: those of a block that hang together by faces. Which
/// these are, and which touch, follows from the finest level alone; what is drawn says which are *seeds*, and which
/// are there at all.
#[derive(Debug)]
pub(super) struct Patches {
    /// By cell; [`NONE`] for those not of the kind.
    of: Vec<u32>,
    /// The first of each block, and the number of all.
    first: Vec<u32>,
    /// Each one's block.
    blocks: Vec<u32>,
    /// Pairs that touch across a face of blocks.
    links: Vec<[u32; 2]>,
    /// Some cell of it is drawn as it is.
    seeds: Vec<bool>,
    joined: Vec<bool>,
}

const NONE: u32 = u32::MAX;
const AXES: [UVec3; 3] = [UVec3::X, UVec3::Y, UVec3::Z];

impl Patches {
    pub(super) fn new(blocks: &Blocks, is: &[bool]) -> Self {
        let mut all = Self {
            of: vec![NONE; is.len()],
            first: vec![0],
            blocks: vec![],
            links: vec![],
            seeds: vec![],
            joined: vec![],
        };
        let (mut open, steps) = (Vec::new(), blocks.steps());
        for block in 0..blocks.count() {
            for (place, at) in blocks.rows(block).flat_map(|row| row.cells()) {
                if !is[place] || all.of[place] != NONE {
                    continue;
                }
                let patch = all.blocks.len() as u32;
                all.blocks.push(block as u32);
                all.of[place] = patch;
                open.push((place, at));
                while let Some((place, at)) = open.pop() {
                    let mut reach = |place: usize, at: UVec3| {
                        if is[place] && all.of[place] == NONE {
                            all.of[place] = patch;
                            open.push((place, at));
                        }
                    };
                    for (axis, step) in steps.into_iter().enumerate() {
                        let [is_first, is_last, _] = blocks.ends(at, axis);
                        if !is_first {
                            reach(place - step, at - AXES[axis]);
                        }
                        if !is_last {
                            reach(place + step, at + AXES[axis]);
                        }
                    }
                }
            }
            all.first.push(all.blocks.len() as u32);
        }
        for (place, at) in (0..blocks.count()).flat_map(|block| blocks.rows(block)).flat_map(|row| row.cells()) {
            let patch = all.of[place];
            for (axis, step) in steps.into_iter().enumerate().filter(|_| patch != NONE) {
                let [_, is_last, is_followed] = blocks.ends(at, axis);
                let next = if is_last && is_followed { all.of[place + step] } else { NONE };
                if next != NONE {
                    all.links.push([patch, next]);
                }
            }
        }
        all.links.sort_unstable();
        all.links.dedup();
        all.seeds = vec![false; all.blocks.len()];
        all
    }

    /// Of a block whose drawing has changed; `is_drawn_so` says of a cell of the kind whether it is drawn so.
    pub(super) fn seed(&mut self, blocks: &Blocks, block: usize, is_drawn_so: impl Fn(usize) -> bool) {
        let [first, end] = [block, block + 1].map(|block| self.first[block] as usize);
        self.seeds[first..end].fill(false);
        if first < end {
            for place in blocks.rows(block).flat_map(|row| row.places()).filter(|place| self.of[*place] != NONE) {
                self.seeds[self.of[place] as usize] |= is_drawn_so(place);
            }
        }
    }

    /// Joins those of the blocks that are drawn.
    pub(super) fn join(&mut self, is_drawn: impl Fn(usize) -> bool) {
        let mut over: Vec<u32> = (0..self.blocks.len() as u32).collect();
        let is_there = |patch: u32| is_drawn(self.blocks[patch as usize] as usize);
        for [a, b] in self.links.iter().filter(|link| link.iter().all(|patch| is_there(*patch))) {
            let (a, b) = (root(&mut over, *a), root(&mut over, *b));
            over[a.max(b) as usize] = a.min(b);
        }
        let mut is_seeded = vec![false; over.len()];
        for patch in 0..over.len() {
            is_seeded[root(&mut over, patch as u32) as usize] |= self.seeds[patch];
        }
        self.joined = (0..over.len()).map(|patch| is_seeded[root(&mut over, patch as u32) as usize]).collect();
    }

    /// Is the cell at a place of the kind, and joined to one that is drawn so?
    pub(super) fn is_joined(&self, place: usize) -> bool {
        self.of[place] != NONE && self.joined[self.of[place] as usize]
    }
}

/// The one over all that were joined, and a shorter way there.
fn root(over: &mut [u32], patch: u32) -> u32 {
    let mut at = patch as usize;
    while over[at] as usize != at {
        over[at] = over[over[at] as usize];
        at = over[at] as usize;
    }
    at as u32
}

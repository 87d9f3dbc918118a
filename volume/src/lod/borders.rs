//! Where what one level draws of a volume meets what others draw: there its bricks begin and end between whole steps,
//! and take the values of coarser levels (docs/definition.md, Levels).

use std::collections::BTreeMap;

use super::selection::Part;
use crate::ids::{BrickIndex, ChunkId, ChunkIndex};
use crate::merge::MergeTree;
use crate::per_chunk::PerChunk;

/// Of the 27 places around a box and itself, x fastest, from -1 to 1 on every axis, those where something is; never the
/// box itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Sides(u32);

/// The bit of the box itself.
const MIDDLE: u32 = 13;

/// Finer parts of a step than one of 2^6 change no picture, and take time.
const MOST_HALVINGS: u8 = 6;

impl Sides {
    /// `is` says of each place around whether it is one of them.
    #[must_use]
    pub fn around(is: impl Fn([i32; 3]) -> bool) -> Self {
        let at = |bit: u32| [0, 1, 2].map(|axis| (bit / 3_u32.pow(axis) % 3) as i32 - 1);
        Self((0..27).filter(|&bit| bit != MIDDLE && is(at(bit))).map(|bit| 1 << bit).sum())
    }

    /// `None` for the box itself, and what is no place.
    #[must_use]
    pub fn from_bits(bits: u32) -> Option<Self> {
        (bits < 1 << 27 && bits >> MIDDLE & 1 == 0).then_some(Self(bits))
    }

    #[must_use]
    pub const fn bits(self) -> u32 {
        self.0
    }

    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Is it one of the places, from -1 to 1 on every axis?
    #[must_use]
    pub fn is_at(self, place: [i32; 3]) -> bool {
        let [x, y, z] = place.map(|v| v + 1);
        self.0 >> (x + 3 * y + 9 * z) & 1 == 1
    }

    /// Are all of these among them?
    #[must_use]
    pub const fn contains(self, others: Self) -> bool {
        others.0 & !self.0 == 0
    }

    /// Those of a box within, which is the first of its kind on some axes, and the last.
    pub(super) fn within(self, first: [bool; 3], last: [bool; 3]) -> Self {
        let out = |axis: usize, side: i32| match side {
            -1 if first[axis] => -1,
            1 if last[axis] => 1,
            _ => 0,
        };
        Self::around(|side| self.is_at([0, 1, 2].map(|axis| out(axis, side[axis]))))
    }
}

/// Where other levels are drawn around a chunk or a brick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Meets {
    pub others: Sides,
    /// Of these, where it is a coarser one.
    pub coarser: Sides,
}

/// Of a level's part of a picture, the chunks that have another level's next to them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Borders {
    level: u8,
    meets: BTreeMap<ChunkId, Meets>,
}

impl Borders {
    /// `None` where there are none, and where a coarser level is none of the others.
    #[must_use]
    pub fn new(level: u8, meets: impl IntoIterator<Item = (ChunkId, Meets)>) -> Option<Self> {
        let meets: BTreeMap<_, _> = meets.into_iter().filter(|(_, meets)| !meets.others.is_empty()).collect();
        let are_others = meets.values().all(|meets| meets.others.contains(meets.coarser));
        (are_others && !meets.is_empty()).then_some(Self { level, meets })
    }

    /// Of what a level, whose chunks are `tree`'s, draws of a selection.
    #[must_use]
    pub fn of(tree: &MergeTree, part: &Part) -> Option<Self> {
        let dims = tree.chunk_dims().as_ivec3().to_array();
        let is_in = |chunks: &PerChunk<bool>, chunk: [i32; 3]| {
            let is_there = (0..3).all(|a| (0..dims[a]).contains(&chunk[a]));
            is_there && chunks[tree.chunk_id(ChunkIndex(chunk.map(|v| v as u32)))]
        };
        let drawn = part.drawn.iter().filter(|(_, drawn)| **drawn);
        let of_chunk = |(id, _): (ChunkId, &bool)| {
            let chunk = tree.chunk_at(id)?.0.map(|v| v as i32);
            let sides = |of| Sides::around(|side| is_in(of, [0, 1, 2].map(|a| chunk[a] + side[a])));
            Some((id, Meets { others: sides(&part.elsewhere), coarser: sides(&part.coarser) }))
        };
        Self::new(part.level, drawn.filter_map(of_chunk))
    }

    #[must_use]
    pub fn level(&self) -> u8 {
        self.level
    }

    /// Is any of the other levels a coarser one?
    #[must_use]
    pub fn meet_coarser(&self) -> bool {
        self.meets.values().any(|meets| !meets.coarser.is_empty())
    }

    /// By chunk; none without any.
    pub fn iter(&self) -> impl Iterator<Item = (ChunkId, Meets)> + '_ {
        self.meets.iter().map(|(chunk, meets)| (*chunk, *meets))
    }

    /// Of some chunks alone.
    #[must_use]
    pub fn only(&self, chunks: impl IntoIterator<Item = ChunkId>) -> Option<Self> {
        Self::new(self.level, chunks.into_iter().filter_map(|c| Some((c, *self.meets.get(&c)?))))
    }

    /// The part of a step by which positions are counted where levels meet: a power of two.
    #[must_use]
    pub fn finest(&self) -> f32 {
        (-f32::from(self.level.min(MOST_HALVINGS))).exp2()
    }

    /// Of a chunk; nothing where it has none.
    pub(super) fn of_chunk(&self, chunk: ChunkId) -> Option<Meets> {
        self.meets.get(&chunk).copied()
    }

    /// Of a brick of `tree`.
    #[must_use]
    pub fn of_brick(&self, tree: &MergeTree, brick: BrickIndex) -> Meets {
        let Some(meets) = self.meets.get(&tree.chunk_id(tree.chunk_of(brick))) else { return Meets::default() };
        let edge = tree.chunk_bricks();
        let (first, last) = (brick.0.map(|v| v % edge == 0), brick.0.map(|v| v % edge == edge - 1));
        let within = |sides: Sides| sides.within(first, last);
        Meets { others: within(meets.others), coarser: within(meets.coarser) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_bits_by_place() {
        let sides = Sides::around(|side| side == [1, 0, -1] || side == [0, 0, 0]);
        assert_eq!(sides.bits(), 1 << (2 + 3));
        assert_eq!(Sides::from_bits(sides.bits()), Some(sides));
        assert!(sides.is_at([1, 0, -1]) && !sides.is_at([1, 0, 0]) && !sides.is_at([0; 3]));
        assert!(sides.contains(Sides::default()) && sides.contains(sides) && !Sides::default().contains(sides));
        assert_eq!((Sides::from_bits(1 << MIDDLE), Sides::from_bits(1 << 27)), (None, None));
    }

    /// A brick meets what its chunk meets where it is at the chunk's end, and its own chunk's bricks elsewhere.
    #[test]
    fn bricks_have_the_sides_of_their_chunks_at_its_ends() {
        let right = Sides::around(|side| side[0] == 1);
        assert_eq!(right.within([true; 3], [true; 3]), right);
        assert_eq!(right.within([true, false, false], [false, true, true]), Sides::default());
        // In the middle of the chunk's right face: all nine places there are the right neighbour's.
        let face = Sides::around(|side| side == [1, 0, 0]);
        assert_eq!(face.within([false; 3], [true, false, false]), right);
        // At its edge three of them are another chunk's.
        let inner = Sides::around(|side| side[0] == 1 && side[1] < 1);
        assert_eq!(face.within([false; 3], [true, true, false]), inner);
    }
}

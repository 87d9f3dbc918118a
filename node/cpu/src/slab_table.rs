//! Tables of slabs, side by side: the twin's `entry_at` and `look_up` (`shaders/src/twin/slab.rs`), a lane each.

use brickcast_shaders::SlabKind;
use brickcast_shaders::twin::bindings::{Bindings, SlabTable};

use super::lanes::{Floats, Ints, Lanes};
use super::ray::clamped;
use super::slab::Sum;

/// A table, and what of it does not change along rays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slabs<'a, L: Lanes> {
    /// [`SlabTable::front`], [`SlabTable::back`].
    pub(crate) front: &'a [[f32; 4]],
    pub(crate) back: &'a [[f32; 4]],
    warp: &'a [[f32; 2]],
    shown_before: &'a [u32],
    size: usize,
    /// Blocks of the warp, and those per code.
    blocks: L::F,
    last_block: L::I,
    scale: L::F,
    last_node: L::F,
    before_last: L::I,
    nodes: L::I,
    last_shown: L::I,
}

/// Where ends lie among the nodes of a table: the node below, and how far on to the next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nodes<L: Lanes> {
    pub(crate) front: (L::I, L::F),
    pub(crate) back: (L::I, L::F),
}

impl<'a, L: Lanes> Slabs<'a, L> {
    /// Outside regions, and in them; `None` where slabs are single samples.
    #[inline(always)]
    pub(crate) fn of(l: L, bound: &Bindings<'a>, kind: SlabKind) -> Option<[Self; 2]> {
        match bound.scene.slabs {
            Some([outside, inside]) if kind.preintegrated => Some([Self::new(l, &outside), Self::new(l, &inside)]),
            _ => None,
        }
    }

    /// Of a table that is whole (`Reader::new`).
    #[inline(always)]
    fn new(l: L, table: &SlabTable<'a>) -> Self {
        let &SlabTable { size, front, back, shown_before, warp, scale } = table;
        let (blocks, nodes) = (warp.len() as i32, size as i32);
        Self {
            front,
            back,
            warp,
            shown_before,
            size,
            blocks: l.splat(blocks as f32),
            last_block: l.splat_int(blocks - 1),
            scale: l.splat(scale),
            last_node: l.splat((nodes - 1) as f32),
            before_last: l.splat_int(nodes - 2),
            nodes: l.splat_int(nodes),
            last_shown: l.splat_int(shown_before.len() as i32 - 1),
        }
    }

    /// The node below codes, and how far on to the next they lie.
    #[inline(always)]
    pub(crate) fn entry(&self, l: L, code: L::F) -> (L::I, L::F) {
        let at = clamped(l, code * self.scale, self.blocks);
        let i = at.cut_off().smaller(self.last_block);
        // SAFETY: blocks were clamped to those of the warp.
        let (start, growth) = unsafe { l.twos(self.warp.as_ptr(), i) };
        let entry = clamped(l, start + (at - i.floats()) * growth, self.last_node);
        let node = entry.cut_off().smaller(self.before_last);
        (node, entry - node.floats())
    }

    /// Do slabs between nodes show anything?
    #[inline(always)]
    pub(crate) fn shows(&self, l: L, Nodes { front, back }: &Nodes<L>) -> L::M {
        let words = self.shown_before.as_ptr();
        let (lo, hi) = (front.0.smaller(back.0), front.0.larger(back.0) + l.splat_int(2));
        // Nothing is known of what lies beyond the last.
        let known = hi.smaller(self.last_shown);
        // SAFETY: nodes lie within the table, and more than its nodes are counted.
        let (before, after) = unsafe { (l.words(words, lo), l.words(words, known)) };
        !(before.same(after) & known.same(hi))
    }

    /// Of [`Self::front`] or [`Self::back`].
    #[inline(always)]
    pub(crate) fn look_up(&self, l: L, entries: &[[f32; 4]], nodes: &Nodes<L>) -> Sum<L> {
        let ((i, u), (j, v)) = (nodes.front, nodes.back);
        let at = i * self.nodes + j;
        // SAFETY: nodes are no larger than size - 2, and tables of size * size entries (`Reader::new`).
        unsafe { l.among_rows(entries.as_ptr(), at, self.size, [v, u]) }
    }
}
